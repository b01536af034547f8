"""Runs that go on sampling until each object has lifted and failing grasps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asked import asked
from inline_executor import Inline
from known_judge import expected, install

from burg_drake.core import InvalidInputError, Outcome
from burg_drake.evaluation import (
    Run,
    SamplingSettings,
    evaluate,
    reproduce_command,
    run_notes,
    sample_candidates,
    sample_on_scene,
    sample_requested,
    save_run,
)
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Station, load_station
from tests.thorough import thorough

OPTIONS = {"grasps_per_object": 4, "until_balanced": 3, "blind": True, "progress": False}


def judged(scene: Scene, station: Station, out: Path, **options: object) -> Run:
    executor = {} if "workers" in options else {"executor": Inline()}
    return evaluate(scene, station, out, **asked(**(OPTIONS | executor | options)))


def counts(run: Run, object: str, outcomes: set[Outcome]) -> int:
    """Grasps of an object that end so by the known judge's own rule."""
    names = {"left": "cube", "right": "cube", "bar": "bar"}
    pairs = zip(run.candidates.id, run.candidates.instance.tolist(), strict=True)
    return sum(names[name] == object and expected(id) in outcomes for id, name in pairs)


FAILED = {Outcome.SLIPPED, Outcome.LIFTED_DISTURBED}


def test_each_object_gets_enough_of_both(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    run = judged(scene, station, tmp_path / "run")
    for name in ("cube", "bar"):
        assert counts(run, name, {Outcome.LIFTED}) >= 3 and counts(run, name, FAILED) >= 3
    assert run.complete and not [note for note in run_notes(run) if "max_grasps" in note]
    settings = SamplingSettings(approach_angle_deg=75.0, blind=True)
    first = sample_candidates(scene, station, 4, 0, settings)
    assert set(first.id) <= set(run.candidates.id)
    command = reproduce_command(run)
    assert "--until-balanced 3 --balanced-among executed --max-grasps-per-object 1000" in command
    again = judged(scene, station, tmp_path / "run")
    assert len(again.document.stretches) == len(run.document.stretches)
    other = judged(scene, station, tmp_path / "clear", balanced_among="all")
    assert other.document.grasps.count < run.document.grasps.count  # collisions count, too
    assert other.document.hash != run.document.hash


@pytest.mark.parametrize("blind", [True, False])
def test_only_what_lacks_something_is_sampled_again(
    scene: Scene,
    station: Station,
    tmp_path: Path,
    known_judge: None,
    monkeypatch: pytest.MonkeyPatch,
    blind: bool,
) -> None:
    """And all grasps are those that sampling everything at once gives, for points of contact alone
    and for a hand that is clear of the scene."""
    if not blind:
        scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    asked_of: list[set[str]] = []

    def noted(*arguments: Any) -> Any:
        asked_of.append(set(arguments[-1]))
        return sample_on_scene(*arguments)

    monkeypatch.setattr("burg_drake.evaluation.run_preparation.sample_on_scene", noted)
    only = {"left", "right", "bar"} if blind else {"bottle", "box"}
    options = {"blind": blind, "only": sorted(only), "until_balanced": 3 if blind else 1}
    run = judged(scene, station, tmp_path / "run", mode="hand", **options)
    times = {name: sum(name in names for names in asked_of) for name in only}
    assert times["left"] == 1 < times["bar"] if blind else times["bottle"] < times["box"]
    whole = sample_requested(scene, station, run.document)
    assert whole.content == run.candidates.content
    assert np.array_equal(whole.grasps.X_OG, run.candidates.grasps.X_OG)


@pytest.mark.parametrize("out", ["one", thorough("two")])
def test_it_is_the_same_on_any_number_of_workers_and_after_kills(
    scene: Scene, station: Station, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, out: str
) -> None:
    install(monkeypatch.setattr)
    whole = judged(scene, station, tmp_path / "whole")
    if out == "two":
        other = judged(scene, station, tmp_path / out, workers=2)
    else:
        other = _killed_and_continued(scene, station, tmp_path / out, monkeypatch)
    assert other.document.hash == whole.document.hash
    assert other.candidates.id == whole.candidates.id
    assert np.array_equal(other.results["outcome"], whole.results["outcome"])
    assert other.document.grasps.asked == whole.document.grasps.asked


def _killed_and_continued(
    scene: Scene, station: Station, out: Path, monkeypatch: pytest.MonkeyPatch
) -> Run:
    """Ends three times between the two files of a round, and twice within its trials."""

    def killed(run: Run) -> Run:
        if run.document.grasps.asked:
            raise KeyboardInterrupt
        return save_run(run)

    with monkeypatch.context() as patch:
        patch.setattr("burg_drake.evaluation.run_preparation.save_run", killed)
        for _ in range(3):
            with pytest.raises(KeyboardInterrupt):
                judged(scene, station, out)
    for stop in (5, 2):
        with pytest.raises(KeyboardInterrupt):
            judged(scene, station, out, executor=Inline(stop=stop))
    return judged(scene, station, out, executor=Inline(seed=1))


def test_the_bound_ends_it_and_what_is_missing_is_said(
    scene: Scene, station: Station, tmp_path: Path, known_judge: None
) -> None:
    run = judged(scene, station, tmp_path / "run", until_balanced=30, max_grasps_per_object=20)
    assert max(map(sum, run.document.grasps.asked.values())) <= 20
    lifted, failed = counts(run, "bar", {Outcome.LIFTED}), counts(run, "bar", FAILED)
    (note,) = [note for note in run_notes(run) if note.startswith("bar: ")]
    missing = f"{lifted} of the 30 lifted and {failed} of the 30 failing grasps were found"
    assert note.startswith(f"bar: only {missing} (only executed grasps count) among ")
    assert note.endswith(" grasps (max_grasps_per_object is 20)")
    (run.path / "journal.jsonl").write_bytes(b"")
    partial = replace(run, document=run.document)
    assert not [note for note in run_notes(partial) if "max_grasps" in note]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"until_balanced": 0}, "until_balanced is 0; give 1 or more"),
        ({"shard": "1/2"}, "leave out one of the two"),
        ({"max_grasps_per_object": 3}, "give a larger maximum"),
        ({"balanced_among": "cleared"}, "there is no balanced_among 'cleared'"),
        (
            {"balanced_among": "reachable", "mode": "hand"},
            "mode hand does not check what the arm can",
        ),
        ({"until_balanced": None, "balanced_among": "all"}, "balanced_among has no effect without"),
        (
            {"until_balanced": None, "max_grasps_per_object": 50},
            "max_grasps_per_object has no effect without until_balanced",
        ),
    ],
)
def test_what_cannot_be_balanced(
    scene: Scene, station: Station, tmp_path: Path, options: dict[str, object], message: str
) -> None:
    with pytest.raises(InvalidInputError, match=message):
        judged(scene, station, tmp_path / "run", **options)
    assert not (tmp_path / "run").exists()


def test_several_scenes_and_given_grasps_are_refused(
    scene: Scene, station: Station, tmp_path: Path, known_run: Run
) -> None:
    with pytest.raises(InvalidInputError, match="one scene at a time"):
        judged([scene, scene], station, tmp_path / "run")  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="grasps are given"):
        judged(scene, station, tmp_path / "run", grasps=known_run.candidates.grasps)


def test_slippery_grasps_need_more_friction_than_there_is(scene: Scene, station: Station) -> None:
    """On a cube the angle between closing line and faces is that to the nearest axis."""
    settings = SamplingSettings(blind=True, slippery=True, approach_angle_deg=180.0)
    grasps = sample_candidates(scene, station, 200, 0, settings, ["left"]).grasps
    assert len(grasps) > 50
    cosine = np.abs(grasps.X_OG[:, :3, 0]).max(axis=1)
    needed = np.tan(np.arccos(cosine))
    friction = scene.library.entry("cube").friction
    assert needed.min() > friction and needed.max() < 4.0 * friction + 1e-9
    assert np.allclose(grasps.score, 1.0 - needed / friction, atol=1e-6)
