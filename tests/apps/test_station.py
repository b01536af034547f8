"""`burg-drake station`: what there is, what it can do, and what is wrong, in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.apps import main
from burg_drake.core import builtin_names, resolve_reference
from burg_drake.motion import reachability

Capture = pytest.CaptureFixture[str]

BOWL = """\
version: 1
name: bowl
library: household
instances:
- {object: bowl, X_SO: {translation: [0.305, 0.31, -2.4e-05]}}
"""


@pytest.fixture(autouse=True)
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """A map of few points: what is printed about it is the same."""
    settings = reachability.ReachabilitySettings(
        spacing=0.15, heights=(0.05,), tilts_deg=(0.0, 45.0), headings=(1, 4), yaws=2
    )
    monkeypatch.setattr(reachability, "ReachabilitySettings", lambda: settings)


def own(folder: Path, *replaced: tuple[str, str], name: str = "panda_tabletop") -> Path:
    text = resolve_reference(name, "stations").read_text(encoding="utf-8")
    for old, new in replaced:
        assert old in text
        text = text.replace(old, new)
    path = folder / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_list_names_every_built_in_station(capsys: Capture) -> None:
    assert main(["station", "list"]) == 0
    head, _, *lines = capsys.readouterr().out.splitlines()
    assert head.split() == ["station", "description"]
    names = [line.split()[0] for line in lines if not line.startswith(" ")]
    assert names == builtin_names("stations")
    assert max(map(len, lines)) <= 80


def test_check_says_what_a_station_can_do(capsys: Capture) -> None:
    assert main(["station", "check", "panda_bin"]) == 0
    out, err = capsys.readouterr()
    for figure in (
        "panda_hand, opening 0 to 80 mm",
        "panda_arm, 7 joints",
        "at (0, 0, 0) m in the world, turned by (0, 0, 0) degrees",
        "0.95 m at most",
        "33 mm (panda_link2 to panda_link4)",
        "-3.072 to -0.070 rad, at home -2.356",
        "594 x 420 mm",
        "reached from straight above",
        "640 x 480 pixels, sees",
    ):
        assert figure in out
    assert err == ""


def test_check_of_a_station_without_an_arm(capsys: Capture) -> None:
    assert main(["station", "check", "wsg_tabletop"]) == 0
    out = capsys.readouterr().out
    assert "none: the hand alone" in out and "reached" not in out


@pytest.mark.thorough
def test_check_with_a_scene(tmp_path: Path, capsys: Capture) -> None:
    """The board mostly out of reach. The rim of the bowl, 5 cm high and 16 cm wide, begins 0.98 m
    in front of the arm, whose shoulder is 0.333 m high."""
    path = own(
        tmp_path,
        ("X_WS: {translation: [0.24,", "X_WS: {translation: [0.75,"),
        ("size: [1.2, 1.4, 0.1]", "size: [3.0, 1.4, 0.1]"),
    )
    (tmp_path / "bowl.yaml").write_text(BOWL)
    assert main(["station", "check", str(path), "--scene", str(tmp_path / "bowl.yaml")]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert (
        f"burg-drake: warning: {path}: 'bowl' is out of reach: it is 1.02 m from the arm's"
        " shoulder, and the arm reaches 0.95 m at most"
    ) in lines
    assert main(["station", "check", str(path)]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"burg-drake: warning: {path}: the arm reaches only ")
    assert line.endswith(" % of the board in any hand orientation")


@pytest.mark.parametrize(
    ("replaced", "message"),
    [
        (
            (("X_WS: {translation: [0.24,", "X_WS: {translation: [1.5,"),),
            "no part of the board is within reach: its nearest point is 1.54 m from the arm's"
            " shoulder, and the arm reaches 0.95 m at most; change X_WS or arm.X_WA",
        ),
        (
            (("  X_WA:", "  flange: panda_link9\n  X_FH: {}\n  X_WA:"),),
            "arm.flange: ",
        ),
        (
            (("  X_WA:", "  model: mine.yaml\n  X_WA:"),),
            "arm.model: ",
        ),
        (
            (("  X_WA:", "  velocity: [1, 1, 1]\n  X_WA:"),),
            "arm.velocity has 3 numbers, but the arm has 7 joints",
        ),
        (
            (("home: [0.0, -0.7853981634", "home: [0.0, 1.2"),),
            "at arm.home the arm collides in scene 'empty_board': ",
        ),
        (
            (("cameras:", "background:\n  rack: {X_WB: {translation: [0.1, 0, 0.1]},"
              " size: [0.1, 0.1, 0.2]}\ncameras:"),),
            "arm.X_WA puts the arm's base 21 mm deep into 'rack' by its collision shapes (",
        ),
    ],
)  # fmt: skip
def test_what_makes_a_station_useless_is_one_line(
    tmp_path: Path, capsys: Capture, replaced: tuple[tuple[str, str], ...], message: str
) -> None:
    path = own(tmp_path, *replaced)
    assert main(["station", "check", str(path)]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"burg-drake: error: {path}: {message}") and err.count("\n") == 1


def test_an_arm_that_cannot_bend_to_the_board(tmp_path: Path, capsys: Capture) -> None:
    """Within its span, but a ceiling 2 cm above the sheet keeps the hand away."""
    lid = "background:\n  lid: {X_WB: {translation: [0.45, 0, 0.125]}, size: [0.5, 0.8, 0.2]}\n"
    path = own(tmp_path, ("cameras:", f"{lid}cameras:"))
    assert main(["station", "check", str(path)]) == 2
    assert capsys.readouterr().err == (
        f"burg-drake: error: {path}: no part of the board is within reach: 5 cm above it, the arm"
        " reaches no point in any of 10 hand orientations; change X_WS, arm.X_WA or the"
        " obstacles\n"
    )


def test_show_writes_a_page(tmp_path: Path, capsys: Capture) -> None:
    page = tmp_path / "station.html"
    assert main(["station", "show", "panda_shelf", "--camera", "board", "--html", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    for said in ("share of 10 hand orientations", "cameras, upper edge bold", "longest reach"):
        assert said in text
    assert capsys.readouterr().out == f"wrote {page}\n"


def test_show_of_an_unknown_camera(capsys: Capture) -> None:
    assert main(["station", "show", "panda_tabletop", "--camera", "bord", "--no-wait"]) == 2
    path = resolve_reference("panda_tabletop", "stations")
    assert capsys.readouterr().err == (
        f"burg-drake: error: station 'panda_tabletop' ({path}) has no camera 'bord'; did you mean"
        " 'board'? Known: board, overview\n"
    )
