"""Shorter ways through points of a way: deterministic, and never longer."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.sparse.csgraph import dijkstra

from burg_drake.core import Array
from burg_drake.motion.collision import EdgeChecker

POINTS = 10
"""Points along the way, beside its corners, between which shorter ways are looked for."""
ROUNDS = 2
"""How often that is repeated on what it has found."""
CORNER = 1e-9
"""What a corner counts as length [m], so that none is left on a straight line."""
GAIN = 1e-3
"""A round that shortens the way by a smaller part is the last one."""


def shortcut(edges: EdgeChecker, path: Array, scale: Array) -> Array:
    """Straightens a free way.

    Args:
        edges: judges segments.
        path: (M, n) its corners.
        scale: (n,) what a unit of each joint counts in the length of a segment, which is the norm.

    Returns:
        (L, n) corners of a free way with the same ends, at most as long as `path`.
    """
    known: dict[bytes, bool] = {}
    if len(path) > 2 and _is_free(edges, path[[0, -1]], known):
        return np.asarray(path[[0, -1]])
    for _ in range(ROUNDS if len(path) > 2 and _length(path, scale) > 0.0 else 0):
        other = _through_points(edges, _points(path, scale), scale, known)
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


def _is_free(edges: EdgeChecker, ends: Array, known: dict[bytes, bool]) -> bool:
    """Whether a segment (2, n) is free; one that is not so by the best guess is not looked at."""
    screened = edges.screen(ends[:1], ends[1:], fine=np.inf)
    free = bool(edges.seem_free(screened, guess=True)[0]) and edges.is_free(*ends)
    known[ends.tobytes()] = free
    return free


def _through_points(edges: EdgeChecker, q: Array, scale: Array, known: dict[bytes, bool]) -> Array:
    """The shortest way from the first to the last of points that follow one another on a free way.

    A few bounds say which segments are worth considering: those that are free by the best guess, as
    it takes hundreds of checks to be sure of others. Those that a way takes are judged.

    Args:
        edges: judges segments.
        q: (N, n) points.
        scale: see `shortcut`.
        known: verdicts on segments by the bytes of their ends; what is found is added.
    """
    first, second = np.triu_indices(len(q), 2)
    length = np.sqrt((((q[:, None] - q) * scale) ** 2).sum(axis=-1)) + CORNER
    allowed = np.eye(len(q), k=1, dtype=bool)
    screened = edges.screen(q[first], q[second], fine=np.inf)
    allowed[first, second] = edges.seem_free(screened, guess=True)
    free = np.eye(len(q), k=1, dtype=bool)
    for pair in zip(first.tolist(), second.tolist(), strict=True):
        verdict = known.get(q[list(pair)].tobytes())
        if verdict is not None:
            free[pair] = allowed[pair] = verdict
    while True:
        _, before = dijkstra(np.where(allowed, length, 0.0), indices=0, return_predecessors=True)
        chain = [len(q) - 1]
        while chain[-1] != 0:
            chain.append(int(before[chain[-1]]))
        chain.reverse()
        asked = [pair for pair in pairwise(chain) if not free[pair]]
        blocked = edges.first_blocked_each([q[list(pair)] for pair in asked])
        for pair, at in zip(asked, blocked, strict=True):
            free[pair] = allowed[pair] = known[q[list(pair)].tobytes()] = at is None
        if all(at is None for at in blocked):
            return np.asarray(q[chain])
