"""Sets of grasps sampled on several objects, which say how they were made."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import (
    INSTANCE,
    SamplingSettings,
    sample_library,
    sample_on_scene,
)
from burg_drake.evaluation.grasp_sets.provenance import object_files, set_documents
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Scene, SceneLike, as_scene
from burg_drake.station.document import Station, StationLike, as_station


def sample_grasps(
    source: SceneLike | ObjectLibrary,
    station: StationLike,
    n: int,
    *,
    seed: int = 0,
    settings: SamplingSettings | None = None,
    only: Iterable[str] | None = None,
) -> GraspSet:
    """Samples antipodal grasps on the free objects of a scene, or on those of a library.

    Example::

        settings = burg.SamplingSettings(from_arm_side=True)
        grasps = burg.sample_grasps("tabletop_six", "panda_tabletop", 200, settings=settings)
        grasps.save("grasps.h5")

    Args:
        source: the scene, or the library, in which objects lie nowhere.
        station: gives the hand and, in a scene, the place of the arm.
        n: grasps for each instance or object; there are fewer where there are no more.
        seed: of the random numbers. The grasps of an object follow from it, the object and, unless
            they are sampled blind, what stands around it.
        settings: how; the defaults if None.
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
    stream = (
        sample_library(library, station, n, seed, chosen, only)
        if scene is None
        else sample_on_scene(scene, station, n, seed, chosen, only)
    )
    sampled = dict(stream)
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
    """One set of all grasps.

    Args:
        sampled: grasps by name of the instance, or of the object where there is no scene; one or
            more.
        library: has the objects.
        scene: where they stand, if anywhere; the set then has the column `instance`.
        station, n, seed, settings: what `sample_on_scene` or `sample_library` was called with.

    Returns:
        The grasps, with all that it takes to sample them again: the documents and the content that
        they had, `n`, `seed`, `settings`, versions, and under `parts` the provenance of each
        object's grasps. Weights of faces are there by their hashes. `object_files` describes each
        object as files of other projects do.
    """
    objects = sorted({name for grasps in sampled.values() for name in grasps.object.tolist()})
    provenance: dict[str, Any] = {
        **set_documents(library, scene, station, objects),
        "object_files": object_files(library, objects),
        "n": n,
        "seed": seed,
        "settings": _plain(settings),
        "parts": {name: dict(grasps.provenance) for name, grasps in sampled.items()},
    }
    joined = dataclasses.replace(GraspSet.concatenate(sampled.values()), provenance=provenance)
    if scene is None:
        return joined
    names = np.repeat(list(sampled), [len(grasps) for grasps in sampled.values()])
    return joined.with_columns(**{INSTANCE: names})


def _plain(settings: SamplingSettings) -> dict[str, Any]:
    """The settings as JSON values; of the weights, whose objects have some."""
    values = {field.name: getattr(settings, field.name) for field in dataclasses.fields(settings)}
    return {**values, "standoffs": list(settings.standoffs), "weights": sorted(settings.weights)}
