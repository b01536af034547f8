"""Grasps on the objects of a scene: read from a run, or sampled and screened with the open hand."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, MarginNames, check_pose, inverse, list_names
from burg_drake.dataset.sample import LabelledGrasps, instance_numbers
from burg_drake.evaluation import (
    Campaign,
    Run,
    SamplingSettings,
    load_run,
    open_results,
    sample_candidates,
)
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import StationLike, as_station


@dataclass(frozen=True, eq=False)
class SceneGrasps:
    """N grasps on the instances of a scene, with their outcomes.

    Attributes:
        X_OG: (N, 4, 4) grasp frames in the frames of their objects.
        instance: (N,) names of the placed objects.
        width: (N,) distance between the pads at contact [m]; nan if unknown.
        outcome: (N,) outcomes as in a run's table; `""` for a grasp without a final outcome.
        margins: (N,) arrays of margins, by column of a run's table; nan if unknown.

    Raises:
        InvalidInputError: the arrays differ in length, or a pose is invalid.
    """

    X_OG: Array
    instance: NDArray[np.str_]
    width: Array
    outcome: NDArray[np.str_]
    margins: dict[str, Array]

    def __post_init__(self) -> None:
        check_pose(self.X_OG, "X_OG")
        columns = {"instance": self.instance, "width": self.width, "outcome": self.outcome}
        for name, values in (columns | self.margins).items():
            if np.shape(values) != self.X_OG.shape[:1]:
                raise InvalidInputError(
                    f"{name} of grasps has shape {np.shape(values)}; expected ({len(self)},), one"
                    " for each grasp"
                )

    def __len__(self) -> int:
        return len(self.X_OG)


def label_grasps(grasps: SceneGrasps, scene: SceneLike, X_SC: Array) -> LabelledGrasps:
    """Transforms grasps into a camera's frame: all grasps in their order, in view or not.

    Args:
        grasps: grasps on instances of the scene.
        scene: scene with the placed instances, whose order gives the instances' numbers.
        X_SC: (4, 4) pose of the camera's optical frame in the scene frame, or of any other target
            frame, such as that of a volume.

    Raises:
        UnknownNameError: the scene has no such instance.
        InvalidInputError: `X_SC` is no pose.
    """
    scene = as_scene(scene)
    X_CS = inverse(check_pose(X_SC, "X_SC"))
    X_CG = np.empty((len(grasps), 4, 4))
    number = np.empty(len(grasps), np.uint16)
    numbers = instance_numbers(scene)
    for name in np.unique(grasps.instance).tolist():
        on_instance = grasps.instance == name
        X_CG[on_instance] = X_CS @ scene.X_SO(name) @ grasps.X_OG[on_instance]
        number[on_instance] = numbers[name]
    return LabelledGrasps(X_CG, grasps.width, number, grasps.outcome, dict(grasps.margins))


def grasps_of_run(run: Run | Campaign | str | Path, scene: SceneLike) -> SceneGrasps:
    """All grasps of a scene in a run, in the order of the run's candidates.

    Args:
        run: run of one scene or of many, complete or not; or its folder.
        scene: the scene: same objects at the same poses, under any name. If several scenes of the
            run are equal, the grasps of all are concatenated.

    Returns:
        Grasps with outcomes and margins as in the run's table. Grasps that the run has not judged
        have `""` and nan. Grasps whose simulation failed have that outcome.

    Raises:
        InvalidInputError: the run is of another scene, or failed for this one.
        UnknownNameError: the scene or its library is missing.
        DocumentError: a document does not fit the schema.
    """
    scene = as_scene(scene)
    results = run if isinstance(run, Run | Campaign) else open_results(run)
    if isinstance(results, Run):
        judged = results.document.scene
        if judged.content != scene.content:
            raise InvalidInputError(
                f"{results.path} is a run of scene {judged.name!r} ({judged.path}, content"
                f" {judged.content[:12]}), not of {scene.name!r} ({scene.path}, content"
                f" {scene.content[:12]}); their objects or poses differ"
            )
        return _candidates_with_results(results)
    return _concatenate_grasps(
        [_candidates_with_results(one) for one in _find_runs(results, scene)]
    )


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
        station: station with the hand.
        per_object: number of grasps on each free instance; fewer if the sampler finds no more.
        seed: seed of the random numbers.
        settings: settings of the sampler. By default it ignores collisions, to include negative
            examples; with `blind=False` the open hand collides at no grasp.

    Returns:
        The grasps. The outcome is `""` for a clear hand, as there is no trial; otherwise the
        screen's outcome, as in a run. Margins are those of the screen.

    Raises:
        InvalidInputError: `per_object` is below 1, or a setting is invalid.
        UnknownNameError: a file is missing.
    """
    screen_margins = ("overlap", "clearance")  # Margins that the screen of the open hand measures.
    from burg_drake.grasping import HandClearance
    from burg_drake.station import build_station_diagram

    scene, station = as_scene(scene), as_station(station)
    settings = settings or SamplingSettings(blind=True)
    candidates = sample_candidates(scene, station, per_object, seed, settings)
    diagram = build_station_diagram(scene, station, robot="hand")
    screen = HandClearance(diagram)
    X_OG, instance = candidates.grasps.X_OG, candidates.instance
    outcome = np.full(len(candidates), "", dtype="<U32")
    margins = {name: np.full(len(candidates), np.nan) for name in screen_margins}
    for name in dict.fromkeys(instance.tolist()):
        on_instance = instance == name
        found = screen.measure(name, diagram.X_WO(name) @ X_OG[on_instance])
        outcome[on_instance] = found.outcome
        for margin in screen_margins:
            margins[margin][on_instance] = getattr(found, margin)
    return SceneGrasps(X_OG, instance, candidates.grasps.width, outcome.astype(np.str_), margins)


def _candidates_with_results(run: Run) -> SceneGrasps:
    """All candidates of a run, with their results so far."""
    candidates, results = run.candidates, run.results
    place = {id: k for k, id in enumerate(candidates.id)}
    rows = np.array([place[id] for id in results["id"].tolist()], dtype=np.intp)
    outcome = np.full(len(candidates), "", dtype=results["outcome"].dtype)
    outcome[rows] = results["outcome"]
    margins = {}
    for name in MarginNames.all:
        if name in results:
            margins[name] = np.full(len(candidates), np.nan)
            margins[name][rows] = results[name]
    grasps = candidates.grasps
    return SceneGrasps(grasps.X_OG, candidates.instance, grasps.width, outcome, margins)


def _find_runs(campaign: Campaign, scene: Scene) -> list[Run]:
    """Runs of a scene in a campaign, at least one."""
    entries = campaign.document.assigned_scenes
    names = [entry.name for entry in entries if entry.content == scene.content]
    if not names:
        raise InvalidInputError(
            f"{campaign.path} has no scene with the objects and poses of {scene.name!r}"
            f" ({scene.path}, content {scene.content[:12]}); it has"
            f" {list_names([entry.name for entry in entries])}"
        )
    for name in names:
        if name in campaign.failed:
            raise InvalidInputError(
                f"{campaign.path} has no grasps of scene {name!r}, because its evaluation failed:"
                f" {campaign.failed[name]}"
            )
    return [load_run(campaign.folder(name)) for name in names]


def _concatenate_grasps(parts: list[SceneGrasps]) -> SceneGrasps:
    if len(parts) == 1:
        return parts[0]
    fields = [field.name for field in dataclasses.fields(SceneGrasps) if field.name != "margins"]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in fields}
    margins = {
        name: np.concatenate([part.margins[name] for part in parts]) for name in parts[0].margins
    }
    return SceneGrasps(**joined, margins=margins)
