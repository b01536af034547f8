"""Selection of grasps for trials: numbers by stratum, and order, whatever the order of runs."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from burg_drake.core import InvalidInputError
from burg_drake.evaluation import Run, write_table
from burg_drake.experiment import (
    SelectionSettings,
    TrialBook,
    TrialSheet,
    allocate_to_strata,
    grasp_content,
    load_sources,
    load_trials,
    plan_trials,
    trial_rows,
)
from tests.experiment.known_runs import ended, failed, make_run, make_scene

MUG = [
    *(ended("lifted", clearance=k / 1000) for k in range(12)),
    *(ended("slipped", clearance=k / 2000) for k in range(3)),
    *(ended("lifted_disturbed") for _ in range(3)),
    *(ended("collision_table") for _ in range(5)),
    *(failed() for _ in range(2)),
]
BOX = [*(ended("lifted") for _ in range(10)), *(ended("no_contact") for _ in range(10))]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("selection")


@pytest.fixture(scope="module")
def hand(folder: Path) -> Run:
    return make_run(folder / "hand", make_scene(folder), {"mug": MUG, "box": BOX})


@pytest.fixture(scope="module")
def other(folder: Path) -> Run:
    scene = make_scene(folder, "another", 0.14)
    return make_run(folder / "other", scene, {"mug": MUG, "box": BOX}, seed=7)


def planned(
    runs: Any, *, out: Path | None = None, table: Path | None = None, **chosen: Any
) -> TrialSheet:
    """Trials of grasps that are selected by these settings."""
    return plan_trials(runs, settings=SelectionSettings(**chosen), robustness=table, out=out)


def counts(sheet: TrialSheet) -> Counter[tuple[str, str]]:
    return Counter((t.object, t.simulated.value) for t in sheet.trials)


def grasps(sheet: TrialSheet) -> set[tuple[str, str]]:
    return {(sheet.runs[trial.run].hash, trial.grasp) for trial in sheet.trials}


def test_success_and_failure_are_balanced_as_far_as_there_are_enough(hand: Run) -> None:
    sheet = planned(hand, per_object=6)
    assert counts(sheet) == {
        ("mug", "lifted"): 3,
        ("box", "lifted"): 3,
        ("box", "no_contact"): 3,
    } | {k: n for k, n in counts(sheet).items() if k[1] in ("slipped", "lifted_disturbed")}
    strata = {(s.object, s.label): s for s in sheet.strata.values()}
    assert (strata["mug", "success"].population, strata["mug", "failure"].population) == (12, 6)
    assert sheet.notes == ("2 grasps of run two could not be simulated and are left out",)
    more = planned(hand, per_object=16)
    chosen = {(s.object, s.label): (s.selected, s.wanted) for s in more.strata.values()}
    assert chosen["mug", "failure"] == (6, 8) and chosen["mug", "success"] == (10, 8)
    assert "mug of run two: 6 of 8 with failure; others make up for it" in more.notes
    assert grasps(sheet) < grasps(more)
    most = planned(hand, per_object=30)
    assert any("box (" in note and "20 of 30 in all" in note for note in most.notes)
    held = planned(hand, per_object=16, success="held")
    assert {s.population for s in held.strata.values() if s.object == "mug"} == {15, 3}


def test_shortfalls_of_a_kind_are_one_line_and_a_class_that_is_missing_is_said(
    tmp_path: Path,
) -> None:
    lifted = [ended("lifted")] * 4
    run = make_run(tmp_path / "run", make_scene(tmp_path), {"mug": lifted, "box": lifted})
    assert planned(run, per_object=4).notes == (
        "box, mug of run two: 0 of 2 with failure; others make up for it",
        (
            "only 0 of 8 are failures in simulation, so the trials hardly tell how well failures"
            " are predicted; evaluate with until_balanced=10 to get more"
        ),
    )
    verdicts = {"mug": [*lifted, ended("slipped")], "box": lifted}
    uneven = make_run(tmp_path / "uneven", make_scene(tmp_path), verdicts)
    assert planned(uneven, per_object=4).notes[0] == (
        "box (0 of 2), mug (1 of 2) of run two: too few with failure; others make up for it"
    )
    verdicts = {"mug": lifted, "box": [ended("slipped")]}
    mixed = make_run(tmp_path / "mixed", make_scene(tmp_path), verdicts)
    assert not any("hardly tell" in note for note in planned(mixed, per_object=4).notes)


def test_predicted_collisions_can_be_chosen(hand: Run) -> None:
    sheet = planned(hand, per_object=22, among="all")
    assert counts(sheet)["mug", "collision_table"] == 5
    (failures,) = (s for s in sheet.strata.values() if (s.object, s.label) == ("mug", "failure"))
    assert failures.population == 3 + 3 + 5  # slipped, disturbed, collided


def test_strata_by_outcome_and_without_any(hand: Run) -> None:
    sheet = planned(hand, per_object=6, balance="stage", among="clear")
    labels = {s.label: s.population for s in sheet.strata.values() if s.object == "mug"}
    assert labels == {
        "executed/lifted": 12,
        "executed/slipped": 3,
        "executed/lifted_disturbed": 3,
    }
    assert counts(sheet)["mug", "slipped"] == 2
    assert {s.label for s in planned(hand, balance="none").strata.values()} == {"all"}


def test_bins_of_a_margin_hold_as_many_grasps_each(hand: Run) -> None:
    sheet = planned(hand, per_object=6, balance="margin:clearance", bins=3)
    rows = {id: hand.row(id)["clearance"] for id in hand.candidates.id if id in hand.verdicts}
    mug = [s for s in sheet.strata.values() if s.object == "mug"]
    assert [s.population for s in mug] == [5, 5, 5] and {s.selected for s in mug} == {2}
    edges = np.quantile([k / 1000 for k in range(12)] + [0.0, 0.0005, 0.001], [1 / 3, 2 / 3])
    for trial in sheet.trials:
        place = int(np.searchsorted(edges, rows[trial.grasp], side="right")) + 1
        assert trial.stratum.endswith(f"({place} of 3)")
    assert "23 grasps have no clearance and are left out" in sheet.notes  # 3 mugs and all 20 boxes
    assert "box of run two: no grasp to choose from" in sheet.notes


def test_bins_of_probability_come_from_robustness(hand: Run, tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="burg-drake robustness"):
        planned(hand, balance="probability")
    ids = [id for id in hand.candidates.id if hand.verdicts[id].outcome.value == "lifted"]
    share = np.linspace(0.0, 1.0, len(ids))
    write_table(tmp_path / "r.csv", {"id": np.array(ids), "success": share})
    sheet = planned(hand, per_object=4, balance="probability", bins=2, table=tmp_path / "r.csv")
    known = dict(zip(ids, share, strict=True))
    for name in ("mug", "box"):
        tried = [known[t.grasp] for t in sheet.trials if t.object == name]
        middle = float(np.median([share for id, share in known.items() if id.startswith(name)]))
        assert sum(value < middle for value in tried) == len(tried) / 2 == 2


def test_order_of_runs_and_seed(hand: Run, other: Run) -> None:
    one = planned([hand, other], per_object=4, blocks=2)
    two = planned([other.path, hand.path], per_object=4, blocks=2)
    assert one.trials == two.trials and one.strata == two.strata
    assert set(one.runs) == {"two", "another"}
    assert planned([hand, other], per_object=4, blocks=2, seed=1).trials != one.trials
    alone = planned(hand, per_object=4)
    assert grasps(alone) < grasps(one)  # another run beside it changes nothing
    scenes = [trial.run for trial in one.trials]
    blocks = [trial.block for trial in one.trials]
    assert blocks == sorted(blocks) and [blocks.count(k) for k in (1, 2, 3, 4)] == [4] * 4
    for block in (1, 2, 3, 4):
        assert len({run for run, b in zip(scenes, blocks, strict=True) if b == block}) == 1
    assert scenes[0] != scenes[4] and scenes[8] != scenes[12]  # each scene once in a round
    drawn = planned([hand, other], per_object=4, scenes=1)
    assert len(drawn.runs) == 1 and grasps(drawn) < grasps(one)
    with pytest.raises(InvalidInputError, match="3 scenes were asked for, but only 2 have"):
        planned([hand, other], scenes=3)


def test_chance_is_fair(hand: Run) -> None:
    """Each of 20 boxes is chosen in a quarter of the draws, and boxes come first in half."""
    plans = [planned(hand, per_object=5, balance="none", seed=seed) for seed in range(80)]
    chosen = Counter(t.grasp for p in plans for t in p.trials if t.object == "box")
    assert len(chosen) == 20
    squares = sum((n - 20) ** 2 / 20 for n in chosen.values())
    assert squares < 43.8  # chi-squared with 19 degrees of freedom: 99.9 %
    first = sum(plan.trials[0].object == "box" for plan in plans)
    assert 25 <= first <= 55


def test_a_grasp_of_two_runs_is_tried_once(folder: Path, hand: Run) -> None:
    scene = make_scene(folder)
    reached = [ended("no_ik"), *MUG[1:]]
    arm = make_run(folder / "arm", scene, {"mug": reached, "box": BOX}, mode="reach")
    sheet = planned([hand, arm], per_object=30)
    assert set(sheet.runs) == {"two-reach"}
    assert len({trial.content for trial in sheet.trials}) == len(sheet.trials) == 17 + 20
    assert any("38 grasps of run two-hand are also in another run" in note for note in sheet.notes)
    clear = planned(arm, per_object=30, among="clear")
    assert counts(clear)["mug", "no_ik"] == 1
    assert counts(planned(arm, per_object=30, among="reachable"))["mug", "no_ik"] == 0
    with pytest.raises(InvalidInputError, match="mode hand, which does not check what the arm"):
        planned([hand], among="reachable")


@given(
    populations=st.dictionaries(st.sampled_from("abcdef"), st.integers(0, 9), min_size=1),
    wanted=st.integers(0, 40),
)
@settings(max_examples=60, deadline=None)
def test_no_stratum_could_give_more_evenly(populations: dict[str, int], wanted: int) -> None:
    chosen = allocate_to_strata(populations, wanted, sorted(populations))
    assert sum(chosen.values()) == min(wanted, sum(populations.values()))
    most = max(chosen.values())
    for label, count in chosen.items():
        assert count <= populations[label]
        assert count >= most - 1 or count == populations[label]


def test_a_sheet_is_not_written_over_once_it_has_entries(hand: Run, tmp_path: Path) -> None:
    path = tmp_path / "trials.yaml"
    planned(hand, per_object=2, out=path)
    planned(hand, per_object=3, out=path)
    assert load_trials(path).selection.per_object == 3
    text = path.read_text()
    TrialBook(path).record(1, outcome="lifted")
    with pytest.raises(InvalidInputError, match=r"has entries for 1 trial; choose another file"):
        planned(hand, out=path)
    path.write_text(text)  # by an editor with an old buffer
    with pytest.raises(InvalidInputError, match="has entries for 1 trial"):
        planned(hand, out=path)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"balance": "outcomes"}, "no balance 'outcomes'; did you mean 'outcome'"),
        ({"balance": "margin:clearanse"}, "no margin 'clearanse'; did you mean 'clearance'"),
        ({"among": "any"}, "no among 'any'"),
        ({"per_object": 0}, "per_object is 0"),
        ({"blocks": 0}, "blocks is 0"),
    ],
)
def test_what_cannot_be_asked_for(hand: Run, words: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        planned(hand, **words)


def test_runs_are_found_again_and_checked(hand: Run, other: Run, tmp_path: Path) -> None:
    path = hand.path.parent / "trials.yaml"
    sheet = planned([hand, other], per_object=3, out=path)
    assert sheet.runs["two"].path == "hand"
    runs = load_sources(load_trials(path), path)
    rows = trial_rows(sheet, runs)
    assert rows["id"].tolist() == [trial.grasp for trial in sheet.trials]
    assert rows["outcome"].tolist() == [trial.simulated.value for trial in sheet.trials]
    assert rows["run"].tolist() == [sheet.runs[trial.run].hash for trial in sheet.trials]
    away = tmp_path / "trials.yaml"
    away.write_text(path.read_text())
    with pytest.raises(InvalidInputError, match=r"run 'another' is not in .*; write its folder"):
        load_sources(load_trials(away), away)
    moved = {"two": hand.path, "another": other.path}
    assert set(load_sources(load_trials(away), away, moved=moved)) == {"two", "another"}
    with pytest.raises(InvalidInputError, match=r"run 'another' is \w+, of scene 'another', but"):
        load_sources(load_trials(away), away, moved=moved | {"another": hand.path})


@pytest.mark.parametrize("change", ["gone", "moved", "unjudged", "another outcome"])
def test_grasps_that_changed_are_refused(folder: Path, tmp_path: Path, change: str) -> None:
    scene = make_scene(folder)
    verdicts = {"mug": [ended("lifted"), ended("slipped")]}
    path = tmp_path / "trials.yaml"
    sheet = planned(make_run(tmp_path / "a", scene, verdicts), out=path)
    trial = next(t for t in sheet.trials if t.simulated == "slipped")
    text = path.read_text()
    if change == "gone":
        path.write_text(text.replace(trial.grasp, trial.grasp[:-1] + "x"))
    elif change == "moved":
        path.write_text(text.replace(trial.content, "0" * 12))
    else:
        ids = (tmp_path / "a" / "journal.jsonl").read_text().splitlines()
        last = [] if change == "unjudged" else [ids[-1].replace("slipped", "dropped")]
        (tmp_path / "a" / "journal.jsonl").write_text("\n".join([ids[0], *last]) + "\n")
    message = {
        "gone": f"trial {trial.number}: grasp '.*x' is not in .*did you mean '{trial.grasp}'",
        "moved": f"trial {trial.number}: grasp {trial.grasp} of .* when the trials were planned",
        "unjudged": "has no verdict in",
        "another outcome": "simulated is slipped, but .* has dropped",
    }[change]
    with pytest.raises(InvalidInputError, match=message):
        load_sources(load_trials(path), path)


def test_the_content_of_a_grasp_is_its_pose_width_and_instance() -> None:
    pose = np.eye(4)
    same = grasp_content("mug", pose, 0.03)
    assert same == grasp_content("mug", pose.copy(), 0.03) and len(same) == 12
    turned = pose.copy()
    turned[:3, :3] = np.diag([-1.0, -1.0, 1.0])
    away = pose.copy()
    away[0, 3] = 1e-12
    others = [
        *(grasp_content("mug", X, 0.03) for X in (turned, away)),
        grasp_content("mug", pose, 0.031),
        grasp_content("box", pose, 0.03),
        grasp_content("mug", pose, np.nan),
    ]
    assert len({same, *others}) == 6
