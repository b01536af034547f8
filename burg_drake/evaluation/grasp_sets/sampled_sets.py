"""Grasp sets of several objects: sampling with provenance, and analytic quality of any set."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    GraspSet,
    InvalidInputError,
    Listener,
    MeshError,
    Progress,
    ProgressMeter,
    Reporter,
    Stage,
    UnknownNameError,
    suggest_names,
)
from burg_drake.evaluation.candidates import INSTANCE_COLUMN
from burg_drake.evaluation.grasp_sets.input import object_files, set_documents
from burg_drake.evaluation.grasp_sets.sampling import sample_library, sample_on_scene
from burg_drake.evaluation.judge import build_hand_clearance
from burg_drake.evaluation.settings import SamplingSettings
from burg_drake.geometry import Surface
from burg_drake.grasping import (
    CLEARANCE_VERSION,
    DEFAULT_METRIC,
    METRICS,
    Payload,
    check_metric,
    grasp_quality,
    jaws_of,
    quality_provenance,
    score_of,
)
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station, instance_pose


def sample_grasps(
    source: SceneLike | ObjectLibrary,
    station: StationLike,
    n: int,
    *,
    seed: int = 0,
    settings: SamplingSettings | None = None,
    only: Iterable[str] | None = None,
) -> GraspSet:
    """Samples antipodal grasps on the free objects of a scene, or on the objects of a library.

    Example::

        settings = burg.SamplingSettings(from_arm_side=True)
        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 200, settings=settings)
        grasps.save("grasps.h5")

    Args:
        source: the scene, or the library, whose objects have no pose.
        station: gives the hand and, in a scene, the place of the arm.
        n: grasps for each instance or object; fewer if no more exist.
        seed: seed of the random numbers. It determines the grasps of an object, together with the
            object and, unless they are sampled blind, its surroundings.
        settings: sampling settings; the defaults if None.
        only: names of objects, or of instances of the scene; all if None.

    Returns:
        The grasps in the frames of their objects, in a scene with the column `instance`.

    Raises:
        InvalidInputError: n is below 1, a setting does not fit, or there is nothing to sample on.
        UnknownNameError: no such instance or object, or a mesh file is missing.
    """
    chosen = settings or SamplingSettings()
    only = (only,) if isinstance(only, str) else only
    station = as_station(station)
    if isinstance(source, ObjectLibrary):
        scene, library = None, source
    else:
        scene = as_scene(source)
        library = scene.library
    if scene is None:
        sampled = dict(sample_library(library, station, n, seed, chosen, only))
    else:
        sampled = dict(sample_on_scene(scene, station, n, seed, chosen, only))
    if not sampled:
        raise InvalidInputError(
            f"{(scene or library).name!r} has no free objects to sample grasps on"
        )
    return sampled_set(sampled, library, scene, station, n, seed, chosen)


def sampled_set(
    sampled: Mapping[str, GraspSet],
    library: ObjectLibrary,
    scene: Scene | None,
    station: Station,
    n: int,
    seed: int,
    settings: SamplingSettings,
) -> GraspSet:
    """Joins all grasps to one set.

    Args:
        sampled: grasps by name of the instance, or of the object without a scene; one or more.
        library: library with the objects.
        scene: scene of the objects, if any; the set then has the column `instance`.
        station, n, seed, settings: arguments of `sample_on_scene` or `sample_library`.

    Returns:
        The grasps, with all inputs to sample them again: documents and their content, `n`, `seed`,
        `settings`, versions, and under `parts` the provenance of each object's grasps. Weights of
        faces are named by their hashes. `object_files` describes each object as files of other
        projects do.
    """
    objects = sorted({name for grasps in sampled.values() for name in grasps.object.tolist()})
    provenance: dict[str, Any] = {
        **set_documents(library, scene, station, objects),
        "object_files": object_files(library, objects),
        "n": n,
        "seed": seed,
        "settings": _settings_data(settings),
        "parts": {name: dict(grasps.provenance) for name, grasps in sampled.items()},
    }
    joined = dataclasses.replace(GraspSet.concatenate(sampled.values()), provenance=provenance)
    if scene is None:
        return joined
    names = np.repeat(list(sampled), [len(grasps) for grasps in sampled.values()])
    return joined.with_columns(**{INSTANCE_COLUMN: names})


def _settings_data(settings: SamplingSettings) -> dict[str, Any]:
    """The settings as JSON values; weights are replaced by the names of their objects."""
    return {
        **vars(settings),
        "standoffs": list(settings.standoffs),
        "weights": sorted(settings.weights),
    }


SCENE_COLUMNS = ("clearance", "nearest", "screened", "collides_with")
"""Columns that need a scene."""


def scored_set(
    grasps: GraspSet,
    library: ObjectLibrary,
    station: StationLike,
    scene: SceneLike | None = None,
    *,
    friction: Mapping[str, float] | None = None,
    by: str = DEFAULT_METRIC,
    progress: bool | Listener = False,
) -> GraspSet:
    """Adds the metrics of `grasping.METRICS`, and in a scene the clearance of the open hand.

    Example::

        library, grasps = burg.load_library("household"), burg.GraspSet.load("grasps.h5")
        scored = burg.grasps.scored_set(grasps, library, "panda_tabletop", by="epsilon")
        best = scored.select(scored.score.argsort()[::-1][:10])

    Args:
        grasps: grasps in the frames of their objects.
        library: library with the objects.
        station: station with the hand.
        scene: scene of the objects. A grasp is on the instance in its column `instance`, or on the
            only instance of its object.
        friction: coefficients by object, in place of the library's; under "" for all others.
        by: metric of `grasping.METRICS` that becomes the score.
        progress: True shows it on standard error; a function gets the events.

    Returns:
        The same grasps in the same order; `provenance["quality"]` names the inputs of the scores.
        In a scene `gravity_margin` is known and the `SCENE_COLUMNS` are added; without a scene they
        are removed: `clearance` [m], negative if the hand overlaps a body; `nearest`, the
        overlapping or nearest body; `screened`, the outcome of the screen, `clear` or one of
        `Outcome`; and `collides_with`, the deciding body, "" if clear.

    Raises:
        UnknownNameError: an object, an instance or the metric does not exist.
        InvalidInputError: an object has several instances and its grasps do not name theirs, or the
            metric needs a scene.
        MeshError: the surface of an object cannot be used.
    """
    station = as_station(station)
    scene = None if scene is None else as_scene(scene)
    check_metric(by)
    if by == "gravity_margin" and scene is None:
        raise InvalidInputError("gravity_margin depends on where up is; give a scene")
    objects = sorted(set(grasps.object.tolist()))
    friction = friction or {}
    _require_friction_names(friction, objects)
    jaws = jaws_of(station.hand, station.hand_model, station.packages)
    instance = None if scene is None else _instances(grasps, scene)
    X_WO = None
    if scene is not None and instance is not None:
        poses = {name: instance_pose(scene, station, name) for name in set(instance.tolist())}
        X_WO = np.array([poses[name] for name in instance.tolist()]).reshape(-1, 4, 4)
    columns: dict[str, Any] = {name: np.full(len(grasps), np.nan) for name in METRICS}
    columns["force_closure"] = np.zeros(len(grasps), bool)
    payloads = {}
    with Reporter(progress) as reporter:
        meter = ProgressMeter(reporter.show, Progress("scoring", total=len(grasps)))
        for name in objects:
            payload = Payload.of(library.entry(name), friction.get(name, friction.get("")))
            payloads[name] = asdict(payload)
            surface = _surface(library, name)
            for batch in _batches(grasps.object == name):
                up = None if X_WO is None else X_WO[batch, 2, :3]
                quality = grasp_quality(grasps.X_OG[batch], surface, payload, jaws, up=up)
                for metric in METRICS:
                    columns[metric][batch] = getattr(quality, metric)
                meter.step(len(batch))
        how: dict[str, Any] = {
            "payloads": payloads,
            **set_documents(library, scene, station, objects),
        }
        if scene is not None and instance is not None and X_WO is not None:
            meter = ProgressMeter(reporter.show, Progress("clearance", total=len(grasps)))
            columns |= _clearances(instance, X_WO @ grasps.X_OG, scene, station, meter)
            how["clearance_version"] = CLEARANCE_VERSION
    kept = {name: values for name, values in grasps.columns.items() if name not in SCENE_COLUMNS}
    provenance = {**grasps.provenance, "quality": quality_provenance(jaws, by, **how)}
    unscored = replace(grasps, columns=kept, provenance=provenance)
    return unscored.with_columns(**columns, score=score_of(columns[by], by))


def _batches(chosen: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Indices of the chosen rows (N,) in batches of 2000; metrics do not depend on the batches."""
    rows = np.flatnonzero(chosen)
    return [rows[k : k + 2000] for k in range(0, len(rows), 2000)]


def _require_friction_names(friction: Mapping[str, float], objects: list[str]) -> None:
    """Refuses coefficients for objects without grasps."""
    for name in friction:
        if name and name not in objects:
            raise UnknownNameError(
                f"friction is given for {name!r}, but there are no grasps of it; "
                f"{suggest_names(name, objects)}"
            )


def _surface(library: ObjectLibrary, name: str) -> Surface:
    try:
        return Surface.of(library.surface(name))
    except MeshError as error:
        raise MeshError(f"object {name!r}: {error}") from error


def _instances(grasps: GraspSet, scene: Scene) -> NDArray[np.str_]:
    """(N,) names of the grasps' instances."""
    if INSTANCE_COLUMN in grasps.columns:
        names = grasps.column(INSTANCE_COLUMN)
        for name in set(names.tolist()) - {""}:
            if name not in scene.instances:
                raise UnknownNameError(
                    f"grasps are on instance {name!r}, which is not in scene {scene.name!r};"
                    f" {suggest_names(name, scene.instances)}"
                )
    else:
        names = np.full(len(grasps), "")
    found = names.astype(object)
    for object_name in sorted(set(grasps.object[names == ""].tolist())):
        own = [name for name, i in scene.instances.items() if i.object == object_name]
        if len(own) != 1:
            raise InvalidInputError(
                f"scene {scene.name!r} has {len(own)} instances of {object_name!r}; add a"
                f" column {INSTANCE_COLUMN!r} that says on which one each grasp is"
            )
        found[(names == "") & (grasps.object == object_name)] = own[0]
    return found.astype(str)


def _clearances(
    instance: NDArray[np.str_], X_WG: Array, scene: Scene, station: Station, meter: ProgressMeter
) -> dict[str, Any]:
    screen, _ = build_hand_clearance(scene, station)
    columns = {name: np.full(len(instance), "", dtype=object) for name in SCENE_COLUMNS}
    for name in sorted(set(instance.tolist())):
        for batch in _batches(instance == name):
            found = screen.measure(name, X_WG[batch])
            screened = np.where(found.clear, Stage.CLEAR.value, found.outcome)
            values = (found.clearance, found.nearest, screened, found.blocker)
            for column, value in zip(SCENE_COLUMNS, values, strict=True):
                columns[column][batch] = value
            meter.step(len(batch))
    return {n: v.astype(float if n == "clearance" else str) for n, v in columns.items()}
