"""Where the grasps of a scene come from: a run that judged them, or the sampler and the screen of
the open hand."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError, listing
from burg_drake.core.grasps import MARGINS
from burg_drake.dataset.labels.scene_grasps import SceneGrasps
from burg_drake.evaluation.candidates import SamplingSettings, sample_candidates
from burg_drake.evaluation.store import Campaign, Run, load_run, open_results
from burg_drake.scene.document import Scene, SceneLike, as_scene
from burg_drake.station.document import StationLike, as_station

SHOWN_DIGITS = 12
"""Of contents in messages, as in a run's own."""
SCREEN_MARGINS = ("overlap", "clearance")
"""Margins that the screen of the open hand measures."""


def grasps_of_run(run: Run | Campaign | str | Path, scene: SceneLike) -> SceneGrasps:
    """All grasps of a scene in a run, in the order of its candidates.

    Args:
        run: of one scene or of many, complete or not; or its folder.
        scene: the one that is wanted: the same objects at the same places, under any name. If
            several scenes of the run are alike, the grasps of all follow each other.

    Returns:
        Outcomes and margins as in the run's table. Grasps that it has not judged, or not in this
        shard, are there with `""` and nan; those whose simulation failed with that outcome.

    Raises:
        InvalidInputError: the run is of another scene, or could not judge this one.
        UnknownNameError: the scene or its library is missing.
        DocumentError: a document does not fit the schema.
    """
    scene = as_scene(scene)
    found = run if isinstance(run, Run | Campaign) else open_results(run)
    if isinstance(found, Run):
        judged = found.document.scene
        if judged.content != scene.content:
            raise InvalidInputError(
                f"{found.path} is a run of scene {judged.name!r} ({judged.path}, content"
                f" {judged.content[:SHOWN_DIGITS]}), not of {scene.name!r} ({scene.path}, content"
                f" {scene.content[:SHOWN_DIGITS]}); their objects or poses differ"
            )
        return _grasps_of(found)
    return _joined([_grasps_of(one) for one in _runs_of(found, scene)])


def sampled_grasps(
    scene: SceneLike,
    station: StationLike,
    per_object: int,
    seed: int,
    settings: SamplingSettings | None = None,
) -> SceneGrasps:
    """Antipodal grasps on the free objects of a scene, screened with the open hand; no trials.

    Args:
        scene: the scene.
        station: has the hand.
        per_object: grasps on each free instance; there are fewer where there are no more.
        seed: of the random numbers.
        settings: of the sampler. By default it is blind, so that grasps at which the open hand
            collides are examples, too; with `blind=False` all are clear.

    Returns:
        The grasps. The outcome is `""` where the hand is clear, as nothing tells how the grasp
        would end, else that of the screen, as a run would have it. Margins are those of the screen.

    Raises:
        InvalidInputError: `per_object` is below 1, or a setting does not fit.
        UnknownNameError: a file is missing.
    """
    from burg_drake.grasping.clearance import HandClearance
    from burg_drake.station.diagram import build_station_diagram

    scene, station = as_scene(scene), as_station(station)
    settings = settings or SamplingSettings(blind=True)
    candidates = sample_candidates(scene, station, per_object, seed, settings)
    diagram = build_station_diagram(scene, station, robot="hand")
    screen = HandClearance(diagram)
    X_OG, instance = candidates.grasps.X_OG, candidates.instance
    outcome = np.full(len(candidates), "", dtype="<U32")
    margins = {name: np.full(len(candidates), np.nan) for name in SCREEN_MARGINS}
    for name in dict.fromkeys(instance.tolist()):
        mine = instance == name
        found = screen.measure(name, diagram.X_WO(name) @ X_OG[mine])
        outcome[mine] = found.outcome
        for margin in SCREEN_MARGINS:
            margins[margin][mine] = getattr(found, margin)
    return SceneGrasps(X_OG, instance, candidates.grasps.width, outcome.astype(np.str_), margins)


def _grasps_of(run: Run) -> SceneGrasps:
    """All candidates of a run, with what is known of them."""
    candidates, results = run.candidates, run.results
    place = {id: k for k, id in enumerate(candidates.id)}
    rows = np.array([place[id] for id in results["id"].tolist()], dtype=np.intp)
    outcome = np.full(len(candidates), "", dtype=results["outcome"].dtype)
    outcome[rows] = results["outcome"]
    margins = {}
    for name in MARGINS:
        if name in results:
            margins[name] = np.full(len(candidates), np.nan)
            margins[name][rows] = results[name]
    grasps = candidates.grasps
    return SceneGrasps(grasps.X_OG, candidates.instance, grasps.width, outcome, margins)


def _runs_of(campaign: Campaign, scene: Scene) -> list[Run]:
    """The runs of a scene among those of many, at least one."""
    entries = campaign.document.mine
    names = [entry.name for entry in entries if entry.content == scene.content]
    if not names:
        raise InvalidInputError(
            f"{campaign.path} has no scene with the objects and poses of {scene.name!r}"
            f" ({scene.path}, content {scene.content[:SHOWN_DIGITS]}); it has"
            f" {listing([entry.name for entry in entries])}"
        )
    for name in names:
        if name in campaign.failed:
            raise InvalidInputError(
                f"{campaign.path} has no grasps of scene {name!r}, because its evaluation failed:"
                f" {campaign.failed[name]}"
            )
    return [load_run(campaign.folder(name)) for name in names]


def _joined(parts: list[SceneGrasps]) -> SceneGrasps:
    if len(parts) == 1:
        return parts[0]
    fields = [field.name for field in dataclasses.fields(SceneGrasps) if field.name != "margins"]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in fields}
    margins = {
        name: np.concatenate([part.margins[name] for part in parts]) for name in parts[0].margins
    }
    return SceneGrasps(**joined, margins=margins)
