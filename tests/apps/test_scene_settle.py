"""`burg-drake scene settle`: what it writes, and what it says about what does not come to rest."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.core import resolve_reference
from burg_drake.scene import load_scene

Capture = pytest.CaptureFixture[str]

IN_THE_AIR = ("[0.12, 0.11, 0.0]", "[0.12, 0.11, 0.02]")


def edited(scene_file: Path, *edits: tuple[str, str]) -> Path:
    text = scene_file.read_text()
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    scene_file.write_text(text)
    return scene_file


def settle(scene_file: Path, *options: str) -> tuple[int, Path]:
    out = scene_file.parent / "out" / "settled.yaml"
    return main(["scene", "settle", str(scene_file), "-o", str(out), "--quiet", *options]), out


def test_what_hovers_falls(scene_file: Path, capsys: Capture) -> None:
    code, out = settle(edited(scene_file, IN_THE_AIR))
    printed = capsys.readouterr()
    assert code == 0 and printed.err == ""
    head, _, mug, bottle, rest, wrote = printed.out.splitlines()
    assert head.split() == ["object", "moved", "[mm]", "turned", "[deg]"]
    assert re.fullmatch(r"mug +(19|20)\.\d +0\.\d", mug)
    assert re.fullmatch(r"bottle +0\.\d +0\.\d", bottle)
    assert re.fullmatch(r"at rest after 0\.\d\d s", rest)
    assert wrote == f"wrote {out}"
    assert "library: household\n" in out.read_text()
    assert main(["scene", "validate", str(out)]) == 0
    assert load_scene(out).X_SO("mug")[2, 3] == pytest.approx(0.0, abs=1e-3)


def test_a_library_of_ones_own_is_found_from_the_new_place(scene_file: Path) -> None:
    shutil.copytree(resolve_reference("household", "models"), scene_file.parent / "mine")
    code, out = settle(edited(scene_file, ("library: household", "library: mine")))
    assert code == 0
    assert "library: ../mine\n" in out.read_text()
    assert load_scene(out).library.root == scene_file.parent / "mine"


def test_what_still_moves_is_named_and_nothing_is_written(
    scene_file: Path, capsys: Capture
) -> None:
    """0.3 s after it was let go, the mug falls at 2.8 m/s (the mean of the last 40 ms)."""
    edited(scene_file, ("[0.12, 0.11, 0.0]", "[0.12, 0.11, 1.0]"))
    code, out = settle(scene_file, "--time-limit", "0.32")
    assert code == 1 and not out.exists()
    (line,) = capsys.readouterr().err.splitlines()
    assert re.fullmatch(
        rf"burg-drake: {scene_file}: after 0\.32 s something still moves: 'mug' at"
        r" 29\d\d\.\d\d mm/s and 0\.00 deg/s; give a longer --time-limit, or --keep",
        line,
    )
    code, out = settle(scene_file, "--time-limit", "0.32", "--keep")
    assert code == 1
    assert capsys.readouterr().err.endswith("; give a longer --time-limit\n")
    assert 0.4 < load_scene(out).X_SO("mug")[2, 3] < 0.6


def test_what_falls_off_the_table_is_named(scene_file: Path, capsys: Capture) -> None:
    edited(scene_file, ("[0.12, 0.11, 0.0]", "[9.0, 0.11, 0.0]"))
    code, out = settle(scene_file)
    assert code == 1 and not out.exists()
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"burg-drake: {scene_file}: fell off the table: mug"
    code, out = settle(scene_file, "--keep")
    assert code == 1
    assert list(load_scene(out).instances) == ["bottle"]


@pytest.mark.parametrize(
    "verb",
    [
        ["scene", "settle", "nothing", "-o"],
        ["scene", "import-burg", "nothing", "--library", "nothing", "-o"],
        ["robustness", "nothing", "-o"],
        ["reach", "nothing", "-o"],
        ["reach", "nothing", "--plans"],
        ["grasps", "stats", "nothing", "--json"],
    ],
)
def test_the_output_of_a_verb_is_checked_before_its_input(
    verb: list[str], tmp_path: Path, capsys: Capture
) -> None:
    (tmp_path / "file").write_text("in the way")
    output = tmp_path / "file" / "below.csv"
    assert main([*verb, str(output)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"burg-drake: error: cannot write {output}"), error
    assert error.count("Not a directory; choose a writable place") == 1


def test_what_validate_refuses_is_not_settled(scene_file: Path, capsys: Capture) -> None:
    """The mug reaches over the edge of the board, not of the table."""
    edited(scene_file, ("[0.12, 0.11, 0.0]", "[0.01, 0.11, 0.02]"))
    code, out = settle(scene_file)
    printed = capsys.readouterr()
    assert code == 1 and not out.exists() and "wrote" not in printed.out
    (line,) = printed.err.splitlines()
    assert line.startswith(f"burg-drake: {scene_file}: 'mug' is off the board: ")
    code, out = settle(scene_file, "--keep")
    assert code == 1 and f"wrote {out}" in capsys.readouterr().out
    assert main(["scene", "validate", str(out)]) == 1


def test_the_scene_itself_is_not_written_over(scene_file: Path, capsys: Capture) -> None:
    before = scene_file.read_bytes()
    there = scene_file.parent / "." / "out" / ".." / scene_file.name
    assert main(["scene", "settle", str(scene_file), "-o", str(there)]) == 2
    error = capsys.readouterr().err
    assert error == f"burg-drake: error: -o {there} is the scene itself; choose another file\n"
    assert scene_file.read_bytes() == before


@pytest.mark.parametrize("x", [0.12, 9.0], ids=["under the table", "beside it"])
def test_what_starts_below_the_table_did_not_fall_off(
    x: float, scene_file: Path, capsys: Capture
) -> None:
    edited(scene_file, ("[0.12, 0.11, 0.0]", f"[{x}, 0.11, -2.0]"))
    code, out = settle(scene_file)
    assert code == 2 and not out.exists()
    (line,) = capsys.readouterr().err.splitlines()
    start = f"burg-drake: error: {scene_file}: 'mug' starts "
    assert line.startswith(start)
    assert re.fullmatch(r"19\d\d mm below the top of the table; move it up", line[len(start) :])


def test_overlapping_objects(scene_file: Path, capsys: Capture) -> None:
    edited(scene_file, ("[0.12, 0.11, 0.0]", "[0.29, 0.11, 0.0]"))
    code, _ = settle(scene_file)
    assert code == 2
    assert "'mug' and 'bottle' overlap by " in capsys.readouterr().err
