"""Grasps as small grippers, one mesh an outcome: thousands of them cost a browser nothing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Meshcat, Rgba

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, transform_points
from burg_drake.core.outcome import Outcome
from burg_drake.station.hand import Hand
from burg_drake.visualization.palette import group_of

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
    meshcat: Meshcat,
    X_WG: ArrayLike,
    hand: Hand,
    outcomes: Sequence[Outcome | None] | None = None,
    width: ArrayLike | None = None,
) -> Counter[Outcome | None]:
    """Draws grasps, coloured by outcome, in the place of those drawn before.

    Args:
        meshcat: where to draw, below `/drake/grasps`, one path an outcome.
        X_WG: (N, 4, 4) grasps in the world.
        hand: gives the opening at which grasps of unknown width are drawn.
        outcomes: (N,); None, or entries of None, for grasps that nobody judged.
        width: (N,) distance between the pads [m]; NaN where unknown.

    Returns:
        Number of grasps drawn by outcome.

    Raises:
        InvalidInputError: the lengths differ.
    """
    poses = np.asarray(X_WG, dtype=float).reshape(-1, 4, 4)
    n = len(poses)
    verdicts = [None] * n if outcomes is None else list(outcomes)
    if len(verdicts) != n:
        raise InvalidInputError(f"{len(verdicts)} outcomes for {n} grasps; give one each")
    widths = np.array(np.broadcast_to(np.nan if width is None else width, (n,)), dtype=float)
    widths = np.where(np.isfinite(widths), widths, hand.opening[1])
    meshcat.Delete(GRASPS_PATH)
    counts = Counter(verdicts)
    for outcome in counts:
        member = np.array([v is outcome for v in verdicts])
        rgba = group_of(outcome).rgba
        radius = BAR_RADIUS if rgba[3] == 1.0 else FAINT_BAR_RADIUS
        vertices, faces = grasp_triangles(poses[member], widths[member], radius)
        meshcat.SetTriangleMesh(
            grasp_path(outcome),
            vertices,
            faces,
            Rgba(*rgba),
        )
    return counts


def grasp_path(outcome: Outcome | None) -> str:
    """Where in Meshcat's tree the grasps with an outcome are."""
    return f"{GRASPS_PATH}/{outcome or 'not_judged'}"


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
