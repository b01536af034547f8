"""The models of a data set in BOP's layout: PLY files in millimetres, and what is known of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import QhullError
from scipy.spatial.distance import cdist

from burg_drake.core import Array
from burg_drake.dataset.exchange.model_file import model_of, visual_model, write_ply
from burg_drake.dataset.exchange.symmetry import symmetries
from burg_drake.geometry import convex_hull
from burg_drake.objects.library import ObjectLibrary
from burg_drake.objects.meshes import decimated

MILLIMETRE = 1e-3
"""Unit of the files [m]."""
DECIMALS = 6
"""Of lengths in `models_info.json`."""
EVALUATION_FACES = 5000
"""Of a model that errors of poses are computed with."""
DISTANCE_BATCH_POINTS = 1000
"""Number of points whose distances to all others are in memory at the same time."""


def write_models(library: ObjectLibrary, objects: Sequence[str], folder: Path) -> None:
    """Writes `models` and `models_eval`, each with its `models_info.json`.

    Args:
        library: where the objects are.
        objects: names, in the order of their ids from 1.
        folder: of the data set.
    """
    looks, evaluation = folder / "models", folder / "models_eval"
    looks.mkdir()
    evaluation.mkdir()
    infos: dict[str, dict[str, Any]] = {}
    for number, name in enumerate(objects, start=1):
        file = f"obj_{number:06d}.ply"
        visual = visual_model(library, name)
        write_ply(visual, looks / file, unit=MILLIMETRE)
        surface, _ = decimated(library.surface(name), EVALUATION_FACES)
        write_ply(model_of(surface), evaluation / file, unit=MILLIMETRE)
        infos[str(number)] = model_info(visual.vertices)
        infos[str(number)] |= symmetries(visual, diameter(visual.vertices))
    for place in (looks, evaluation):
        (place / "models_info.json").write_text(json.dumps(infos, indent=2), encoding="utf-8")


def model_info(vertices: Array) -> dict[str, float]:
    """Box and diameter of a model's vertices (V, 3) [m], in millimetres, by BOP's names."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    info = {"diameter": diameter(vertices)}
    info |= {f"min_{axis}": float(lower[k]) for k, axis in enumerate("xyz")}
    info |= {f"size_{axis}": float(upper[k] - lower[k]) for k, axis in enumerate("xyz")}
    return {name: round(length / MILLIMETRE, DECIMALS) + 0.0 for name, length in info.items()}


def diameter(vertices: Array) -> float:
    """Largest distance of two vertices (V, 3): they are corners of the hull."""
    points = np.unique(vertices, axis=0)
    with suppress(QhullError):  # of a flat model all of them
        points = points[convex_hull(points).vertices]
    parts = np.array_split(points, 1 + len(points) // DISTANCE_BATCH_POINTS)
    return float(max(cdist(part, points).max() for part in parts))
