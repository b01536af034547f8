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
            instance = dataclasses.replace(instance, X_SO=Pose.readable(X_SW @ X))
        instances.append(instance)
    document = dataclasses.replace(scene.document, instances=tuple(instances))
    return Scene(document, scene.library, scene.path)


def has_moved(built: StationDiagram, name: str, X_WO: Array) -> bool:
    """Whether an object is elsewhere than in the document by more than a trifle (`STILL`)."""
    moved = displacement_from_document(built, name, X_WO)
    return moved.distance > STILL[0] or moved.angle > STILL[1]
