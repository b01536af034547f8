"""Options are made of settings dataclasses, and settings of options."""

from __future__ import annotations

import ast
import math
import re
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pytest

import burg_drake
from burg_drake.apps import Parser, add_settings_options, main, settings_from
from burg_drake.core import Units, setting
from burg_drake.evaluation import EvaluationSettings, RobustnessSettings
from burg_drake.experiment import PlacementNoise
from burg_drake.grasping import Tolerance
from burg_drake.simulation import Noise
from burg_drake.station import GraspMotion


@dataclass(frozen=True, kw_only=True)
class Made:
    """One field of each kind."""

    count: int = setting(3, "how many", flags=("-c",), low=1)
    depth: float = setting(
        0.005, "how deep", unit=Units.millimetres, low=0, high=50, noun="a length"
    )
    turn: float = setting(math.radians(2.0), "how far round", unit=Units.degrees, low=0)
    share: float = setting(0.1, "of all", unit=Units.percent, above=0)
    way: float = setting(0.02, "as far as it goes", unit=Units.millimetres, above=0, infinite=True)
    fast: bool = setting(False, "hurry")
    level: bool = setting(True, "leave it as it stands", name="no_level")
    size: tuple[int, int] = setting((8, 11), "columns and rows", metavar="CxR")
    number: int = setting(0, "of the draw", high=(1 << 64) - 1)
    kind: str = setting("round", "which", choices=("round", "square"))
    hidden: float = 1.0


def parsed(*words: str, **others: object) -> Made:
    parser = Parser()
    add_settings_options(parser, Made)
    return settings_from(parser.parse_args(words), Made, **others)


def test_without_options_all_is_as_the_dataclass_has_it() -> None:
    assert parsed() == Made()
    assert parsed(hidden=2.0) == Made(hidden=2.0)


def test_values_come_back_in_si() -> None:
    words = "-c 5 --depth-mm 9 --turn-deg 90 --share-percent 50 --fast --kind square"
    assert parsed(*words.split()) == Made(
        count=5, depth=1e-3 * 9, turn=math.radians(90), share=0.5, fast=True, kind="square"
    )
    assert parsed("--way-mm", "inf").way == math.inf and parsed("--way-mm", "7").way == 1e-3 * 7
    words = f"--no-level --size 3x4 --number {(1 << 64) - 1}"
    assert parsed(*words.split()) == Made(level=False, size=(3, 4), number=(1 << 64) - 1)


def test_the_help_has_units_and_defaults() -> None:
    parser = Parser()
    add_settings_options(parser, Made)
    text = " ".join(parser.format_help().split())
    for part in (
        "--count N how many (default: 3)",
        "--depth-mm MM how deep (default: 5)",
        "--turn-deg DEG how far round (default: 2)",
        "--share-percent PERCENT of all (default: 10)",
        "--fast hurry",
        "--no-level leave it as it stands",
        "--size CxR columns and rows (default: 8x11)",
        "--kind {round,square} which (default: round)",
    ):
        assert part in text
    assert "hidden" not in text


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("-c 0", "'0' is not a whole number from 1 to 10,000,000"),
        (f"--number {1 << 64}", f"'{1 << 64}' is not a whole number from 0 to {(1 << 64) - 1:,}"),
        ("--size 3", "'3' is not two whole numbers"),
        ("--depth-mm 51", "51 is not a length from 0 to 50 mm"),
        ("--depth-mm deep", "'deep' is not a finite number"),
        ("--turn-deg -1", "-1 is below 0"),
        ("--turn-deg inf", "'inf' is not a finite number"),
        ("--way-mm=-inf", "'-inf' is not a finite number"),
        ("--way-mm 0", "0 is not above 0"),
        ("--share-percent 0", "0 is not above 0"),
    ],
)
def test_what_is_out_of_range(words: str, message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parsed(*words.split())
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    "settings",
    [EvaluationSettings, GraspMotion, Noise, PlacementNoise, RobustnessSettings, Tolerance],
)
def test_defaults_survive_the_way_through_their_units(settings: type) -> None:
    """To the bit: they are in hashes."""
    parser = Parser()
    names = [
        f.name for f in fields(settings) if "setting" in f.metadata and f.name != "lift_direction"
    ]
    add_settings_options(parser, settings, *names)
    found, usual = settings_from(parser.parse_args([]), settings), settings()
    assert [getattr(found, name) for name in names] == [getattr(usual, name) for name in names]


def test_units_that_files_tell_apart() -> None:
    assert (
        Units.millimetres.to_si(9.0) == 0.009000000000000001
        and Units.millimetres_by_division.to_si(9.0) == 0.009
    )


COMMANDS = {
    "benchmark/burg_planner.py",
    "benchmark/leaderboard.py",
    "cameras/calibration/target_sheet.py",
    "evaluation/cluster/document.py",
    "evaluation/report/reproduction.py",
    "evaluation/grasp_sets/mistake_search.py",
    "evaluation/grasp_sets/pose_mistakes.py",
    "experiment/lab/protocol.py",
}
"""Files with commands to type, of our program and of Dask's, or texts beside such a command; and a
file that is a program of its own."""
OPTION = re.compile(r"(^|[ `]|(?<!var)\()(--[a-z]|-o\b)")


def test_texts_of_the_library_do_not_name_options() -> None:
    """The command line adds them to an error that says which argument it is about."""
    root = Path(burg_drake.__file__).parent
    for path in root.rglob("*.py"):
        place = path.relative_to(root).as_posix()
        if place.startswith("apps/") or place in COMMANDS:
            continue
        assert [text for text in _texts(path) if OPTION.search(text) and " " in text] == [], place


def _texts(path: Path) -> list[str]:
    """The strings of a module, but for those that stand alone, such as docstrings."""
    text = path.read_text("utf-8")
    if not re.search(r"--[a-z]|-o\b", text):  # nor can any string of it have one
        return []
    nodes = list(ast.walk(ast.parse(text)))
    alone = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
    return [
        node.value
        for node in nodes
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in alone
    ]


def test_the_command_line_adds_the_option_of_an_argument(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    poses = tmp_path / "network.npy"
    np.save(poses, np.eye(4)[None])
    words = ["reach", "tabletop_six", "--grasps", str(poses), "--grasps-frame", "camera"]
    assert main(words) == 2
    assert capsys.readouterr().err.endswith("really in (--camera-pose, --grasps-frame)\n")
