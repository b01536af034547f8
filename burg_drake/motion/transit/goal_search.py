"""The last resort on the way from home to a goal: trees that grow from the goals until one of them
meets the roadmap.

It is RRT-Connect (Kuffner and LaValle, ICRA 2000) with the roadmap as the other tree, which stays
as it is, and with many samples at a time, as the fast tier judges batches. Its budget is fixed, and
its samples follow from the goals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, rng_from
from burg_drake.motion.collision import EdgeChecker
from burg_drake.motion.transit.roadmap import Roadmap

ROUNDS = 24
"""Batches of samples before the search gives up."""
SAMPLES = 32
"""Samples in a batch."""
REACH = 0.4
"""Longest step of a tree [m of displacement]."""
SPREAD = 0.15
"""Standard deviation around nodes of the trees of half of the samples, in parts of a joint's
range; the other half is uniform."""
NEAREST = 3
"""Nodes of the roadmap that a new node is tried with."""


def search_from_goals(
    roadmap: Roadmap, edges: EdgeChecker, goals: Array, lower: Array, upper: Array
) -> tuple[int, Array] | None:
    """Looks for a way from home to any of (K, n) goals; see `HomeTree.connect`."""
    bounds = edges.proximity.bounds(goals)
    roots = np.flatnonzero(~bounds.blocked if edges.exact else bounds.likely_free)
    if not len(roots):
        return None
    rng = rng_from("burg_drake goal search", goals)
    # A goal that is not even likely free says that bounds are too loose around here to guess by.
    guess = bool(bounds.likely_free[roots].any())
    trees = _Trees(goals[roots], guess)
    for _ in range(ROUNDS):
        new = trees.grow(roadmap, edges, _samples(trees.q, lower, upper, rng))
        for node, entry in _connections(roadmap, edges, trees.q, new, guess):
            chain = trees.chain(node)
            corners = np.concatenate([roadmap.q[entry][None], trees.q[chain]])
            if edges.first_blocked(corners) is not None:
                continue
            path = roadmap.path(entry)
            if path is not None:
                return int(roots[chain[-1]]), np.concatenate([path, corners[1:]])
    return None


def _samples(q: Array, lower: Array, upper: Array, rng: np.random.Generator) -> Array:
    """Half uniform, half around nodes of the trees."""
    drawn = rng.uniform(lower, upper, (SAMPLES, len(lower)))
    around = q[rng.integers(len(q), size=SAMPLES // 2)]
    around = around + SPREAD * (upper - lower) * rng.standard_normal(around.shape)
    drawn[::2] = np.clip(around, lower, upper)
    return drawn


def _connections(
    roadmap: Roadmap, edges: EdgeChecker, q: Array, new: NDArray[np.intp], guess: bool
) -> list[tuple[int, int]]:
    """New nodes and nodes of the roadmap between which the screen finds a free segment, the
    shortest first."""
    if not len(new):
        return []
    entry = np.concatenate([roadmap.near(q[node], NEAREST) for node in new])
    node = np.repeat(new, len(entry) // len(new))
    screened = edges.screen(roadmap.q[entry], q[node])
    free = np.flatnonzero(edges.seem_free(screened, guess=guess))
    order = free[np.argsort(screened.length[free], kind="stable")]
    return [(int(node[k]), int(entry[k])) for k in order]


class _Trees:
    """Nodes that lead back to a goal.

    Attributes:
        q: (T, n) configurations, the goals first.
    """

    def __init__(self, goals: Array, guess: bool) -> None:
        self.q = goals
        self._guess = guess
        self._towards = np.full(len(goals), -1)

    def grow(self, roadmap: Roadmap, edges: EdgeChecker, samples: Array) -> NDArray[np.intp]:
        """Steps from the nearest nodes towards samples (S, n); indices of the new nodes."""
        offset = samples[:, None] - self.q
        distance = (np.abs(offset) * roadmap.scale).sum(axis=-1)
        nearest = distance.argmin(axis=1)
        rows = np.arange(len(samples))
        share = np.minimum(1.0, REACH / np.maximum(distance[rows, nearest], 1e-12))
        q_a = self.q[nearest]
        q_b = q_a + share[:, None] * offset[rows, nearest]
        free = edges.seem_free(edges.screen(q_a, q_b), guess=self._guess)
        self._towards = np.concatenate([self._towards, nearest[free]])
        self.q = np.concatenate([self.q, q_b[free]])
        return np.arange(len(self.q) - int(free.sum()), len(self.q))

    def chain(self, node: int) -> list[int]:
        """The nodes from one to its goal."""
        chain = [node]
        while self._towards[chain[-1]] >= 0:
            chain.append(int(self._towards[chain[-1]]))
        return chain
