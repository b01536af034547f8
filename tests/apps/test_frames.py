"""`burg-drake frames`: tables without pydrake, and a page that is complete."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from burg_drake.apps import DEFAULT_HAND, build_parser, main
from burg_drake.formats import GRASP_FORMATS, PANDA_GRIPPER

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal wide enough for the tables."""
    monkeypatch.setenv("COLUMNS", "200")


def test_tables(capsys: Capture) -> None:
    assert main(["frames", "--text"]) == 0
    out = capsys.readouterr().out
    for letter, name in zip(
        "WSOHGPAC",
        ("world", "scene", "object", "hand", "grasp", "pregrasp", "arm", "camera"),
        strict=True,
    ):
        assert any(line.split()[:2] == [letter, name] for line in out.splitlines()), letter
    rows: dict[str, str] = {}
    for line in out.splitlines():
        rows.setdefault((line.split() or [""])[0], line)
    for name, format in GRASP_FORMATS.items():
        assert format.suffixes[0] in rows[name] and f" {format.frame} " in rows[name]
    assert "103.4 mm behind G" in rows["acronym"]


def test_some_formats_for_another_hand(capsys: Capture) -> None:
    assert main(["frames", "acronym", "--text", "--hand", "wsg_50"]) == 0
    out = capsys.readouterr().out
    assert "for wsg_50" in out and "isaac_grasp" not in out
    row, lost = [line for line in out.splitlines() if line.split()[:1] == ["acronym"]]
    assert "several objects" in lost
    assert "103.4" not in row


def test_text_and_help_do_not_load_drake() -> None:
    """Nor other slow modules."""
    code = (
        "import sys; from burg_drake.apps.cli import main\n"
        "try: main(sys.argv[1:])\n"
        "except SystemExit: pass\n"
        "print([m for m in ('pydrake', 'trimesh', 'cv2', 'coacd') if m in sys.modules])"
    )
    for arguments in (["frames", "--text"], ["frames", "--help"], ["grasps", "show", "--help"]):
        done = subprocess.run(
            [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True
        )
        assert done.stdout.splitlines()[-1] == "[]", arguments


def test_page(tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / "frames.html"
    assert main(["frames", "--html", str(page)]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == f"wrote {page}"
    text = page.read_text()
    assert "<title>Grasp frames</title>" in text
    assert 'data-paths="/drake/frames/F"' in text
    assert "<script src" not in text and "@import" not in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["acronyms"], "there is no grasp format 'acronyms'; did you mean 'acronym'?"),
        (["--hand", "panda_hnd"], "panda_hnd"),
    ],
)
def test_refusals(arguments: list[str], message: str, capsys: Capture) -> None:
    assert main(["frames", "--text", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line


def test_the_default_hand_is_the_one_that_formats_know() -> None:
    assert PANDA_GRIPPER.name == DEFAULT_HAND


def test_examples_of_the_help_can_be_parsed(capsys: Capture) -> None:
    with pytest.raises(SystemExit):
        main(["frames", "--help"])
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  burg-")]
    assert len(lines) == 3
    for line in lines:
        build_parser().parse_args(line.split()[1:])
