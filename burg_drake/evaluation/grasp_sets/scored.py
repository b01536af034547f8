"""Analytic quality of a set of grasps on several objects, with or without a scene."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, InvalidInputError, MeshError, UnknownNameError, nearest
from burg_drake.core.grasps import GraspSet, Stage
from burg_drake.core.terminal import Listener, Progress, ProgressMeter, Reporter
from burg_drake.evaluation.candidates import INSTANCE
from burg_drake.evaluation.grasp_sets.provenance import set_documents
from burg_drake.geometry import Surface
from burg_drake.grasping.clearance import CLEARANCE_VERSION
from burg_drake.grasping.quality import (
    DEFAULT_METRIC,
    METRICS,
    Payload,
    check_metric,
    grasp_quality,
    jaws_of,
    quality_provenance,
    score_of,
)
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Scene, SceneLike, as_scene
from burg_drake.station.document import Station, StationLike, as_station

BATCH = 2000
"""Grasps that are scored at a time; a grasp's figures do not depend on it."""
SCENE_COLUMNS = ("clearance", "nearest", "screened", "collides_with")
"""Columns that only a scene gives."""


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
    """Adds the metrics of `grasping.quality`, and in a scene the clearance of the open hand.

    Example::

        library, grasps = burg.load_library("household"), burg.GraspSet.load("grasps.h5")
        scored = burg.grasps.scored_set(grasps, library, "panda_tabletop", by="epsilon")
        best = scored.select(scored.score.argsort()[::-1][:10])

    Args:
        grasps: in the frames of their objects.
        library: has the objects.
        station: whose hand it is.
        scene: where the objects stand. A grasp is on the instance that its column `instance` names,
            or on the only one of its object.
        friction: coefficients by object, in place of the library's; under "" for all others.
        by: the metric that becomes the score, `grasping.quality.METRICS`.
        progress: True shows it on standard error; a function gets the events.

    Returns:
        The same grasps in the same order; `provenance["quality"]` tells with what they were scored.
        In a scene `gravity_margin` is known, and there are the `SCENE_COLUMNS`, which grasps from
        elsewhere lose without one: `clearance` [m], negative where the hand overlaps something;
        `nearest`, what it overlaps or is nearest to; `screened`, the outcome of the screen, `clear`
        or one of `Outcome`; and `collides_with`, what decided it, "" if clear.

    Raises:
        UnknownNameError: an object, an instance or the metric does not exist.
        InvalidInputError: an object has several instances and grasps do not say which one they are
            on, or the metric needs a scene.
        MeshError: the surface of an object cannot be used.
    """
    station = as_station(station)
    scene = None if scene is None else as_scene(scene)
    check_metric(by)
    if by == "gravity_margin" and scene is None:
        raise InvalidInputError("gravity_margin depends on where up is; give a scene")
    objects = sorted(set(grasps.object.tolist()))
    chosen = _friction(friction or {}, objects)
    jaws = jaws_of(station.hand, station.hand_model, station.packages)
    instance = None if scene is None else _instances(grasps, scene)
    X_WO = None if scene is None or instance is None else _placed(instance, scene, station)
    columns: dict[str, Any] = {name: np.full(len(grasps), np.nan) for name in METRICS}
    columns["force_closure"] = np.zeros(len(grasps), bool)
    payloads = {}
    with Reporter(progress) as reporter:
        pace = ProgressMeter(reporter.show, Progress("scoring", total=len(grasps)))
        for name in objects:
            payload = Payload.of(library.entry(name), chosen.get(name, chosen.get("")))
            payloads[name] = asdict(payload)
            surface = _surface(library, name)
            for some in _batches(grasps.object == name):
                up = None if X_WO is None else X_WO[some, 2, :3]
                quality = grasp_quality(grasps.X_OG[some], surface, payload, jaws, up=up)
                for metric in METRICS:
                    columns[metric][some] = getattr(quality, metric)
                pace.step(len(some))
        how: dict[str, Any] = {
            "payloads": payloads,
            **set_documents(library, scene, station, objects),
        }
        if scene is not None and instance is not None and X_WO is not None:
            pace = ProgressMeter(reporter.show, Progress("clearance", total=len(grasps)))
            columns |= _clearances(instance, X_WO @ grasps.X_OG, scene, station, pace)
            how["clearance_version"] = CLEARANCE_VERSION
    kept = {name: values for name, values in grasps.columns.items() if name not in SCENE_COLUMNS}
    provenance = {**grasps.provenance, "quality": quality_provenance(jaws, by, **how)}
    unscored = replace(grasps, columns=kept, provenance=provenance)
    return unscored.with_columns(**columns, score=score_of(columns[by], by))


def _batches(chosen: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Indices of the rows chosen (N,), so many at a time."""
    rows = np.flatnonzero(chosen)
    return [rows[k : k + BATCH] for k in range(0, len(rows), BATCH)]


def _friction(given: Mapping[str, float], objects: list[str]) -> dict[str, float]:
    """Coefficients by object, and under "" for all others."""
    for name in given:
        if name and name not in objects:
            raise UnknownNameError(
                f"friction is given for {name!r}, but there are no grasps of it; "
                f"{nearest(name, objects)}"
            )
    return dict(given)


def _surface(library: ObjectLibrary, name: str) -> Surface:
    try:
        return Surface.of(library.surface(name))
    except MeshError as error:
        raise MeshError(f"object {name!r}: {error}") from error


def _instances(grasps: GraspSet, scene: Scene) -> NDArray[np.str_]:
    """(N,) names of the instances that the grasps are on."""
    if INSTANCE in grasps.columns:
        names = grasps.column(INSTANCE)
        for name in set(names.tolist()) - {""}:
            if name not in scene.instances:
                raise UnknownNameError(
                    f"grasps are on instance {name!r}, which is not in scene {scene.name!r};"
                    f" {nearest(name, scene.instances)}"
                )
    else:
        names = np.full(len(grasps), "")
    found = names.astype(object)
    for object_name in sorted(set(grasps.object[names == ""].tolist())):
        own = [name for name, i in scene.instances.items() if i.object == object_name]
        if len(own) != 1:
            raise InvalidInputError(
                f"scene {scene.name!r} has {len(own)} instances of {object_name!r}; add a"
                f" column {INSTANCE!r} that says on which one each grasp is"
            )
        found[(names == "") & (grasps.object == object_name)] = own[0]
    return found.astype(str)


def _placed(instance: NDArray[np.str_], scene: Scene, station: Station) -> Array:
    """(N, 4, 4) poses of instances (N,) in the world."""
    X_WO = np.empty((len(instance), 4, 4))
    for name in set(instance.tolist()):
        X_WO[instance == name] = station.document.X_WS.matrix() @ scene.X_SO(name)
    return X_WO


def _clearances(
    instance: NDArray[np.str_], X_WG: Array, scene: Scene, station: Station, pace: ProgressMeter
) -> dict[str, Any]:
    from burg_drake.grasping.clearance import HandClearance
    from burg_drake.station.diagram import build_station_diagram

    screen = HandClearance(build_station_diagram(scene, station, robot="hand"))
    columns = {name: np.full(len(instance), "", dtype=object) for name in SCENE_COLUMNS}
    for name in sorted(set(instance.tolist())):
        for some in _batches(instance == name):
            found = screen.measure(name, X_WG[some])
            screened = np.where(found.clear, Stage.CLEAR.value, found.outcome)
            values = (found.clearance, found.nearest, screened, found.blocker)
            for column, value in zip(SCENE_COLUMNS, values, strict=True):
                columns[column][some] = value
            pace.step(len(some))
    return {
        name: values.astype(float if name == "clearance" else str)
        for name, values in columns.items()
    }
