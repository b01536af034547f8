"""Which objects will meet others while a scene falls, and should do so on patches.

Two rigid objects meet at a single point a pair of pieces. Objects of many pieces meet at many
points then, which carry them while they fall; a block on a block tumbles off its point.
"""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform

from burg_drake.core import Array
from burg_drake.station.diagram import StationDiagram

IN_THE_AIR = 0.0005
"""An object whose bounding boxes begin higher above the table stands on another one, or falls
[m]."""
BESIDE = 0.01
"""What falls meets what its bounding box comes so close to, seen from above [m]."""
FEW_PIECES = 8
"""Objects of more pieces stay rigid while they fall; compliant ones would take twice the time."""


def compliant_while_falling(built: StationDiagram) -> list[str]:
    """Free objects of few pieces that are in the air or below one that is.

    Args:
        built: a diagram; all is where the documents place it.
    """
    bounds = {name: _bounds(built, name) for name in built.free}
    found: set[str] = set()
    for lower, upper in bounds.values():
        if lower[2] < IN_THE_AIR:
            continue
        for other, (low, high) in bounds.items():
            near = (lower[:2] - BESIDE < high[:2]) & (low[:2] - BESIDE < upper[:2])
            if near.all():  # also itself: it may meet the background
                found.add(other)
    return [name for name in built.free if name in found and _pieces(built, name) <= FEW_PIECES]


def _pieces(built: StationDiagram, name: str) -> int:
    return len(built.plant.GetCollisionGeometriesForBody(built.plant.get_body(built.free[name])))


def _bounds(built: StationDiagram, name: str) -> tuple[Array, Array]:
    """Lower and upper corner (3,) of an object's bounding boxes in the world."""
    body, inspector = built.plant.get_body(built.free[name]), built.scene_graph.model_inspector()
    X_WO = RigidTransform(built.X_WO(name))
    corners = []
    for geometry in built.plant.GetCollisionGeometriesForBody(body):
        box = inspector.GetObbInGeometryFrame(geometry)
        X_WB = X_WO @ inspector.GetPoseInFrame(geometry) @ box.pose()
        reach = np.abs(X_WB.rotation().matrix()) @ box.half_width()
        corners += [X_WB.translation() - reach, X_WB.translation() + reach]
    return np.min(corners, axis=0), np.max(corners, axis=0)
