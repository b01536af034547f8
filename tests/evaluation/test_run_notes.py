"""What a run lacks is said with its reason, in numbers that were counted."""

from __future__ import annotations

import io
import re
from collections import Counter
from pathlib import Path

import pytest
from asked import asked
from inline_executor import Inline
from known_many import run_all, write_scenes
from rich.console import Console

from burg_drake.core import Outcome
from burg_drake.evaluation import (
    Run,
    SamplingSettings,
    evaluate,
    load_campaign,
    load_run,
    run_notes,
    sample_grasps,
    scored_set,
    shortfall_note,
    summarize,
    summary_view,
)
from burg_drake.grasping import antipodal_sampling
from burg_drake.objects import load_library
from burg_drake.scene import load_scene
from burg_drake.station import Station, load_station


def test_an_object_without_clear_grasps_is_explained_wherever_the_run_is_shown(
    judged_here: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The scissors lie flat: fingers that reach them reach into the table. The screen, asked about
    the blind grasps that were tried, is the oracle of the counts."""
    monkeypatch.setattr(antipodal_sampling.SamplingEffort, "min_tests", 400)
    scene, station = load_scene("tabletop_twelve"), load_station("panda_tabletop")
    out = tmp_path / "run"
    options = {"mode": "hand", "only": ["scissors"], "workers": 1, "progress": False}
    (note,) = summarize(
        evaluate(scene, station, out, **asked(grasps_per_object=5, **options))
    ).notes
    tried, *counts = (int(n) for n in re.findall(r"(\d+)(?: antipodal|,| and|;)", note)[:3])
    assert note.startswith(
        f"scissors: only 0 of 5 grasps were found: of {tried} antipodal grasps tried, the open"
    )
    assert sum(counts) == tried >= 400
    blind = sample_grasps(
        scene, station, tried, settings=SamplingSettings(blind=True), only=["scissors"]
    )
    hits = scored_set(blind, scene.library, station, scene).column("collides_with").tolist()
    found = Counter("table" if hit == "table" else "itself" for hit in hits)
    assert len(blind) == tried  # the same ones, as `distinct` left none out
    assert f"itself in {found['itself']}" in note and f"the table in {found['table']}" in note
    assert note in re.sub(r"<[^>]*>", "", load_run(out).report_path.read_text())
    console = Console(file=io.StringIO(), width=80)
    console.print(summary_view(summarize(load_run(out))))
    assert note in " ".join(console.file.getvalue().split())


@pytest.mark.thorough
def test_nothing_executed_is_explained(judged_here: None, tmp_path: Path) -> None:
    options = {"mode": "hand", "only": ["screwdriver"], "workers": 1, "progress": False}
    for seed in range(10):  # of one seed or another, a grasp may be clear by chance
        asked_for = asked(grasps_per_object=20, blind=True, seed=seed, **options)
        run = evaluate("tabletop_six", "panda_tabletop", tmp_path / str(seed), **asked_for)
        counts = Counter(run.results["outcome"].tolist())
        if not set(counts) - {"collision_table", "collision_target"}:
            break
    assert counts.total() == 20 and not set(counts) - {"collision_table", "collision_target"}
    (note,) = summarize(run).notes
    assert note.startswith("screwdriver: none of 20 grasps was executed: ")
    assert f"hits the table in {counts[Outcome.COLLISION_TABLE]}" in note
    assert note.endswith("; sample grasps at which the hand is clear, as is the default")


def test_a_margin_that_leaves_nothing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    """No finger can close on a box and stay 0.2 m away from it."""
    monkeypatch.setattr(antipodal_sampling.SamplingEffort, "min_tests", 100)
    household, station = load_library("household"), load_station("panda_tabletop")
    settings = SamplingSettings(margin=0.2)
    grasps = sample_grasps(household, station, 2, settings=settings, only=["box"])
    note = shortfall_note("box", 2, grasps.provenance["parts"]["box"], len(grasps))
    assert re.fullmatch(
        r"box: only 0 of 2 grasps were found: of (\d+) antipodal grasps tried, the"
        r" open hand comes within 200 mm of the object itself in \1; a smaller margin would help",
        note,
    )


def make_heavy(library: Path) -> None:
    """Gives the cube, which comes first, 3.2 kg, and the bar 0.1 kg as before."""
    file = library / "library.yaml"
    file.write_text(file.read_text().replace("mass: 0.1", "mass: 3.2", 1))
    assert load_library(library).entry("bar").mass == 0.1


HEAVY_NOTE = re.compile(
    r"confidence may be wrong for cube \(3\.2 kg is heavier\); it was measured on objects of up to"
    r" \S+ kg .* mm long"
)


def test_confidence_in_verdicts_on_other_objects_is_said(own_run: Run) -> None:
    assert not any("confidence" in note for note in run_notes(own_run))
    make_heavy(own_run.path.parent / "shapes")
    assert any(HEAVY_NOTE.fullmatch(note) for note in run_notes(load_run(own_run.path)))
    assert any(HEAVY_NOTE.fullmatch(note) for note in summarize(own_run).notes)
    (own_run.path.parent / "shapes/library.yaml").unlink()
    assert not any("confidence" in note for note in run_notes(load_run(own_run.path)))


def test_verdicts_without_confidence_are_not_told_about(
    own_run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("known_judge.confidence", lambda id: None)
    folder = own_run.path.with_name("other")
    make_heavy(own_run.path.parent / "shapes")
    scene, station = own_run.path.parent / "three.yaml", own_run.station()
    options = {"grasps_per_object": 10, "blind": True, "progress": False, "executor": Inline()}
    run = evaluate(scene, station, folder, **asked(**options))
    assert summarize(run).total.executed
    assert not any("confidence" in note for note in run_notes(run))


def test_of_many_scenes_it_is_said_once(
    tmp_path: Path, station: Station, known_judge: None
) -> None:
    campaign = run_all(write_scenes(tmp_path), station, tmp_path / "all", grasps_per_object=20)
    assert not any("confidence" in note for note in summarize(campaign).notes)
    make_heavy(tmp_path / "shapes")
    notes = summarize(load_campaign(campaign.path)).notes
    assert sum(bool(HEAVY_NOTE.fullmatch(note)) for note in notes) == 1
