"""`burg-drake printout`: what it writes and what it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.apps import main

Capture = pytest.CaptureFixture[str]


def test_it_writes_the_board(tmp_path: Path, capsys: Capture) -> None:
    output = tmp_path / "new" / "board.pdf"
    assert main(["printout", "tabletop_six", "--no-height-map", "-o", str(output)]) == 0
    assert capsys.readouterr().out == f"wrote {output}: instructions and 3 x 2 pages A4 landscape\n"
    options = ["--page", "a2", "--measured-mm", "99.5,100", "--margin-mm", "4.5", "--no-names"]
    options += ["--no-height-map", "--no-instructions"]
    assert main(["printout", "tabletop_six", *options, "-o", str(output)]) == 0
    assert capsys.readouterr().out == f"wrote {output}: 1 page A2 landscape\n"
    assert output.read_bytes().startswith(b"%PDF-")


def test_pages_of_ones_own_size_are_told_as_they_lie(tmp_path: Path, capsys: Capture) -> None:
    output = tmp_path / "board.pdf"
    for page, told in (("300x300", "300 x 300 mm"), ("210x297", "297 x 210 mm")):
        options = ["--no-height-map", "--page", page, "-o", str(output)]
        assert main(["printout", "tabletop_six", *options]) == 0
        line = capsys.readouterr().out.strip()
        assert line.endswith(f" pages {told}")


def test_out_of_bounds_is_a_warning(tmp_path: Path, capsys: Capture) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text(
        "version: 1\nname: edge\nlibrary: household\ninstances:\n"
        "  - {object: mug, X_SO: {translation: [0.02, 0.2, 0.0]}}\n"
    )
    assert main(["printout", str(scene), "-o", str(tmp_path / "board.pdf")]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line == (
        f"burg-drake: warning: {scene}: 'mug' is off the board: 20.5 mm over the left edge of the"
        " board (594 x 420 mm)"
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--page", "A44"], "page 'A44' does not exist; did you mean 'A4'? Known: A0, A1, A2"),
        (["--page", "100x100"], "page '100x100' must be at least 180 x 140 mm"),
        (
            ["--measured-mm", "9.85"],
            "the measured length of the 100 mm ruler is 9.85 mm; it",
        ),
        (["--measured-mm", "98,99,100"], "argument --measured-mm: '98,99,100' is not X or X,Y"),
        (["--measured-mm", "98,"], "argument --measured-mm: '' is not a finite number"),
        (["--margin-mm", "45"], "margins of 45 mm leave too little of page A4"),
        (["-o", "board.png"], "board.png: only PDF is written; end the name with .pdf"),
        (["-o", "/dev/null/board.pdf"], "cannot write /dev/null/board.pdf"),
    ],
)
def test_mistakes(options: list[str], message: str, tmp_path: Path, capsys: Capture) -> None:
    output = str(tmp_path / "board.pdf")
    try:
        code = main(["printout", "tabletop_six", "-o", output, *options])
    except SystemExit as end:
        code = int(end.code or 0)
    (line,) = capsys.readouterr().err.splitlines()
    assert code == 2 and line.startswith(f"burg-drake: error: {message}")
    assert not Path(output).exists()


def test_markers_that_do_not_fit(tmp_path: Path, capsys: Capture) -> None:
    scene = tmp_path / "scene.yaml"
    for markers, message in (
        ("{side: 0.5}", "markers of 500 mm with 15 mm between them do not fit on a board of 594"),
        (
            "{side: 0.3}",
            "a marker of 300 mm, with half of the gaps around it, does not fit on page A4",
        ),
    ):
        scene.write_text(
            f"version: 1\nname: large\nlibrary: household\nboard: {{markers: {markers}}}\n"
        )
        assert main(["printout", str(scene), "-o", str(tmp_path / "board.pdf")]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        where = f"{scene}: board.markers: " if message.startswith("markers") else ""
        assert line.startswith(f"burg-drake: error: {where}{message}")
