"""How far an object has moved from where its document places it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, inverse, rotation_angle
from burg_drake.scene.document import Scene, support_vertices
from burg_drake.station.diagram import StationDiagram


@dataclass(frozen=True)
class Displacement:
    """How far an object was moved.

    Attributes:
        distance: of its centre of mass [m].
        angle: of its rotation [rad].
    """

    distance: float
    angle: float


def displacement_from_document(built: StationDiagram, name: str, X_WO: Array) -> Displacement:
    """How far an instance is from its place in the document.

    Args:
        built: the diagram.
        name: of the instance.
        X_WO: (4, 4) where it is.
    """
    X_OO = inverse(built.X_WO(name)) @ X_WO
    p_OOcm = np.array(built.scene.entry(name).mass_properties.center_of_mass)
    moved = X_OO[:3, :3] @ p_OOcm + X_OO[:3, 3] - p_OOcm
    return Displacement(float(np.linalg.norm(moved)), float(rotation_angle(X_OO[:3, :3])))


def depth_in_table(scene: Scene, X_WO: Array, name: str) -> float:
    """How far what an instance rests with, at `X_WO`, is below the table's top [m].

    Args:
        scene: the scene.
        X_WO: (4, 4) where the instance is.
        name: of the instance.
    """
    p_OC = support_vertices(scene.library, scene.instance(name).object)
    return -float((p_OC @ X_WO[2, :3]).min() + X_WO[2, 3])
