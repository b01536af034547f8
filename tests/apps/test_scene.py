"""`burg-drake scene`: showing and validating, and every way in which a scene can be wrong."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.core import builtin_names, resolve_reference
from burg_drake.scene import load_scene
from tests.hang_guard import HANG_GUARD
from tests.thorough import thorough

Capture = pytest.CaptureFixture[str]

MISTAKES = {
    "unknown object": (
        ("object: mug", "object: mugg"),
        "instances[0]: object 'mugg' is not in library LIBRARY; did you mean 'mug'? Known: KNOWN",
    ),
    "NaN pose": (
        ("[0.12, 0.11, 0.0]", "[.nan, 0.11, 0.0]"),
        "SCENE:7: instances[0].X_SO.translation[0]: '.nan' is not a finite number",
    ),
    "unknown key": (
        ("board:", "bord:"),
        "SCENE:4: unknown key 'bord'; did you mean 'board'?",
    ),
    "unknown library": (
        ("library: household", "library: houshold"),
        "SCENE: library: houshold does not exist (relative to FOLDER); did you mean 'household'?",
    ),
    "other version": (
        ("version: 1", "version: 9"),
        "SCENE:1: version: 9 cannot be read; this release reads version 1",
    ),
    "name of the robot": (
        ("- object: mug", "- name: hand\n    object: mug"),
        "SCENE: the station has something called 'hand' already",
    ),
}
UNSOUND = {
    "out of bounds": (
        ("[0.12, 0.11, 0.0]", "[0.12, 0.0, 0.0]"),
        "'mug' is off the board: 40.5 mm over the lower edge of the board (594 x 420 mm)",
    ),
    "millimetres": (
        ("[0.12, 0.11, 0.0]", "[120.0, 0.11, 0.0]"),
        "'mug' is off the board: 119 m over the right edge of the board (594 x 420 mm);"
        " check that translations are in metres",
    ),
    "in the ground": (
        ("[0.12, 0.11, 0.0]", "[0.12, 0.11, -0.02]"),
        "'mug' reaches 20.0 mm below the surface of the board; set z = 0.0000 to put it on top",
    ),
    "overlap": (
        ("[0.12, 0.11, 0.0]", "[0.29, 0.11, 0.0]"),
        "'mug' and 'bottle' overlap by ",
    ),
}


def edit_scene(scene_file: Path, edit: tuple[str, str]) -> Path:
    text = scene_file.read_text()
    assert edit[0] in text
    scene_file.write_text(text.replace(*edit, 1))
    return scene_file


@pytest.mark.parametrize(  # tests/station checks all of them
    "name", [n if n == "tabletop_six" else thorough(n) for n in builtin_names("scenes")]
)
def test_built_in_scenes_are_sound(name: str, capsys: Capture) -> None:
    assert main(["scene", "validate", name]) == 0
    path = resolve_reference(name, "scenes")
    assert capsys.readouterr().out == (
        f"{path}: no mistakes on station panda_tabletop: {len(load_scene(name).instances)} objects,"
        " all standing within the board, none overlapping another\n"
    )


@pytest.mark.parametrize("verb", [["scene", "validate"], ["scene", "show"], ["evaluate"]])
@pytest.mark.parametrize("mistake", MISTAKES)
def test_mistakes(verb: list[str], mistake: str, scene_file: Path, capsys: Capture) -> None:
    edit, message = MISTAKES[mistake]
    edit_scene(scene_file, edit)
    options = ["-o", str(scene_file.parent / "run")] if verb == ["evaluate"] else []
    assert main([*verb, str(scene_file), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    household = resolve_reference("household", "models")
    for word, value in {
        "SCENE": scene_file,
        "FOLDER": scene_file.parent,
        "LIBRARY": household,
        "KNOWN": ", ".join(sorted(p.name for p in household.iterdir() if p.is_dir())),
    }.items():
        message = message.replace(word, str(value))
    assert line.startswith("burg-drake: error: ")
    assert message in line


@pytest.mark.parametrize("fault", UNSOUND)
def test_unsound_scenes(fault: str, scene_file: Path, capsys: Capture) -> None:
    edit, message = UNSOUND[fault]
    edit_scene(scene_file, edit)
    assert main(["scene", "validate", str(scene_file)]) == 1
    assert f"error: {message}" in capsys.readouterr().out
    run = scene_file.parent / "run"
    assert main(["evaluate", str(scene_file), "-o", str(run), "--quiet"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"burg-drake: error: {scene_file}: {message}")
    assert not (run / "run.yaml").exists()


def test_an_unsound_scene_is_shown_with_a_warning(scene_file: Path, capsys: Capture) -> None:
    edit, message = UNSOUND["out of bounds"]
    edit_scene(scene_file, edit)
    page = scene_file.parent / "pages" / "scene.html"
    assert main(["scene", "show", str(scene_file), "--html", str(page)]) == 0
    captured = capsys.readouterr()
    assert captured.err == f"burg-drake: warning: {scene_file}: {message}\n"
    assert captured.out == f"wrote {page}\n"
    text = page.read_text()
    assert "<title>two</title>" in text
    assert "off the board" in text
    assert not re.search(r"<(script|img|link)[^>]*(src|href)=", text)


def test_hovering_is_only_a_warning(
    scene_file: Path, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of `evaluate`, which looks at a scene once and then reads of it in the cache."""
    monkeypatch.setenv("BURG_DRAKE_CACHE", str(tmp_path / "cache"))
    edit_scene(scene_file, ("[0.12, 0.11, 0.0]", "[0.12, 0.11, 0.05]"))
    assert main(["scene", "validate", str(scene_file)]) == 0
    warning = "warning: 'mug' hovers 50.0 mm above the board; it will fall when simulated\n"
    assert capsys.readouterr().out == warning
    for name in ("computed", "cached"):
        words = ["evaluate", str(scene_file), "--mode", "hand", "--blind", "-n", "1"]
        words += ["--engine", "screening", "--workers", "1"]
        assert main([*words, "-o", str(tmp_path / name), "--quiet"]) == 0
        assert f"burg-drake: {warning}" in capsys.readouterr().err


def test_a_path_of_a_checkout_names_the_built_in_scene(capsys: Capture, tmp_path: Path) -> None:
    assert main(["scene", "validate", str(tmp_path / "scenes" / "tabletop_six.yaml")]) == 2
    assert "tabletop_six.yaml does not exist; did you mean 'tabletop_six'?" in (
        capsys.readouterr().err
    )


@pytest.mark.parametrize(
    ("page", "message"),
    [("", "is a folder; give"), ("file/scene.html", "cannot write to folder")],
)
def test_unwritable_page(page: str, message: str, tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "file").write_text("")
    assert main(["scene", "show", "tabletop_six", "--html", str(tmp_path / page)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_live_view_without_waiting(capsys: Capture) -> None:
    assert main(["scene", "show", "tabletop_close", "--no-robot", "--no-wait"]) == 0
    printed = capsys.readouterr().out
    assert printed == "tabletop_close: not kept open; give --html FILE for a page that stays\n"


@pytest.mark.thorough
def test_live_view_ends_with_ctrl_c() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "burg_drake.apps.cli", "scene", "show", "tabletop_six"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        assert "http://localhost:" in process.stdout.readline()
        assert process.stdout.readline() == "It is served until you press Ctrl-C.\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=HANG_GUARD) == 0
        assert process.stderr.read() == ""
