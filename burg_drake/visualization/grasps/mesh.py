"""Grasps as small grippers, one mesh a colour: thousands of them cost a browser nothing."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Meshcat

from burg_drake.core import Array, InvalidInputError, transform_points
from burg_drake.visualization.grasps.groups import GraspGroup
from burg_drake.visualization.meshcat import draw_flat

FINGER_LENGTH = 0.045
"""From the glyph's palm to the grasp frame's origin [m]."""
STEM_LENGTH = 0.03
"""Of the handle behind the palm [m]."""
BAR_RADIUS = 0.0013
"""Circumradius of the glyph's three-sided bars [m]."""
FAINT_BAR_RADIUS = 0.0008
"""The same for groups of outcomes that are drawn faintly."""

GRASPS_PATH = "/drake/grasps"


def draw_grasps(
    meshcat: Meshcat, X_WG: ArrayLike, width: ArrayLike, groups: Iterable[GraspGroup]
) -> None:
    """Draws grasps in groups of one colour each, in the place of those drawn before.

    Args:
        meshcat: where to draw, below `/drake/grasps`, one path a group.
        X_WG: (N, 4, 4) grasps in the world.
        width: (N,) distance between the pads [m]; finite.
        groups: with indices of the grasps; those that are in none are not drawn.

    Raises:
        InvalidInputError: the lengths differ, or a width is not known.
    """
    poses = np.asarray(X_WG, dtype=float).reshape(-1, 4, 4)
    widths = np.asarray(width, dtype=float)
    if widths.shape != (len(poses),) or not np.isfinite(widths).all():
        known = np.count_nonzero(np.isfinite(widths))
        raise InvalidInputError(f"{known} known widths for {len(poses)} grasps; give one each")
    meshcat.Delete(GRASPS_PATH)
    for group in groups:
        radius = BAR_RADIUS if group.rgba[3] == 1.0 else FAINT_BAR_RADIUS
        vertices, faces = grasp_triangles(poses[group.members], widths[group.members], radius)
        draw_flat(meshcat, grasp_path(group.key), vertices, faces, group.rgba)


def grasp_path(key: str) -> str:
    """Where in Meshcat's tree the group of grasps with a key is."""
    return f"{GRASPS_PATH}/{key}"


def grasp_triangles(
    X_WG: Array, width: Array, radius: float = BAR_RADIUS
) -> tuple[Array, NDArray[np.int32]]:
    """Glyphs of many grasps as one mesh.

    Args:
        X_WG: (N, 4, 4) grasps.
        width: (N,) distance between the fingers [m].
        radius: of the bars [m].

    Returns:
        Vertices (3, V) in the world [m] and triangles (3, F).
    """
    start, end = _segments(width)
    vertices, faces = _bars(start.reshape(-1, 3), end.reshape(-1, 3), radius)
    p_WV = transform_points(X_WG, vertices.reshape(len(X_WG), -1, 3))
    return np.asfortranarray(p_WV.reshape(-1, 3).T), np.asfortranarray(faces.T)


def _segments(width: Array) -> tuple[Array, Array]:
    """Starts and ends (N, 4, 3) in G of the glyph's strokes: two fingers, palm, stem."""
    half = width[:, None] / 2
    x = np.concatenate([half, -half, half, 0 * half], axis=1)
    x_end = np.concatenate([half, -half, -half, 0 * half], axis=1)
    palm = -FINGER_LENGTH
    z = np.broadcast_to([0.0, 0.0, palm, palm], x.shape)
    z_end = np.broadcast_to([palm, palm, palm, palm - STEM_LENGTH], x.shape)
    y = np.zeros_like(x)
    return np.stack([x, y, z], axis=-1), np.stack([x_end, y, z_end], axis=-1)


def _bars(start: Array, end: Array, radius: float) -> tuple[Array, NDArray[np.int32]]:
    """Three-sided bars (M, 6, 3) between points (M, 3) of planes y = const, and triangles."""
    along = end - start
    along = along / np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-12)
    u = np.broadcast_to([0.0, 1.0, 0.0], along.shape)
    v = np.cross(along, u)
    angle = 2 * np.pi * np.arange(3) / 3
    ring = radius * (
        np.cos(angle)[:, None] * u[:, None, :] + np.sin(angle)[:, None] * v[:, None, :]
    )
    vertices = np.concatenate([start[:, None] + ring, end[:, None] + ring], axis=1)
    sides = [(i, (i + 1) % 3, 3 + i) for i in range(3)]
    sides += [((i + 1) % 3, 3 + (i + 1) % 3, 3 + i) for i in range(3)]
    template = np.array([*sides, (0, 2, 1), (3, 4, 5)], dtype=np.int32)
    first = 6 * np.arange(len(start), dtype=np.int32)
    return vertices, (first[:, None, None] + template).reshape(-1, 3)
