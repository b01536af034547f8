"""Joins what was sampled on several objects into one set that says how it was made."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np

from burg_drake.core.grasps import GraspSet
from burg_drake.evaluation.candidates import INSTANCE
from burg_drake.evaluation.run_document import software_versions
from burg_drake.evaluation.sampling_settings import SamplingSettings
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.scene import Scene
from burg_drake.station.station import Station


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
        station, n, seed, settings: what `sample_scene` or `sample_library` was called with.

    Returns:
        The grasps, with all that it takes to sample them again: the documents and the content that
        they had, `n`, `seed`, `settings`, versions, and under `parts` the provenance of each
        object's grasps. Weights of faces are there by their hashes.
    """
    kind, document = ("library", library.root) if scene is None else ("scene", scene.path)
    provenance: dict[str, Any] = {
        kind: str(document.resolve()),
        "station": str(station.path.resolve()),
        "n": n,
        "seed": seed,
        "settings": _plain(settings),
        "content": {
            **({} if scene is None else {"scene": scene.content}),
            "station": station.content,
            "objects": {
                object: library.entry(object).build
                for grasps in sampled.values()
                for object in np.unique(grasps.object).tolist()
            },
        },
        "versions": software_versions(),
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
