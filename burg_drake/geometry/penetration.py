"""Exact penetration depth of convex shapes, for many relative poses at once.

Drake's own depth is that of some separating direction, and not always of the nearest one: a finger
pad 20 mm deep in a table top may be reported as 0.3 m away from the table's side.
"""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array
from burg_drake.geometry.convex import Components, Convex, dot, each
from burg_drake.geometry.polytope import Polytope
from burg_drake.geometry.poses import Poses


def penetration_depths(
    one: Polytope,
    other: Convex,
    X_BA: Poses,
    floor: Array | float = 0.0,
    *,
    faces_only: bool = False,
) -> Array:
    """Smallest translation that separates a polytope from another shape.

    Args:
        one: the polytope, given in A.
        other: the shape, given in B; M shapes or one for all.
        X_BA: (M,) poses of A in B.
        floor: (M,) depths below it need not be known [m].
        faces_only: ask only for directions normal to a face of either shape. What comes out is an
            upper bound of the depth then, and equal to it where the nearest way out is such a one.

    Returns:
        (M,) depths [m]. Where the shapes are apart, or the depth is below the floor, the number is
        some upper bound of the depth that is not above the floor.
    """
    normals = _rotated(X_BA.R, one.normals)
    p = X_BA.p[:, :, None].swapaxes(0, 1)
    vertices = each(np.add, _rotated(X_BA.R, one.vertices), (p[0], p[1], p[2]))
    overlap = dot(normals, (p[0], p[1], p[2])) + one.offsets + other.reach(normals)
    depth = np.minimum(overlap.min(axis=1), other.along_own_faces(vertices))
    left = np.flatnonzero(depth > floor)
    if len(left) and not faces_only:
        normals, vertices = (each(lambda v: v[left], part) for part in (normals, vertices))
        edges = other.some(left).along_edges(one, normals, vertices)
        depth[left] = np.minimum(depth[left], edges)
    return depth


def _rotated(R_BA: Array, v_A: Array) -> Components:
    """Vectors (K, 3) given in A, by component in B: (M, K)."""
    x, y, z = (
        R_BA[:, i, 0, None] * v_A[:, 0]
        + R_BA[:, i, 1, None] * v_A[:, 1]
        + R_BA[:, i, 2, None] * v_A[:, 2]
        for i in range(3)
    )
    return x, y, z
