"""What a station's cameras see of the board, by the pinhole model and without a renderer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, inverse, transform_points
from burg_drake.scene.document import Board
from burg_drake.station.document.station_document import Camera, Obstacle, Station

GRID = 61
"""Points along each side of the board."""
SLACK = 1e-6
"""What touches a ray at its very end does not hide it (share of the ray)."""


def seen_share(camera: Camera, station: Station, board: Board) -> float:
    """Share of the board that a camera sees past the station's obstacles; neither the robot nor
    objects count."""
    p_WQ = board_points(station, board)
    seen = in_view(camera, p_WQ)
    p_WC = np.array(camera.X_WC.translation)
    for box in station.document.background.values():
        seen &= ~crosses(box, p_WC, p_WQ)
    return float(seen.mean())


def board_points(station: Station, board: Board) -> Array:
    """(N, 3) points all over the board, edges included, in the world [m]."""
    x, y = (np.linspace(0.0, extent, GRID) for extent in board.size)
    p_SQ = np.stack([*np.meshgrid(x, y), np.zeros((GRID, GRID))], axis=-1).reshape(-1, 3)
    return transform_points(station.document.X_WS.matrix(), p_SQ)


def in_view(camera: Camera, p_WQ: Array) -> NDArray[np.bool_]:
    """(N,) whether points (N, 3) are in a camera's image and range of depths."""
    p_CQ = transform_points(inverse(camera.X_WC.matrix()), p_WQ)
    near, far = camera.depth_range
    depth = p_CQ[:, 2]
    ahead = (near <= depth) & (depth <= far)
    pixel = p_CQ[:, :2] / np.where(ahead, depth, 1.0)[:, None] * camera.focal
    pixel += camera.principal_point
    size = np.array([camera.width, camera.height])
    inside = (pixel >= -0.5) & (pixel <= size - 0.5)  # pixel centres are at integers
    return np.asarray(ahead & inside.all(axis=1))


def crosses(box: Obstacle, p_WA: Array, p_WQ: Array) -> NDArray[np.bool_]:
    """(N,) whether the straight lines from a point A (3,) to points (N, 3) go through a box, by
    where they are between each pair of its faces (Kay and Kajiya, SIGGRAPH 1986)."""
    X_BW = inverse(box.X_WB.matrix())
    p_BA = transform_points(X_BW, p_WA[None])[0]
    ray = transform_points(X_BW, p_WQ) - p_BA
    half = np.array(box.size) / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(-half - p_BA) / ray, (half - p_BA) / ray])
    # Along a face there is no crossing: the line is between the two all the way, or never.
    level = ray == 0.0
    ends = np.where(level, np.where(np.abs(p_BA) < half, [[[-np.inf]], [[np.inf]]], np.inf), ends)
    enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    return np.asarray((enter < leave) & (leave > 0.0) & (enter < 1.0 - SLACK))


def frustum(camera: Camera, depth: float) -> Array:
    """(4, 3) corners of a camera's image, seen at a depth [m], in the world, around the image from
    its upper left."""
    w, h = camera.width - 0.5, camera.height - 0.5
    corners = np.array([[-0.5, -0.5], [w, -0.5], [w, h], [-0.5, h]])
    rays = (corners - camera.principal_point) / camera.focal
    p_CQ = depth * np.column_stack([rays, np.ones(4)])
    return transform_points(camera.X_WC.matrix(), p_CQ)
