"""A run with a motion of its own: what it records, and that a row alone repeats it."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, Outcome, grasp_from_axes
from burg_drake.evaluation import (
    EvaluationSettings,
    Run,
    differences,
    evaluate,
    read_journal,
    read_origin,
    read_table,
    read_trial,
    reproduce_command,
    rerun,
    summarize,
    table_row,
)
from burg_drake.station import GraspMotion, load_station
from tests.evaluation.composed import tabletop

pytestmark = pytest.mark.usefixtures("judged_here")

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""
HANDLE = grasp_from_axes((0.0, 1.0, 0.0), (-0.18, 0.0, -0.98), (-0.071, 0.0, 0.012))
"""Across the handle of the household screwdriver, almost from above."""
MOTION = GraspMotion(retreat=0.02, lift_height=0.06, lift_direction=(0.0, -0.6, 0.8))
BOX = tabletop("box")
GRASPS = GraspSet.create(ABOVE[None], object="box", width=0.06)


def judged(folder: Path, motion: GraspMotion | None) -> Run:
    return evaluate(
        BOX,
        "panda_tabletop",
        folder,
        settings=EvaluationSettings(mode="hand", motion=motion),
        grasps=GRASPS,
        workers=1,
        progress=False,
    )


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return judged(tmp_path_factory.mktemp("motion") / "run", MOTION)


def test_a_row_tells_the_motion_and_repeats_the_trial(run: Run) -> None:
    row = table_row(read_table(run.table_path), 0)
    assert row["outcome"] == Outcome.LIFTED
    assert row["lift_height"] == 0.06
    assert row["lift"] == pytest.approx(0.08, abs=0.001)
    trial, origin = read_trial(row, "row"), read_origin(row, "row")
    assert origin.settings().motion == MOTION
    verdict, _ = rerun(BOX, load_station("panda_tabletop"), trial, origin)
    assert trial.verdict is not None and not differences(trial.verdict, verdict)


def test_another_motion_is_another_run(run: Run) -> None:
    with pytest.raises(InvalidInputError, match=r"motion is standoff 100 mm, retreat 20 .* here"):
        judged(run.path, None)
    assert judged(run.path, MOTION).complete
    assert len(read_journal(run.path / "journal.jsonl")) == 1


def test_the_report_says_how_to_ask_for_it_again(run: Run) -> None:
    words = shlex.split(reproduce_command(run))
    at = words.index("--retreat-mm")
    assert words[at : at + 4] == ["--retreat-mm", "20", "--lift-mm", "60"]
    np.testing.assert_array_equal([float(w) for w in words[at + 5 : at + 8]], MOTION.lift_direction)


@pytest.mark.thorough
def test_the_lift_for_which_the_arm_has_room_is_executed_and_repeated(tmp_path: Path) -> None:
    """Under the roof of the shelf there is no room for the whole lift; the row alone tells how far
    the hand was lifted, and the arm is not asked again."""
    scene, station = tabletop("screwdriver"), load_station("panda_shelf")
    run = evaluate(
        scene,
        station,
        tmp_path / "run",
        settings=EvaluationSettings(motion=GraspMotion(least_lift=0.02), engine="screening"),
        grasps=GraspSet.create(HANDLE[None], object="screwdriver", width=0.03),
        workers=1,
        progress=False,
    )
    row = table_row(read_table(run.table_path), 0)
    assert row["mode"] == "reach" and row["outcome"] == Outcome.LIFTED
    assert 0.02 <= row["lift_height"] < 0.3
    assert row["lift"] == pytest.approx(row["lift_height"], abs=0.005)
    assert str(summarize(run).lifts).startswith(
        "For 1 of 1 grasps there is no room to lift the whole"
    )
    trial, origin = read_trial(row, "row"), read_origin(row, "row")
    verdict, _ = rerun(scene, station, trial, origin)
    assert trial.verdict is not None and not differences(trial.verdict, verdict)
