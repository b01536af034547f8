"""Tables of all verbs with names that are too long and numbers that are too large or too small."""

from __future__ import annotations

import dataclasses
import io
import math
import re
from collections import Counter

import numpy as np
import pytest
from rich.console import Console

from burg_drake.apps import (
    comparison_table,
    displacement_table,
    library_table,
    number_table,
    outcome_table,
    placement_table,
    print_reach_tables,
    ranking_table,
    reach_table,
    sampling_table,
    summary_table,
)
from burg_drake.cameras import Placement
from burg_drake.core import GraspSet, Outcome, Pose, Stage, TextTable, make_pose
from burg_drake.evaluation import (
    GraspRobustness,
    OutcomeCounts,
    RobustnessSettings,
    StageCost,
    Summary,
    SummaryView,
    robustness_view,
)
from burg_drake.grasping import Tolerance, compare_grasps, rank_by, summarize
from burg_drake.objects import load_library
from burg_drake.simulation import SHAKE_AXES, TUG_DIRECTIONS, Displacement, HoldForces, SuccessRate
from burg_drake.station import GraspMotion

NAME = "a_scanned_thing_with_a_name_of_sixty_characters_from_a_robot"
VALUES = (1e-9, 1e9, math.nan, math.inf, -123456.789, 0.0)
MANY = 123_456_789


def grasps(seed: int) -> GraspSet:
    rng = np.random.default_rng(seed)
    n = len(VALUES)
    return GraspSet.create(
        make_pose(p_AB=1e5 * rng.normal(size=(n, 3))),
        object=[NAME, "mug"] * (n // 2),
        width=[1e-9, 1e6, math.nan] * (n // 3),
        score=[1e-9, 1e9, math.nan] * (n // 3),
        columns={
            "slide": np.array(VALUES),
            "label": np.array([0, 1] * (n // 2)),
            "outcome": np.array(["reachable", "no_ik"] * (n // 2)),
            "blocker": np.array(["", NAME] * (n // 2)),
        },
    )


def numbers() -> TextTable:
    heads = [f"{k}%" for k in range(len(VALUES))]
    figures = dict(zip(heads, VALUES, strict=True))
    return number_table("", heads, {"x": (MANY, figures), NAME: (MANY, figures)})


def library() -> TextTable:
    entry = load_library("household").entry("mug")
    heavy = dataclasses.replace(entry.mass_properties, mass=1e9)
    entry = dataclasses.replace(entry, mass_properties=heavy, friction=1e-9, upper=(1e9,) * 3)
    return library_table({NAME: entry})


def robustness() -> TextTable:
    tug = HoldForces({name: 1e9 for name in TUG_DIRECTIONS}, 1.0)
    shake = HoldForces({name: math.inf for name in SHAKE_AXES}, 1.0)
    rate = SuccessRate(Counter({Outcome.LIFTED: 10**9}))
    known = GraspRobustness(f"{NAME}-0123", NAME, NAME, 1e-9, tug, shake, 1e9, rate)
    unknown = GraspRobustness("mug-0123", "mug", "mug", 0.24)
    return robustness_view([known, unknown], RobustnessSettings())


def placements() -> TextTable:
    far = Placement(
        object=NAME,
        status="uncertain",
        target=Pose(),
        displacement=(1e6, -1e6),
        displacement_sd=(1e-9, 1e6),
        angle=1e-9,
        angle_sd=1e9,
        reason="another turn fits as well, and nothing of the outline can be seen",
    )
    unseen = Placement(object="mug", status="not_seen", target=Pose(), reason="hidden by " + NAME)
    return placement_table({NAME: far, "mug": unseen})


COUNTS = {NAME: Counter({Outcome.REACHABLE: MANY, Outcome.NO_IK: MANY}), "mug": Counter()}
TABLES = {
    "numbers": numbers,
    "summary": lambda: summary_table(NAME, summarize(grasps(0), lever=0.05)),
    "comparison": lambda: comparison_table(compare_grasps(grasps(0), grasps(1), Tolerance())),
    "ranking": lambda: ranking_table(rank_by(grasps(0), "label")),
    "library": library,
    "robustness": robustness,
    "placement": placements,
    "reach": lambda: reach_table(COUNTS, COUNTS[NAME]),
    "outcomes": lambda: outcome_table(grasps(0), COUNTS, COUNTS[NAME]),
    "sampled": lambda: sampling_table(
        {
            name: dataclasses.replace(grasps(0), provenance={"rays": 10**12, "tried": MANY})
            for name in (NAME, "mug")
        },
        {NAME: 1e9, "mug": 1e-9},
        MANY,
    ),
    "displacements": lambda: displacement_table(
        {NAME: Displacement(1e9, 1e-9), "mug": Displacement(math.nan, math.inf)}
    ),
}


def require_whole(lines: list[str], cells: Counter[str], width: int) -> None:
    assert max(map(len, lines)) <= width, "\n".join(lines)
    text = "\n".join(lines)
    for cell, times in cells.items():
        found = re.findall(rf"(?<!\S){re.escape(cell)}(?!\S)", text)
        assert len(found) >= times, f"{cell!r} in\n{text}"
    assert "nan" not in text and not re.search(r"\d{12}|\.\d{7}", text), text


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize("name", TABLES)
def test_numbers_are_whole_and_lines_fit(name: str, width: int) -> None:
    table = TABLES[name]()
    lines = [line for line, _ in table.lines(width)]
    require_whole(lines, table.figures(), width)


@pytest.mark.parametrize("width", [60, 80, 120])
@pytest.mark.parametrize("mode", ["hand", "arm"])
def test_a_summary_fits(mode: str, width: int) -> None:
    counts = Counter({Outcome.LIFTED: MANY, Outcome.COLLISION_BACKGROUND: 1})
    decided = Counter({Stage.EXECUTED: MANY, Stage.CLEAR: 1})
    groups = [OutcomeCounts(n, MANY + 1, counts, decided, Counter()) for n in (NAME, "mug", "all")]
    costs = (StageCost("clear", MANY, 1e9, 1e-9), StageCost("executed", MANY, 1e-9, math.nan))
    summary = Summary(tuple(groups[:2]), groups[2], costs, mode)  # type: ignore[arg-type]
    stream = io.StringIO()
    Console(file=stream, width=width).print(SummaryView(summary))
    lines = stream.getvalue().splitlines()
    stages = len(summary.steps) - 2  # of which all but one pass
    cells = Counter({"123,456,790": 3, "123,456,789": 3 * stages, "1e9": 1})
    require_whole(lines, cells, width)
    assert any(line.startswith("a_scanned") for line in lines)


def test_names_lose_their_middle_and_stay_different() -> None:
    table = TextTable().names("object").numbers("n")
    table.row("front" + "x" * 60 + "back", "1")
    assert [line for line, _ in table.lines(20)][2:] == ["frontxxxx…xxxxback 1"]
    table.row("front" + "x" * 40 + "y" + "x" * 19 + "back", "2")  # would look the same
    text = "".join(line[:18].strip() for line, _ in table.lines(20)[2:])
    assert text == "front" + "x" * 60 + "back" + "front" + "x" * 40 + "y" + "x" * 19 + "back"


def test_texts_wrap_between_words_and_keep_numbers_with_their_units() -> None:
    table = TextTable().texts("", "")
    table.row("reached", "87 % from above, 93 % from 15 mm on")
    assert [line for line, _ in table.lines(28)] == [
        "reached 87 % from above,",
        "        93 % from 15 mm on",
    ]


def test_what_does_not_fit_side_by_side_goes_on_below() -> None:
    table = TextTable("figures").names("object").numbers("first", "second [mm]", "third")
    table.row("mug", "123,456,789", "1", "-1.23e-9")
    assert [line for line, _ in table.lines(24)] == [
        "figures",
        "",
        "object        first",
        "───────────────────",
        "mug     123,456,789",
        "",
        "        second",
        "object    [mm]     third",
        "────────────────────────",
        "mug          1  -1.23e-9",
    ]


def test_objects_without_a_clear_grasp_have_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    """One without any grasp counts 0; one whose grasps all collide is told with what they hit, one
    that cannot be lifted with what may help."""
    judged = GraspSet.create(
        np.tile(np.eye(4), (5, 1, 1)),
        object=["box", "mug", "mug", "mug", "can"],
        columns={
            "outcome": [
                "reachable",
                *("collision_table", "collision_target", "collision_table"),
                "lift_line",
            ],
            "blocker": ["", "table", "mug", "table", ""],
            "cpu": [0.0] * 5,
        },
    )
    print_reach_tables(judged, ["box", "marble", "mug", "can"], GraspMotion(retreat=0.1))
    out = capsys.readouterr().out
    rows = [line.split() for line in out.splitlines()]
    for row in ("box 1 1 1 100 %", "marble 0 0 0 -", "mug 3 0 0 -", "all 5 2 1 50.0 %"):
        assert row.split() in rows
    assert [line for line in out.splitlines() if line.startswith("note: ")] == [
        "note: mug: none of 3 grasps is clear: the open hand hits the table in 2, the open hand"
        " hits the object itself in 1; sample grasps at which the hand is clear, as is the"
        " default",
        "note: can: none of 1 grasp is reachable: lift line in 1; a shorter lift (least_lift)"
        " may help",
    ]
