"""Where the objects of a scene stand on the board."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from burg_drake.cameras.projection.scene_mesh import SceneMesh
from burg_drake.core import Array, Indices

NEAR_BOARD = 2e-3
"""What of an object is not higher above the board counts as standing on it [m]."""


def footprints(shape: SceneMesh) -> tuple[Array, Indices]:
    """Outlines of where objects stand on the board, without their dents.

    Returns:
        (N, 2, 3) ends of lines in S, in the plane of the board [m], and (N,) the number of the
        instance of each; none for what stands on other objects.
    """
    lines, owner = [np.empty((0, 2, 3))], [np.empty(0, np.int64)]
    for number, name in enumerate(shape.names):
        vertices = shape.vertices(name)
        flat = vertices[vertices[:, 2] <= NEAR_BOARD, :2]
        try:
            corners = flat[ConvexHull(flat).vertices]
        except (QhullError, ValueError):  # no, or too few, points, or all on a line
            continue
        ring = np.column_stack([corners, np.zeros(len(corners))])
        lines.append(np.stack([ring, np.roll(ring, -1, axis=0)], axis=1))
        owner.append(np.full(len(ring), number))
    return np.concatenate(lines), np.concatenate(owner)
