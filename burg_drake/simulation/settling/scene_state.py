"""The scene that a simulation has led to, as a document."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping

import numpy as np

from burg_drake.core import Array, inverse
from burg_drake.core.documents import Pose
from burg_drake.scene.document import Scene
from burg_drake.simulation.rest import displacement_from_document
from burg_drake.station.diagram import StationDiagram

STILL = (5e-5, float(np.deg2rad(0.02)))
"""An object that moves [m] and turns [rad] by less keeps the pose that it had in the document."""


def placed_scene(
    built: StationDiagram, X_WO: Mapping[str, Array], exact: Collection[str] = ()
) -> Scene:
    """The scene with its free objects elsewhere.

    Args:
        built: a diagram of the scene as it was.
        X_WO: (4, 4) poses; objects that have none are left out.
        exact: objects that get their pose even if it is the old one but for a trifle: the forces
            between objects that touch depend on trifles.
    """
    scene = built.scene
    X_SW = inverse(built.station.document.X_WS.matrix())
    instances = []
    for name, X in X_WO.items():
        instance = scene.instances[name]
        if name in exact or has_moved(built, name, X):
            instance = dataclasses.replace(instance, X_SO=_readable(X_SW @ X))
        instances.append(instance)
    document = dataclasses.replace(scene.document, instances=tuple(instances))
    return Scene(document, scene.library, scene.path)


def has_moved(built: StationDiagram, name: str, X_WO: Array) -> bool:
    """Whether an object is elsewhere than in the document by more than a trifle (`STILL`)."""
    moved = displacement_from_document(built, name, X_WO)
    return moved.distance > STILL[0] or moved.angle > STILL[1]


def _readable(X_SO: Array) -> Pose:
    """A pose to the micrometre and a ten thousandth of a degree, as people can read it."""
    exact = Pose.from_matrix(X_SO)
    x, y, z = (round(value, 6) + 0.0 for value in exact.translation)
    roll, pitch, yaw = (round(value, 4) + 0.0 for value in exact.rpy_deg or (0.0, 0.0, 0.0))
    return Pose((x, y, z), rpy_deg=(roll, pitch, yaw))
