"""Where objects stand: corners of their bounds in the scene, and how they are turned."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from burg_drake.compose.document.state import State
from burg_drake.core import Array, rotation_angle, transform_points
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.arrangement import convex_polygon, simplified
from burg_drake.scene.document import read_vertices

SHADOW_TOLERANCE = 2e-4
"""How far polygons with few corners reach beyond a side of the true ones [m]."""


def object_vertices(library: ObjectLibrary, name: str) -> Array:
    """(N, 3) vertices of an object's convex hull in its own frame [m].

    Raises:
        UnknownNameError: no such object, or its mesh is missing.
        MeshError: its mesh is damaged.
    """
    entry = library.entry(name)
    path = library.path(entry.surface or entry.mesh)
    try:
        return _hull(path, entry.build)
    except (OSError, ValueError) as error:
        raise library.damaged(path) from error


@lru_cache(maxsize=1000)
def _hull(path: Path, build: str) -> Array:
    """The same, of a file; `build` is the hash of what it was made from."""
    from scipy.spatial import ConvexHull, QhullError

    p_OV = read_vertices(path)
    try:
        hull: Array = p_OV[ConvexHull(p_OV).vertices]
        return hull
    except (QhullError, ValueError):  # flat
        return p_OV


def bounds(state: State, name: str, X_SO: Array | None = None) -> Array:
    """(2, 3) lower and upper corner of an instance's bounding box in the scene frame [m].

    Args:
        state: that has the instance.
        name: of the instance.
        X_SO: (4, 4) pose, where it is not its present one.
    """
    X = state.X_SO(name) if X_SO is None else X_SO
    return object_bounds(state.library, state.instance(name).object, X)


def object_bounds(library: ObjectLibrary, object: str, X_SO: Array) -> Array:
    """(2, 3) the same of an object that need not be an instance."""
    p_SV = transform_points(X_SO, object_vertices(library, object))
    return np.array([p_SV.min(axis=0), p_SV.max(axis=0)])


def shadow(state: State, name: str) -> Array:
    """(N, 2) convex polygon that an instance covers of the board [m]; see `object_shadow`."""
    return object_shadow(state.library, state.instance(name).object, state.X_SO(name))


def object_shadow(library: ObjectLibrary, object: str, X_SO: Array) -> Array:
    """(N, 2) what an object covers of the board, and at most `SHADOW_TOLERANCE` more [m]."""
    p_SV = transform_points(X_SO, object_vertices(library, object))
    return simplified(convex_polygon(p_SV[:, :2]), SHADOW_TOLERANCE)


def yaw_between(R_SA: Array, R_SB: Array) -> float:
    """The rotation about z that brings A nearest to B [rad].

    It maximises trace(R_SB^T Rz R_SA); (3, 3) rotation matrices.
    """
    R = R_SB @ R_SA.T
    return float(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]))


def nearest_stable_pose(state: State, name: str) -> tuple[int, float] | None:
    """The stable pose that an instance is in, or nearest to: its number and the yaw [rad].

    None for an object without stable poses.
    """
    from burg_drake.core import rot_z

    R_SO = state.X_SO(name)[:3, :3]
    found: list[tuple[float, int, float]] = []
    for k, stable in enumerate(state.entry(name).stable_poses):
        R_k = stable.X_SO.matrix()[:3, :3]
        yaw = yaw_between(R_k, R_SO)
        tilt = float(rotation_angle((rot_z(yaw) @ R_k).T @ R_SO))
        found.append((round(tilt, 6), k, yaw))
    if not found:
        return None
    _, k, yaw = min(found)
    return k, yaw
