"""Shorter ways through points of a way: deterministic, and never longer."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.sparse.csgraph import dijkstra

from burg_drake.core.frames import Array
from burg_drake.motion.edges import Edges

POINTS = 10
"""Points along the way, beside its corners, between which shorter ways are looked for."""
ROUNDS = 2
"""How often that is repeated on what it has found."""
CORNER = 1e-9
"""What a corner counts as length [m], so that none is left on a straight line."""
GAIN = 1e-3
"""A round that shortens the way by a smaller part is the last one."""


def shortcut(edges: Edges, path: Array, scale: Array) -> Array:
    """Straightens a free way.

    Args:
        edges: judges segments.
        path: (M, n) its corners.
        scale: (n,) what a unit of each joint counts in the length of a segment, which is the norm.

    Returns:
        (L, n) corners of a free way with the same ends, at most as long as `path`.
    """
    if len(path) > 2 and edges.is_free(path[0], path[-1]):
        return np.asarray(path[[0, -1]])
    for _ in range(ROUNDS if len(path) > 2 and _length(path, scale) > 0.0 else 0):
        other = _through_points(edges, _points(path, scale), scale)
        gain = _length(path, scale) - _length(other, scale)
        if gain >= 0.0:
            path = other
        if gain <= GAIN * _length(path, scale):
            break
    return path


def _length(path: Array, scale: Array) -> float:
    return float(np.sqrt((np.diff(path * scale, axis=0) ** 2).sum(axis=1)).sum())


def _points(path: Array, scale: Array) -> Array:
    """The corners and points at even distances between them."""
    steps = np.sqrt((np.diff(path * scale, axis=0) ** 2).sum(axis=1))
    at = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.unique(np.concatenate([at, np.linspace(0.0, at[-1], POINTS)]))
    return np.column_stack([np.interp(wanted, at, joint) for joint in path.T])


def _through_points(edges: Edges, q: Array, scale: Array) -> Array:
    """The shortest way from the first to the last of points that follow one another on a free way.

    A few bounds say which segments are worth considering; those that a way takes are judged.
    """
    first, second = np.triu_indices(len(q), 2)
    length = np.sqrt((((q[:, None] - q) * scale) ** 2).sum(axis=-1)) + CORNER
    allowed = np.eye(len(q), k=1, dtype=bool)
    allowed[first, second] = edges.seem_free(edges.screen(q[first], q[second], fine=np.inf))
    free = np.eye(len(q), k=1, dtype=bool)
    while True:
        _, before = dijkstra(np.where(allowed, length, 0.0), indices=0, return_predecessors=True)
        chain = [len(q) - 1]
        while chain[-1] != 0:
            chain.append(int(before[chain[-1]]))
        chain.reverse()
        asked = [pair for pair in pairwise(chain) if not free[pair]]
        blocked = edges.first_blocked_each([q[list(pair)] for pair in asked])
        for pair, at in zip(asked, blocked, strict=True):
            free[pair] = allowed[pair] = at is None
        if all(at is None for at in blocked):
            return np.asarray(q[chain])
