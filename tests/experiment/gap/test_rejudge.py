"""Real trials judged again with objects at their measured poses."""

from __future__ import annotations

import json
import math
import re
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from burg_drake.apps import main
from burg_drake.core import Array, InvalidInputError, Outcome, Pose, RealOutcome, SimulationError
from burg_drake.evaluation import (
    Candidates,
    Job,
    JobFailed,
    Journal,
    OnFailure,
    Run,
    StationJudgeFactory,
    decode_verdict,
    differences,
    load_run,
    read_table,
)
from burg_drake.experiment import (
    ObjectPlace,
    RealTrial,
    Rejudging,
    Selection,
    SourceRun,
    Stratum,
    TrialSheet,
    correct_height_and_tilt,
    grasp_content,
    match_runs_to_sources,
    measured_scene,
    rejudge,
    rejudged_section,
    rejudged_sentences,
    save_trials,
)
from burg_drake.scene import Scene
from burg_drake.station import ENGINES, Engine, SceneCheck
from tests.experiment.gap.conftest import Here

MISSED = {"no_contact", "collision_target", "collision_table", "closed_empty", "one_finger"}


def place(X_SO: Array, *, exact: Pose | None = None) -> ObjectPlace:
    return ObjectPlace(status="measured", X_SO=exact or Pose.from_matrix(X_SO, quaternion=True))


def shifted(scene: Scene, name: str, x: float, y: float = 0.0, z: float = 0.0) -> Array:
    X = scene.X_SO(name).copy()
    X[:3, 3] += (x, y, z)
    return X


@pytest.fixture(scope="module")
def check(run: Run) -> SceneCheck:
    return SceneCheck(run.station(), run.scene().library)


def sheet_of(run: Run, *placements: dict[str, ObjectPlace], real: str = "slipped") -> TrialSheet:
    document, grasp = run.document, run.candidates.id[0]
    source = SourceRun(
        path=str(run.path),
        hash=document.hash,
        scene=document.scene,
        station=document.station,
        mode=document.mode,
        engine=document.engine.name,
    )
    trials = [
        RealTrial(
            number=number,
            block=1,
            run="a",
            grasp=grasp,
            content=grasp_content("box", run.candidate(grasp).X_OG, run.candidate(grasp).width),
            instance="box",
            object="box",
            simulated=run.verdicts[grasp].outcome,
            stratum="all",
            outcome=RealOutcome(real),
            placement=placement,
        )
        for number, placement in enumerate(placements, 1)
    ]
    strata = {
        "all": Stratum(run="a", object="box", label="all", population=2, selected=1, wanted=1)
    }
    selection = Selection(per_object=1, balance="none")
    return TrialSheet(runs={"a": source}, selection=selection, strata=strata, trials=tuple(trials))


@pytest.fixture(scope="module")
def sheet(run: Run) -> TrialSheet:
    scene = run.scene()
    as_planned = {n: place(scene.X_SO(n), exact=scene.instance(n).X_SO) for n in scene.instances}
    away = as_planned | {"box": place(shifted(scene, "box", -0.08, -0.06))}
    within = as_planned | {"mug": place(scene.X_SO("box"))}
    other_away = {"bowl": place(shifted(scene, "bowl", 0.0, 0.004)), "mug": unseen()}
    sheet = sheet_of(run, as_planned, away, within, other_away, {})
    late = replace(sheet.trials[0], number=6, outcome=None)
    nobody = replace(sheet.trials[0], number=7, outcome=RealOutcome.NOT_ATTEMPTED)
    return replace(sheet, trials=(*sheet.trials, late, nobody))


def unseen() -> ObjectPlace:
    return ObjectPlace(status="not_seen")


@pytest.fixture(scope="module")
def found(run: Run, sheet: TrialSheet) -> Rejudging:
    out = run.path.parent / "again"
    return rejudge(sheet, "trials.yaml", out, executor=Here(), progress=False)


def test_each_trial_is_judged_where_its_objects_stood(run: Run, found: Rejudging) -> None:
    as_planned, away, within, other_away = found.trials
    planned = run.verdicts[run.candidates.id[0]]
    assert as_planned.verdict is not None and away.verdict is not None
    assert differences(planned, as_planned.verdict) == []
    assert as_planned.notes == () and as_planned.outcome is Outcome.LIFTED
    assert away.verdict.outcome.value in MISSED
    assert within.outcome is None and "overlap" in within.failure_reason
    assert other_away.outcome is Outcome.LIFTED
    assert "mug as planned (not seen)" in other_away.notes
    assert "box as planned (not measured)" in other_away.notes
    assert found.skipped == {
        5: "placement not measured",
        6: "not carried out yet",
        7: "not attempted",
    }


def test_the_hand_goes_where_it_was_sent(run: Run, found: Rejudging) -> None:
    """World poses are calculated by scipy, independently of the code."""
    away, scene = found.trials[1], run.scene()
    assert away.candidate is not None and away.scene is not None
    there = scene.X_SO("box") @ run.candidate(away.grasp).X_OG
    here = away.scene.instance("box").X_SO
    w, x, y, z = here.quaternion_wxyz or (1, 0, 0, 0)
    rotation = Rotation.from_quat((x, y, z, w))
    p = rotation.apply(away.candidate.X_OG[:3, 3]) + here.translation
    np.testing.assert_allclose(p, there[:3, 3], atol=1e-12)
    R = rotation.as_matrix() @ away.candidate.X_OG[:3, :3]
    np.testing.assert_allclose(R, there[:3, :3], atol=1e-12)


def test_reality_slipped_and_only_the_displaced_scene_says_so(found: Rejudging) -> None:
    """Trials 1 and 4 are lifted either way: physics; 2 is explained; 3 is not judged."""
    assert found.causes == {
        "agreed": 0,
        "placement": 1,
        "worsened": 0,
        "physics": 2,
        "unpredictable": 0,
    }
    assert found.table == {(True, True, False): 2, (True, False, False): 1}
    assert found.explained_disagreements[:2] == (1, 3)
    assert found.mcnemar_test.p_value == 1.0
    assert [t.cause("lifted") for t in found.trials] == ["physics", "placement", None, "physics"]


def test_what_the_hand_alone_cannot_predict_is_left_to_nothing(
    run: Run, sheet: TrialSheet, found: Rejudging, tmp_path: Path
) -> None:
    """The arm failed where the verdict agrees as measured, and where it disagrees either way."""
    shutil.copytree(found.path, tmp_path / "again")
    real = {1: RealOutcome.NO_PATH, 2: RealOutcome.PROTECTIVE_STOP}
    trials = [replace(t, outcome=real.get(t.number, t.outcome)) for t in sheet.trials]
    other = replace(sheet, trials=tuple(trials))
    told = rejudge(other, "trials.yaml", tmp_path / "again", executor=Nobody(), progress=False)  # type: ignore[arg-type]
    assert run.document.mode == "hand"
    assert told.causes == {
        "agreed": 0,
        "placement": 0,
        "worsened": 0,
        "physics": 1,
        "unpredictable": 2,
    }
    assert told.agreement(measured=True)[0] == 0
    assert told.agreement(measured=True, every=True)[0] == 1
    # all three were predicted to lift, one of which was predictable, and none did
    assert told.precision(measured=False, every=True) == (0, 3)
    assert told.precision(measured=False) == (0, 1) and told.precision(measured=True) == (0, 1)
    words = " ".join(rejudged_sentences(told))
    assert "2 trials failed for reasons that a run of the hand alone cannot predict (" in words
    assert "(1 no path, 1" in words
    assert re.search(r"as planned 0 of 3 \(0\S* %\) with them, 0 of 1 \(0\S* %\) without", words)
    assert "Of the 1 that disagrees as planned" in words and "1 is left to physics" in words
    page = rejudged_section(told)
    assert "Not predictable" in page and "as measured, with what cannot be predicted" in page
    data = json.loads((told.path / "rejudged.json").read_text())
    assert data["unpredictable"] == 2 and data["agree"]["planned"]["of"] == 1
    assert data["precision"]["planned"]["all"] == {"count": 0, "of": 3}


def test_an_answer_that_is_lost_is_asked_for_again(
    run: Run, sheet: TrialSheet, found: Rejudging, tmp_path: Path
) -> None:
    """The last line of the journal is torn, so only its trial is judged again."""
    whole = (found.path / "journal.jsonl").read_bytes()
    *kept, last = whole.splitlines(keepends=True)
    (tmp_path / "journal.jsonl").write_bytes(b"".join(kept) + last[:20])
    lost, verdict = decode_verdict(last)
    asked: list[str] = []

    class Knowing:
        workers = 1

        def judge(self, jobs: Iterable[Job], on_failure: OnFailure) -> Iterator[Any]:
            for job in jobs:
                for candidate in job.candidates:
                    asked.append(candidate.id)
                    yield job, candidate, verdict

    again = rejudge(sheet, "trials.yaml", tmp_path, executor=Knowing(), progress=False)  # type: ignore[arg-type]
    assert asked == [lost] and again.causes == found.causes
    assert (tmp_path / "journal.jsonl").read_bytes() == whole


def test_who_judged_a_grasp_again_judges_where_its_object_stood(
    run: Run, sheet: TrialSheet, tmp_path: Path
) -> None:
    shutil.copytree(run.path, tmp_path / "run")
    id = run.candidates.id[0]
    with Journal(tmp_path / "run" / "journal.jsonl") as journal:
        journal.append(id, replace(run.verdicts[id], judged_again="reference"))
    engines: list[Engine] = []

    class Asked:
        workers = 1

        def judge(self, jobs: Iterable[Job], on_failure: OnFailure) -> Iterator[Any]:
            for job in jobs:
                assert isinstance(job.make_judge, StationJudgeFactory)
                engines.append(job.make_judge.engine)
                yield from ((job, candidate, run.verdicts[id]) for candidate in job.candidates)

    runs = {"a": load_run(tmp_path / "run")}
    found = rejudge(sheet, "trials.yaml", tmp_path / "out", runs=runs, executor=Asked())  # type: ignore[arg-type]
    assert engines and set(engines) == {ENGINES["reference"]}
    assert found.trials[0].origin.engine == ENGINES["reference"]
    assert set(read_table(tmp_path / "out" / "rejudged.csv")["engine"]) == {"reference"}
    engines.clear()
    rejudge(sheet, "trials.yaml", tmp_path / "out", runs={"a": run}, executor=Asked())  # type: ignore[arg-type]
    assert set(engines) == {run.document.engine}  # what another engine answered is no answer


def test_a_scene_that_cannot_be_built_is_a_trial_that_is_not_judged(
    sheet: TrialSheet, tmp_path: Path
) -> None:
    class Failing:
        workers = 1

        def judge(self, jobs: Iterable[Job], on_failure: OnFailure) -> Iterator[Any]:
            for job in jobs:
                on_failure(JobFailed(job, SimulationError("no such world")))
            yield from ()

    found = rejudge(sheet, "trials.yaml", tmp_path, executor=Failing(), progress=False)  # type: ignore[arg-type]
    assert found.judged == () and found.mcnemar_test.p_value is None
    assert found.trials[0].failure_reason == "SimulationError: no such world"
    assert "None of the trials could be judged again." in rejudged_sentences(found)[0]
    assert "no such world" in rejudged_section(found)


def test_compare_tells_it_all(
    sheet: TrialSheet, found: Rejudging, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """All verdicts are known, so nothing is simulated."""
    folder = found.path.parent
    save_trials(sheet, folder / "trials.yaml")
    words = ["compare", str(folder / "run"), str(folder / "trials.yaml")]
    words += ["--rejudge", str(found.path), "--quiet"]
    page = tmp_path / "page.html"
    assert main([*words, "--html", str(page)]) == 0
    told = capsys.readouterr().out
    assert "Of the 3 that disagree as planned, placement explains 1 (33.3 %" in " ".join(
        told.split()
    )
    assert "<h2>Judged again where objects stood</h2>" in page.read_text()
    assert f"<span>--rejudge</span> <span>{found.path}</span>" in page.read_text()
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rejudged"]["causes"]["physics"] == 2
    assert main(["compare", str(folder / "run"), str(folder / "run"), "--rejudge"]) == 2
    assert "--rejudge judges real trials again; give a trials file" in capsys.readouterr().err


def test_the_folder_goes_on_and_tells_all(run: Run, sheet: TrialSheet, found: Rejudging) -> None:
    journal = found.path / "journal.jsonl"
    before = journal.read_bytes()
    again = rejudge(sheet, "trials.yaml", found.path, executor=Nobody(), progress=False)  # type: ignore[arg-type]
    assert journal.read_bytes() == before and again.causes == found.causes
    told = json.loads((found.path / "rejudged.json").read_text())
    assert told["causes"]["placement"] == 1 and told["judged"] == 3
    assert told["agree"]["measured"]["count"] == 1 and told["trials"][2]["measured"] is None
    rows = read_table(found.path / "rejudged.csv")
    assert rows["trial"].tolist() == [1, 2, 4]
    assert rows["cause"].tolist() == ["physics", "placement", "physics"]


@pytest.mark.thorough
def test_a_row_replays_in_the_scene_as_measured(
    found: Rejudging, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    table = str(found.path / "rejudged.csv")
    assert main(["replay", table, "--row", "2", "--html", str(tmp_path / "replay.html")]) == 0
    assert "as recorded" in capsys.readouterr().out


class Nobody:
    """An executor that fails the test if it is used."""

    workers = 1

    def judge(self, jobs: object) -> None:
        raise AssertionError("all is known")


def test_a_run_that_is_gone_or_another_one_is_refused(run: Run, sheet: TrialSheet) -> None:
    other = replace(sheet, runs={"a": replace(sheet.runs["a"], hash="0123")})
    with pytest.raises(InvalidInputError, match="run 'a' is 0123, of scene 'tabletop_six'"):
        rejudge(other, "trials.yaml", run.path.parent / "never", progress=False)
    assert not (run.path.parent / "never").exists()


def test_another_grasp_of_the_same_id_is_not_judged_again(
    run: Run, sheet: TrialSheet, tmp_path: Path
) -> None:
    """Of two runs that may replace the source, the run that has the grasps does."""
    trial = replace(sheet.trials[0], content="0123456789ab")
    other = replace(sheet, runs={"a": replace(sheet.runs["a"], hash="0123")}, trials=(trial,))
    found = rejudge(other, "t.yaml", tmp_path, runs={"a": run}, executor=Nobody(), progress=False)  # type: ignore[arg-type]
    assert found.skipped == {1: "another grasp of this id in the run"}
    less = Run(run.path, run.document)
    of = run.candidates
    less.__dict__["candidates"] = Candidates(of.grasps.select(np.array([2])), of.instance[2:])
    meant = replace(other, trials=sheet.trials)
    assert (
        match_runs_to_sources(meant, [less, run])["a"] is run
        and match_runs_to_sources(meant, [run, less])["a"] is run
    )


def test_small_errors_of_measuring_are_put_right(run: Run, check: SceneCheck) -> None:
    scene = run.scene()
    X = shifted(scene, "box", 0.003, 0.001, 0.002)
    X[:3, :3] = Rotation.from_euler("xz", [1.0, 4.0], degrees=True).as_matrix() @ X[:3, :3]
    found, said = correct_height_and_tilt(scene.X_SO("box"), X)
    assert found[2, 3] == scene.X_SO("box")[2, 3] and said.startswith("2.0 mm lower and upright")
    turn = Rotation.from_matrix(found[:3, :3] @ scene.X_SO("box")[:3, :3].T)
    np.testing.assert_allclose(turn.as_rotvec(degrees=True), (0.0, 0.0, 4.0), atol=1e-2)
    fallen = X.copy()
    fallen[:3, :3] = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    assert correct_height_and_tilt(scene.X_SO("box"), fallen)[0] is fallen


def test_what_overlaps_a_little_is_moved_apart(run: Run, check: SceneCheck) -> None:
    """The bottle comes near the mug until they overlap by some millimetres."""
    scene = run.scene()
    near = check.travel(scene, ["bottle"], (-1.0, 0.0, 0.0), 1.0)
    close = {"bottle": place(shifted(scene, "bottle", -near - 0.003))}
    found = measured_scene(scene, close, check.issues)
    assert found.scene is not None
    assert any(note.startswith("bottle moved by") for note in found.notes)
    assert not [issue for issue in check.issues(found.scene) if issue.is_error]
    moved = found.scene.X_SO("bottle")[:2, 3] - scene.X_SO("bottle")[:2, 3]
    assert math.hypot(*moved) == pytest.approx(near + 0.002, abs=0.001)
    deep = {"bottle": place(shifted(scene, "bottle", -near - 0.03))}
    assert "overlap by" in measured_scene(scene, deep, check.issues).reason
    nowhere = {"bottle": place(shifted(scene, "bottle", 120.0))}
    assert "off the board" in measured_scene(scene, nowhere, check.issues).reason
    assert "no 'cup'" in measured_scene(scene, {"cup": unseen()}, check.issues).reason
