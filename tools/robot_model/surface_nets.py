"""Meshes the surface of a field: naive surface nets, then Newton steps onto the surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from tools.robot_model.fields import Field, gradient

NEWTON_STEPS = 4


def surface_net(
    field: Field, low: Sequence[float], high: Sequence[float], cell: float
) -> tuple[np.ndarray, np.ndarray]:
    """Closed triangle mesh of a field: one vertex a cell that the surface crosses.

    Args:
        field: the solid; must lie inside of the bounds.
        low, high: bounds (3,) [m].
        cell: edge length of the sampling grid [m].

    Returns:
        Vertices (V, 3) [m] and triangles (F, 3), counter-clockwise from outside.
    """
    origin = np.asarray(low, float)
    count = np.ceil((np.asarray(high, float) - origin) / cell).astype(int) + 1
    axes = [origin[i] + cell * np.arange(count[i]) for i in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    value = field(points.reshape(-1, 3)).reshape(count)
    inside = value < 0.0

    total = np.zeros((*(count - 1), 3))
    hits = np.zeros(count - 1)
    edges = []
    for axis in range(3):
        step, u, w = np.roll(np.eye(3, dtype=int), -axis, axis=0)
        before = tuple(slice(None, -1) if i == axis else slice(None) for i in range(3))
        after = tuple(slice(1, None) if i == axis else slice(None) for i in range(3))
        crossed = np.argwhere(inside[before] != inside[after])
        v0, v1 = value[tuple(crossed.T)], value[tuple((crossed + step).T)]
        where = origin + cell * (crossed + (v0 / (v0 - v1))[:, None] * step)
        around = [crossed, crossed - u, crossed - u - w, crossed - w]
        for cells in around:
            np.add.at(total, tuple(cells.T), where)
            np.add.at(hits, tuple(cells.T), 1.0)
        edges.append((around, v0 < 0.0))

    active = hits > 0
    number = np.cumsum(active.ravel()).reshape(active.shape) - 1
    quads = []
    for around, outward in edges:
        quad = np.stack([number[tuple(cells.T)] for cells in around], axis=1)
        quads.append(np.where(outward[:, None], quad, quad[:, ::-1]))
    quad = np.vstack(quads)
    vertices = _projected(field, total[active] / hits[active][:, None], reach=cell)
    return vertices, np.vstack([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])


def _projected(field: Field, points: np.ndarray, reach: float) -> np.ndarray:
    """The points moved onto the surface, where it is no farther than `reach` [m]."""
    moved = points.copy()
    for _ in range(NEWTON_STEPS):
        slope = gradient(field, moved)
        square = np.maximum((slope**2).sum(axis=1), 0.05)
        moved = moved - (field(moved) / square)[:, None] * slope
    far = np.linalg.norm(moved - points, axis=1) > reach
    moved[far] = points[far]
    return moved
