"""A run in which the hand alone approaches: what it records, and that a row alone repeats it."""

from __future__ import annotations

import dataclasses
import shlex
from pathlib import Path

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import GraspSet, InvalidInputError, Outcome, Stage, grasp_from_axes
from burg_drake.evaluation import (
    EvaluationSettings,
    Run,
    differences,
    evaluate,
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
from tests.thorough import thorough

pytestmark = pytest.mark.usefixtures("judged_here")

BOX = tabletop("box")
GRASPS = GraspSet.create(
    np.array(
        [
            grasp_from_axes((1, 0, 0), (0, 0, -1), (0.0, 0.0, 0.18)),
            # from below: clear at the grasp, and below the table where the approach begins
            grasp_from_axes((1, 0, 0), (0, 0.8, 0.6), (0.0, -0.07, 0.13)),
        ]
    ),
    object="box",
    width=0.06,
)
MOTION = GraspMotion(standoff=0.14)


@pytest.fixture(scope="module", params=["csv", thorough("parquet")])
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    if request.param == "parquet":
        pytest.importorskip("pyarrow")
    settings = EvaluationSettings(
        mode="hand", engine="screening", approach=True, motion=MOTION, table=request.param
    )
    return evaluate(
        BOX,
        "panda_tabletop",
        tmp_path_factory.mktemp("approach") / "run",
        settings=settings,
        grasps=GRASPS,
        workers=1,
        progress=False,
    )


def test_rows_tell_the_approach_and_repeat_the_trials(run: Run) -> None:
    columns = read_table(run.table_path)
    assert {"pushed", "pushed_box", "touched"} <= columns.keys()
    assert columns["outcome"].tolist() == [Outcome.LIFTED, Outcome.HAND_COLLISION_APPROACH]
    assert columns["stage"].tolist() == [Stage.EXECUTED, Stage.REACHABLE]
    assert columns["blocker"].tolist() == ["", "table"]
    assert columns["pushed_box"][0] == columns["pushed"][0] == 0.0
    for k in range(2):
        row = table_row(columns, k)
        trial, origin = read_trial(row, "row"), read_origin(row, "row")
        assert origin.settings().approach and origin.settings().motion == MOTION
        verdict, _ = rerun(BOX, load_station("panda_tabletop"), trial, origin)
        assert trial.verdict is not None and not differences(trial.verdict, verdict)


def test_the_summary_tells_where_grasps_were_lost(run: Run) -> None:
    summary = summarize(run)
    assert summary.steps == ["candidates", "clear", "reachable", "executed", "held", "lifted"]
    assert [summary.total.funnel[step] for step in summary.steps] == [2, 2, 1, 1, 1, 1]
    assert str(summary.pushes) == "The approach moved an object by more than 1 mm in 0 of 1 trials."
    page = run.report_path.read_text("utf-8")
    assert "hand collision approach" in page


def test_the_report_says_how_to_ask_for_it_again(run: Run) -> None:
    words = shlex.split(reproduce_command(run))
    assert "--approach" in words
    assert words[words.index("--standoff-mm") + 1] == "140"


def test_without_an_approach_there_are_no_such_columns(tmp_path: Path) -> None:
    settings = EvaluationSettings(mode="hand", engine="screening")
    run = evaluate(
        BOX, "panda_tabletop", tmp_path / "run", settings=settings, grasps=GRASPS, workers=1,
        progress=False,
    )  # fmt: skip
    assert not {"pushed", "pushed_box", "touched"} & run.results.keys()
    assert run.results["outcome"].tolist() == [Outcome.LIFTED] * 2
    assert summarize(run).steps == ["candidates", "clear", "executed", "held", "lifted"]
    assert "--approach" not in reproduce_command(run)


def test_an_approach_of_no_length_is_a_contradiction(tmp_path: Path) -> None:
    settings = EvaluationSettings(mode="hand", approach=True, motion=GraspMotion(standoff=0.0))
    message = "the standoff asked for is 0 mm; give a standoff above 0"
    with pytest.raises(InvalidInputError, match=message):
        evaluate(BOX, "panda_tabletop", tmp_path / "run", settings=settings, grasps=GRASPS)
    station = load_station("panda_tabletop")
    document = dataclasses.replace(station.document, motion=GraspMotion(standoff=0.0))
    near = dataclasses.replace(station, document=document)
    settings = EvaluationSettings(mode="hand", approach=True)
    with pytest.raises(InvalidInputError, match="the standoff of station 'panda_tabletop' is 0"):
        evaluate(BOX, near, tmp_path / "run", settings=settings, grasps=GRASPS)
    assert not (tmp_path / "run").exists()


def test_the_options_of_it_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["evaluate", "tabletop_six", "-o", str(tmp_path / "run"), "--mode", "hand"]
    assert main([*words, "--approach", "--standoff-mm", "0"]) == 2
    assert capsys.readouterr().err.endswith("or leave approach out (--approach, --standoff-mm)\n")
