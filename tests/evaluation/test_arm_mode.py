"""Runs whose grasps the whole arm executes: what they record, and that a row gives it back."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from burg_drake.core import GraspSet, Outcome, Stage, grasp_from_axes, make_pose
from burg_drake.evaluation import (
    EvaluationSettings,
    Pushes,
    Run,
    as_result,
    count_pushes,
    decisive_mode,
    differences,
    evaluate,
    read_origin,
    read_table,
    read_trial,
    rerun,
    summarize,
    summary_view,
    table_row,
)
from burg_drake.station import load_station
from tests.evaluation.composed import tabletop

pytestmark = pytest.mark.usefixtures("judged_here")

ABOVE = grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18))
"""Across the narrow side of the household box, from above."""
BOX = tabletop("box")
GRASPS = np.stack([ABOVE, ABOVE @ make_pose(p_AB=(0, 0, 0.1))])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return evaluate(
        BOX,
        "panda_tabletop",
        tmp_path_factory.mktemp("arm") / "run",
        settings=EvaluationSettings(engine="screening", mode="arm"),
        grasps={"box": GraspSet.create(GRASPS, object="box", width=0.06)},
        workers=1,
        progress=False,
    )


def test_the_arm_lifts_what_the_hand_lifts(run: Run) -> None:
    assert run.results["outcome"].tolist() == ["lifted", "collision_target"]
    row = run.row(run.candidates.id[0])
    assert row["stage"] == "executed" and row["mode"] == "arm"
    assert row["lift"] == pytest.approx(0.30, abs=0.01)
    assert 0.0 <= row["tracking_error"] < 0.02 and 0.0 <= row["tracking_distance"] < 0.01
    assert row["duration"] > 2.0 and row["touched"] == ""
    assert row["pushed"] == pytest.approx(0.0, abs=2e-3)
    assert np.isfinite([row[f"q_grasp_{k}"] for k in range(1, 8)]).all()
    assert all(row[f"cpu_{stage}"] > 0.0 for stage in ("clear", "reach", "plan", "trial"))
    summary = summarize(run)
    assert summary.steps[:5] == ["candidates", "clear", "reachable", "planned", "executed"]
    assert [summary.total.funnel[name] for name in summary.steps[:5]] == [2, 1, 1, 1, 1]
    assert [cost.name for cost in summary.costs] == [str(stage) for stage in Stage]
    text = "The approach moved an object by more than 1 mm in 0 of 1 trials."
    assert str(summary.pushes) == text
    stream = io.StringIO()
    Console(file=stream, width=80).print(summary_view(summary))
    assert text in stream.getvalue()
    assert text in run.report_path.read_text()


def test_pushes_of_the_target_and_of_others_are_counted_apart(run: Run) -> None:
    """Seven trials, as a table has them; one has failed."""
    columns = dict(run.results)
    columns |= {"instance": np.array(["box", "box", "can", "can", "mug", "mug", "mug"])}
    columns |= {
        "pushed": np.array([0.0, 0.003, 0.02, 0.0009, 0.05, 0.05, np.nan]),
        "pushed_box": np.array([0.0, 0.003, 0.02, 0.0009, 0.0, 0.0, np.nan]),
        "pushed_can": np.array([0.0, 0.0, 0.012, 0.0, 0.05, 0.04, np.nan]),
        "pushed_mug": np.array([0.0, 0.0, 0.0, 0.0, 0.03, 0.0011, np.nan]),
    }
    found = count_pushes(columns)
    assert found == Pushes(trials=6, pushed=4, largest=0.05, target_pushed=4, target_largest=0.03)
    assert str(found).endswith(
        " 1 mm in 4 of 6 trials (largest 50.0 mm), the object to be grasped in 4 (largest 30.0 mm)."
    )
    assert count_pushes({**columns, "pushed": np.full(7, np.nan)}) is None
    assert count_pushes({"outcome": columns["outcome"]}) is None


def test_a_row_alone_gives_the_same_bits(run: Run) -> None:
    row = table_row(read_table(run.table_path), 0)
    trial, origin = read_trial(row, "here"), read_origin(row, "here")
    assert trial.verdict is not None and decisive_mode(trial, origin) == "arm"
    verdict, plan = rerun(BOX, load_station("panda_tabletop"), trial, origin)
    assert differences(trial.verdict, verdict) == []
    assert plan is not None and plan.duration == row["duration"]
    assert as_result(verdict).outcome is Outcome.LIFTED


def test_what_the_hand_decides_is_rerun_without_the_arm(run: Run) -> None:
    trial = run.trial(run.candidates.id[1])
    origin = read_origin(run.row(trial.id), "here")
    assert decisive_mode(trial, origin) == "hand"


def test_the_report_tells_how_the_arm_did(run: Run) -> None:
    page = run.report_path.read_text()
    for text in (
        "What stopped the arm",
        "The open hand is clear at 1 grasps. The arm can execute 1 of them",
        "Execution by the arm",
        "by the whole arm",
    ):
        assert text in page, text
