"""Steps of a gap measurement: reused and repeated verdicts, changes, page and figures."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from burg_drake.apps import main
from burg_drake.core import InvalidInputError, Mode, Outcome, RealOutcome, Stage, Verdict
from burg_drake.evaluation import Job, Run, build_judge, differences, judge_grasp, run_hash
from burg_drake.experiment import (
    GapSettings,
    GapStep,
    GapSteps,
    PlacementNoise,
    RealTrial,
    Selection,
    SourceRun,
    Stratum,
    TrialSheet,
    agreement_by_step,
    change_section,
    gap_changes,
    gap_json,
    grasp_contents,
    measure_gap,
    push_section,
    reality_sentence,
    reality_table,
    step_sentences,
    trials_of_run,
)
from burg_drake.scene import Scene
from burg_drake.station import ENGINES
from tests.experiment.gap.conftest import Here

NO_NOISE = PlacementNoise(place=0.0, turn=0.0)
OPTIONS: dict[str, Any] = {"executor": Here(), "progress": False}


def steps(last: Mode, samples: int) -> GapSettings:
    """Steps up to a mode, and displaced scenes without placement errors."""
    return GapSettings(last=last, samples=samples, noise=NO_NOISE)


@pytest.fixture(scope="module")
def by_hand(run: Run, tmp_path_factory: pytest.TempPathFactory) -> GapSteps:
    """Steps: the hand alone, and a displaced scene without placement errors."""
    out = tmp_path_factory.mktemp("gap") / "steps"
    return measure_gap(run, out, settings=steps("hand", 1), **OPTIONS)


@pytest.fixture(scope="module")
def ladder(run: Run, by_hand: GapSteps) -> GapSteps:
    """The steps of `by_hand` with the step `reach` between them."""
    found = measure_gap(run, by_hand.path, settings=steps("reach", 0), **OPTIONS)
    return replace(found, steps=(*found.steps, by_hand.steps[1]))


@pytest.mark.thorough
def test_without_noise_displaced_scenes_repeat_the_run_to_the_bit(by_hand: GapSteps) -> None:
    hand, (run,) = by_hand.first, by_hand.steps[1].runs
    assert hand is not run and run.document.scene.content == hand.document.scene.content
    assert run.candidates.id == hand.candidates.id[:2]
    for id in run.candidates.id:
        assert differences(hand.verdicts[id], run.verdicts[id]) == []


@pytest.mark.thorough
def test_reach_has_the_bits_of_a_run_of_its_own(ladder: GapSteps) -> None:
    """The reference is the judge of mode `reach`, which executes every trial."""
    hand, reach = (step.runs[0] for step in ladder.steps[:2])
    judge = build_judge(hand.scene(), hand.station(), engine=hand.document.engine, mode="reach")
    for candidate in hand.candidates:
        plain = judge_grasp(judge, candidate)
        assert differences(plain, reach.verdicts[candidate.id]) == []
        assert plain.q_grasp == reach.verdicts[candidate.id].q_grasp
    outcomes = [reach.verdicts[id].outcome for id in reach.candidates.id]
    assert outcomes == [Outcome.LIFTED, Outcome.ARM_COLLISION, Outcome.COLLISION_TARGET]
    assert hand.verdicts[hand.candidates.id[1]].outcome is Outcome.LIFTED
    (change, _) = gap_changes(ladder, "lifted")
    assert [move.grasp for move in change.lost] == [hand.candidates.id[1]]
    assert "table" in change.lost[0].blocker


def test_the_page_and_the_figures_tell_the_same(
    ladder: GapSteps, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["gap", str(ladder.steps[0].runs[0].path), "-o", str(ladder.path.parent / "again")]
    words += ["--mode", "hand", "--samples", "0", "--quiet"]
    assert main(words) == 0
    page = (ladder.path.parent / "again" / "gap.html").read_text()
    assert "Where grasps are lost: tabletop_six on panda_tabletop" in page
    found = gap_changes(ladder, "lifted")
    told = gap_json(ladder, found, (), "lifted")
    assert told["changes"][0]["lost"] == 1 and told["changes"][1]["lost"] == 0
    assert sum(item["count"] for item in told["changes"][0]["flow"]) == 3
    assert json.loads(json.dumps(told)) == told
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.split("report ")[-1].split("\n", 1)[1])["steps"]


def test_other_steps_are_refused(run: Run, ladder: GapSteps) -> None:
    with pytest.raises(
        InvalidInputError, match=r"steps of another measurement \(source is '.*' there"
    ):
        measure_gap("tabletop_six", ladder.path, settings=steps("reach", 5), **OPTIONS)
    with pytest.raises(InvalidInputError, match="place_mm is 0 there, 2 here"):
        measure_gap(run, ladder.path, settings=GapSettings(last="reach"), progress=False)


class Killed(Exception):
    """Stands for the end of a process."""


class KilledExecutor:
    """Returns one verdict, and is killed."""

    workers = 1

    def judge(self, jobs: Iterable[Job]) -> Iterator[Any]:
        for job in jobs:
            yield job, job.candidates[0], Verdict(Outcome.NO_IK, Stage.CLEAR)
            raise Killed


def test_nothing_of_another_gap_gets_into_a_journal(run: Run, tmp_path: Path) -> None:
    """A measurement is killed within its second step, and started again with another engine."""
    with pytest.raises(Killed):
        measure_gap(
            run,
            tmp_path,
            settings=steps("reach", 0),
            **OPTIONS | {"executor": KilledExecutor()},
        )
    journal = tmp_path / "reach" / "journal.jsonl"
    before = journal.read_bytes()
    assert before.count(b"\n") == 1
    document = replace(run.document, engine=ENGINES["standard"], hash="")
    other = Run(run.path, replace(document, hash=run_hash(document)))
    with pytest.raises(InvalidInputError, match="steps of another measurement"):
        measure_gap(
            other,
            tmp_path,
            settings=steps("reach", 0),
            **OPTIONS | {"executor": KilledExecutor()},
        )
    (tmp_path / "gap.yaml").unlink()  # which older versions wrote at the end
    with pytest.raises(InvalidInputError, match=r"holds another run \(engine is"):
        measure_gap(
            other,
            tmp_path,
            settings=steps("reach", 0),
            **OPTIONS | {"executor": KilledExecutor()},
        )
    assert journal.read_bytes() == before


def test_a_gap_that_came_to_nothing_does_not_take_the_folder(run: Run, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="overlap"):
        measure_gap(overlapping(run.scene()), tmp_path, settings=steps("hand", 0), **OPTIONS)
    again = measure_gap(run, tmp_path, settings=steps("hand", 0), **OPTIONS)
    assert again.document.source == run.document.hash


def overlapping(scene: Scene) -> Scene:
    """The scene with the mug at the pose of the box."""
    X_SO = scene.instance("box").X_SO
    instances = [
        replace(i, X_SO=X_SO) if i.object == "mug" else i for i in scene.document.instances
    ]
    return replace(scene, document=replace(scene.document, instances=tuple(instances)))


def test_options_of_a_scene_are_refused_with_a_run(
    ladder: GapSteps, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    words = ["gap", str(ladder.steps[0].runs[0].path), "-o", str(tmp_path / "out")]
    assert main([*words, "--engine", "standard"]) == 2
    assert "--engine is for scenes;" in capsys.readouterr().err
    assert main([*words, "--lift-mm", "100"]) == 2
    assert "--lift-mm is for scenes;" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def stated(run: Run, outcomes: dict[str, Outcome]) -> Run:
    """The run with other outcomes."""
    verdicts = {
        id: Verdict(outcome, outcome.stage, blocker="bowl" if outcome.stage != "executed" else "")
        for id, outcome in outcomes.items()
    }
    found = Run(run.path, run.document)
    found.__dict__["verdicts"] = verdicts
    return found


@pytest.fixture
def known(ladder: GapSteps) -> GapSteps:
    """Steps with given outcomes: each step after the first loses one of three grasps."""
    hand = ladder.steps[0].runs[0]
    one, two, three = hand.candidates.id
    good = Outcome.LIFTED
    tables = [
        {one: good, two: good, three: Outcome.SLIPPED},
        {one: good, two: Outcome.NO_IK, three: good},
        {one: good, three: Outcome.ONE_FINGER},
    ]
    places = [step.runs[0] for step in ladder.steps]
    places[2] = replace(places[2], path=hand.path)
    steps = [
        replace(step, runs=(stated(place, table),))
        for step, place, table in zip(ladder.steps, places, tables, strict=True)
    ]
    return replace(ladder, steps=tuple(steps))


def test_what_is_lost_and_won_is_counted(known: GapSteps) -> None:
    for run in (step.runs[0] for step in known.steps):
        run.__dict__["candidates"] = [c for c in known.first.candidates if c.id in run.verdicts]
    reach, placed = gap_changes(known, "lifted")
    assert (reach.successes, len(reach.lost), len(reach.won)) == (2, 1, 1)
    assert reach.lost[0].after is Outcome.NO_IK and reach.blockers == {"bowl": 1}
    assert (placed.successes, len(placed.lost), len(placed.won)) == (2, 1, 0)
    assert placed.flow[Outcome.LIFTED, Outcome.ONE_FINGER] == 1
    low, high = placed.share_lost  # Wilson's interval of 1 in 2, by hand
    assert (low, high) == pytest.approx((0.0945, 0.9055), abs=1e-4)


def test_what_could_not_be_simulated_is_neither_lost_nor_won(known: GapSteps) -> None:
    """The simulation of the second grasp, which the step lost, fails instead."""
    one, two, three = known.first.candidates.id
    reach = known.steps[1].runs[0]
    table = {id: verdict.outcome for id, verdict in reach.verdicts.items()}
    killed = stated(reach, table | {two: Outcome.SIMULATION_FAILED})
    steps = (known.steps[0], replace(known.steps[1], runs=(killed,)))
    (change,) = gap_changes(replace(known, steps=steps), "lifted")
    assert (change.successes, len(change.lost), len(change.won), change.failed) == (1, 0, 1, 1)
    assert [move.grasp for move in change.moves] == [one, three]
    told = "With the arm: 1 could not be simulated here or in the step before, and counts as"
    assert step_sentences(replace(known, steps=steps), (change,), "lifted")[-1].startswith(told)
    assert told in change_section(change)
    found = gap_json(replace(known, steps=known.steps[:1]), (change,), (), "lifted")
    assert found["changes"][0]["not_simulated"] == 1


def real_trials(run: Run, *outcomes: RealOutcome) -> list[RealTrial]:
    """A trial of each grasp, with these outcomes."""
    contents = grasp_contents(run, run.candidates.id)
    return [
        RealTrial(
            number=number,
            block=1,
            run="a",
            grasp=id,
            content=contents[id],
            instance="box",
            object="box",
            simulated=Outcome.LIFTED,
            stratum="all",
            outcome=outcome,
        )
        for number, (id, outcome) in enumerate(zip(run.candidates.id, outcomes, strict=True), 1)
    ]


def sheet_of(run: Run, trials: tuple[RealTrial, ...]) -> TrialSheet:
    """A trials file without strata."""
    document = run.document
    source = SourceRun(
        path=str(run.path),
        hash="another",
        scene=document.scene,
        station=document.station,
        mode="hand",
        engine="screening",
    )
    selection = Selection(per_object=1, balance="none")
    return TrialSheet(runs={"a": source}, selection=selection, trials=trials)


def test_another_grasp_of_the_same_id_is_not_the_one_that_was_tried(run: Run) -> None:
    trials = real_trials(run, *[RealOutcome.LIFTED] * 3)
    sheet = sheet_of(run, (trials[0], replace(trials[1], content="0123456789ab")))
    assert trials_of_run(sheet, "trials.yaml", run) == trials[:1]
    own = replace(sheet, runs={"a": replace(sheet.runs["a"], hash=run.document.hash)})
    with pytest.raises(InvalidInputError, match=r"trial 2: grasp .* it had 0123456789ab when"):
        trials_of_run(own, "trials.yaml", run)


def test_each_step_is_held_against_the_robot(known: GapSteps) -> None:
    real = (RealOutcome.LIFTED, RealOutcome.SLIPPED, RealOutcome.LIFTED)
    trials = real_trials(known.first, *real)
    later = replace(trials[0], number=4, outcome=None)
    sheet = sheet_of(known.first, (*trials, later))
    found = agreement_by_step(known, sheet, [*trials, later], "lifted")
    assert [(a.step, *a.selected.cells) for a in found] == [
        ("hand", 1, 1, 1, 0),
        ("reach", 2, 0, 0, 1),
        ("placed", 1, 0, 1, 0),
    ]
    assert found[1].selected.precision.value == 1.0
    assert found[2].selected.recall.value == 0.5
    assert all(a.all_grasps is None and a.estimated is a.selected for a in found)
    assert "each counted once" in reality_sentence(found)
    stopped = [replace(t, outcome=RealOutcome.NO_PATH) for t in trials]
    apart = agreement_by_step(known, sheet, stopped, "lifted")
    assert [(a.step, a.unpredictable) for a in apart] == [("hand", 3), ("reach", 0), ("placed", 2)]


def test_shares_beside_the_robot_hold_for_all_grasps_that_were_chosen_from(known: GapSteps) -> None:
    """The hand lifts 10 of 100 grasps. Its verdicts are right in one of two trials on these 10, and
    wrong in the only trial on the other 90; expected figures are calculated by hand."""
    trials = real_trials(
        known.first, *[RealOutcome.LIFTED, RealOutcome.SLIPPED, RealOutcome.LIFTED]
    )
    sizes = {"success": 10, "failure": 90}
    strata = {
        label: Stratum(run="a", object="box", label=label, population=n, selected=2, wanted=2)
        for label, n in sizes.items()
    }
    labels = ("success", "success", "failure")
    told = [replace(trial, stratum=label) for trial, label in zip(trials, labels, strict=True)]
    sheet = replace(sheet_of(known.first, tuple(told)), strata=strata)
    hand = agreement_by_step(known, sheet, told, "lifted")[0]
    assert hand.selected.accuracy.value == pytest.approx(1 / 3)
    assert hand.all_grasps is not None
    assert hand.all_grasps.cells == pytest.approx((5, 5, 90, 0))
    assert hand.estimated.accuracy.value == pytest.approx(0.05)
    assert hand.estimated.recall.value == pytest.approx(5 / 95)
    page = reality_table([hand]).section()
    assert "estimated for the 100 grasps" in page and " 5.0 %" in page


def test_the_page_shows_all_sections(ladder: GapSteps) -> None:
    from burg_drake.experiment import gap_page

    page = gap_page(ladder, "lifted", (), "burg-drake gap tabletop_six -o gap")
    for head in ("From step to step", "By object", "With the arm", "How to repeat"):
        assert f"<h2>{head}</h2>" in page, head
    counts = re.findall(r"<text[^>]*>(\d+) (lifted|arm cannot reach|hand collides)</text>", page)
    assert ("1", "arm cannot reach") in counts
    assert "burg-drake replay" in page


def test_what_the_approach_pushes_is_told_by_object(known: GapSteps) -> None:
    """Result rows of five trials of the arm; one simulation failed."""
    arm = Run(known.first.path, known.first.document)
    arm.__dict__["results"] = {
        "instance": np.array(["box", "box", "mug", "mug", "mug"]),
        "object": np.array(["box", "box", "mug", "mug", "mug"]),
        "outcome": np.array(["lifted", "slipped", "lifted", "lifted", "simulation_failed"]),
        "pushed": np.array([0.0, 0.004, 0.03, 0.0, np.nan]),
        "pushed_box": np.array([0.0, 0.004, 0.0, 0.0, np.nan]),
        "pushed_mug": np.array([0.0, 0.0, 0.03, 0.0, np.nan]),
    }
    page = push_section(replace(known, steps=(*known.steps, GapStep("arm", (arm,)))))
    assert page is not None and "in 2 of 4 trials (largest 30.0 mm)" in page
    rows = [re.findall(r"<t[hd][^>]*>([^<]*)</t[hd]>", row) for row in page.split("<tr>")[2:]]
    assert rows == [
        ["box", "2", "1", "2.0", "4.0", "0 of 1", "1 of 1"],
        ["mug", "2", "1", "15.0", "30.0", "1 of 1", "1 of 1"],
    ]
    assert push_section(known) is None
