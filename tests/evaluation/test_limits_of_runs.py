"""A run with limits of its own: what it records, and that a row alone repeats it."""

from __future__ import annotations

import dataclasses
import math
import shlex
import shutil
from pathlib import Path

import pytest
import yaml

from burg_drake.core import GraspSet, InvalidInputError, Outcome, UnknownNameError, grasp_from_axes
from burg_drake.evaluation import (
    EvaluationSettings,
    Run,
    differences,
    evaluate,
    grasp_limits,
    limit_settings,
    limits_text,
    load_run,
    read_origin,
    read_table,
    read_trial,
    reproduce_command,
    rerun,
    summarize,
    table_row,
)
from burg_drake.simulation import DEFAULT_TRIAL
from burg_drake.station import load_station
from tests.evaluation.composed import tabletop

pytestmark = pytest.mark.usefixtures("judged_here")

BEHIND = grasp_from_axes((0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (-0.071, 0.0, 0.012))
"""Across the end of the household screwdriver's handle, from above: its shaft hangs down."""
SCENE = tabletop("screwdriver")
GRASPS = GraspSet.create(BEHIND[None], object="screwdriver", width=0.03)


def judged(folder: Path, **settings: float) -> Run:
    asked = EvaluationSettings(mode="hand", engine="screening", **settings)
    return evaluate(
        SCENE, "panda_tabletop", folder, settings=asked, grasps=GRASPS, workers=1, progress=False
    )


@pytest.fixture(scope="module")
def unlimited(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("unlimited") / "run"
    return judged(folder, tilt_limit_deg=180, slip_limit_mm=math.inf)


@pytest.fixture(scope="module")
def limited(unlimited: Run, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """By half of the tilt that it comes to."""
    tilt = math.degrees(float(unlimited.results["tilt"][0]))
    return judged(tmp_path_factory.mktemp("limited") / "run", tilt_limit_deg=round(tilt / 2, 3))


def test_a_row_tells_the_limits_and_repeats_the_trial(unlimited: Run, limited: Run) -> None:
    for run, outcome in ((unlimited, Outcome.LIFTED), (limited, Outcome.LIFTED_TURNED)):
        row = table_row(read_table(run.table_path), 0)
        assert row["outcome"] == outcome
        trial, origin = read_trial(row, "row"), read_origin(row, "row")
        verdict, _ = rerun(SCENE, load_station("panda_tabletop"), trial, origin)
        assert trial.verdict is not None and not differences(trial.verdict, verdict)
    assert summarize(limited).total.held == 1 and summarize(limited).total.lifted == 0


def test_other_limits_are_another_run(limited: Run) -> None:
    there = limits_text(limited.document.trial)
    with pytest.raises(InvalidInputError) as caught:
        judged(limited.path, tilt_limit_deg=40, slip_limit_mm=5)
    assert f"limit in the hand is {there} there, tilt 40 degrees, slip 5 mm here" in str(
        caught.value
    )
    with pytest.raises(InvalidInputError, match="approach of the hand is not simulated there"):
        judged(limited.path, **limit_settings(limited.document.trial) | {"approach": True})
    assert judged(limited.path, **limit_settings(limited.document.trial)).complete


def test_the_report_says_how_to_ask_for_it_again(unlimited: Run, limited: Run) -> None:
    words = shlex.split(reproduce_command(unlimited))
    at = words.index("--tilt-limit")
    assert words[at : at + 4] == ["--tilt-limit", "180.0", "--slip-limit-mm", "inf"]
    words = shlex.split(reproduce_command(limited))
    tilt = float(words[words.index("--tilt-limit") + 1])
    assert math.radians(tilt) == limited.document.trial["tilt_limit"]
    assert "--slip-limit-mm" not in words


def test_a_run_of_a_release_without_limits_has_none(unlimited: Run, tmp_path: Path) -> None:
    """Nothing of it tells a limit, and its grasp is lifted when it is repeated."""
    document = yaml.safe_load((unlimited.path / "run.yaml").read_text())
    for name in ("tilt_limit", "slip_limit", "approach"):
        document["trial"].pop(name, None)
    for file in unlimited.path.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_bytes(file.read_bytes())
    (tmp_path / "run.yaml").write_text(yaml.safe_dump(document))
    old = load_run(tmp_path)
    assert limits_text(old.document.trial) == "none"
    row = table_row(old.results, 0)
    verdict, _ = rerun(
        SCENE, load_station("panda_tabletop"), read_trial(row, "row"), read_origin(row, "row")
    )
    assert verdict.outcome is Outcome.LIFTED
    with pytest.raises(InvalidInputError, match="none there, tilt 30 degrees"):
        judged(tmp_path)


def test_a_run_that_watched_centres_of_mass_is_not_continued(limited: Run, tmp_path: Path) -> None:
    shutil.copytree(limited.path, tmp_path / "run")
    document = yaml.safe_load((limited.path / "run.yaml").read_text())
    assert document["trial"].pop("farthest_point") == 1
    (tmp_path / "run" / "run.yaml").write_text(yaml.safe_dump(document))
    message = r"\(motion of others is of centres of mass there, of farthest points here\)"
    with pytest.raises(InvalidInputError, match=message):
        judged(tmp_path / "run", **limit_settings(limited.document.trial))


def test_numbers_read_back_to_the_same_numbers() -> None:
    for tilt, slip in ((30.0, 20.0), (1 / 3, 1e-3), (12.3456789012, 7.7), (180.0, math.inf)):
        recorded = {"tilt_limit": math.radians(tilt), "approach": 1.0}
        recorded |= {"slip_limit": slip / 1000.0} if math.isfinite(slip) else {}
        found = limit_settings(recorded)
        assert math.radians(found["tilt_limit_deg"]) == math.radians(tilt)
        assert found["slip_limit_mm"] / 1000.0 == slip / 1000.0 and found["approach"] is True


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tilt_limit_deg": 0.0}, "tilt_limit_deg is 0; give more than 0"),
        ({"tilt_limit_deg": 181.0}, "tilt_limit_deg is 181; give"),
        ({"tilt_limit_deg": math.nan}, "tilt_limit_deg is nan; give"),
        ({"slip_limit_mm": -1.0}, "slip_limit_mm is -1; give more than 0"),
        ({"slip_limit_mm": math.nan}, "slip_limit_mm is nan; give"),
    ],
)
def test_what_is_no_limit(settings: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        EvaluationSettings(**settings)


def test_a_wrong_protocol_is_refused_with_the_right_one() -> None:
    with pytest.raises(UnknownNameError, match=r"protocol 'shak' does not exist; .*shake"):
        EvaluationSettings(protocol="shak")


def test_shaken_objects_have_no_limits_unless_some_are_given() -> None:
    shaken = grasp_limits(EvaluationSettings(protocol="shake"))
    assert (shaken.approach_angle_deg, shaken.tilt_limit_deg) == (180.0, 180.0)
    assert shaken.slip_limit_mm == math.inf
    given = grasp_limits(EvaluationSettings(protocol="shake", tilt_limit_deg=30.0))
    assert (given.tilt_limit_deg, given.slip_limit_mm) == (30.0, math.inf)
    assert grasp_limits(dataclasses.replace(EvaluationSettings(), protocol="shake")) == shaken


def test_the_whole_arm_approaches_anyway(tmp_path: Path) -> None:
    asked = EvaluationSettings(mode="arm", approach=True)
    with pytest.raises(InvalidInputError, match="mode arm"):
        evaluate(SCENE, "panda_tabletop", tmp_path, settings=asked, grasps=GRASPS)
    assert not dataclasses.replace(asked, approach=False).approach


def test_the_usual_limits_are_those_of_trials() -> None:
    asked = grasp_limits(EvaluationSettings())
    assert math.radians(asked.tilt_limit_deg) == DEFAULT_TRIAL.tilt_limit
    assert asked.slip_limit_mm / 1000.0 == DEFAULT_TRIAL.slip_limit
