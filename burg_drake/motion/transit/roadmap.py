"""A graph of arm configurations around the home posture, and shortest ways in it from there.

It is laid out once, by a few bounds of the fast tier per edge, and kept in the user's cache. An
edge is judged when a way first leads over it (Bohlin and Kavraki, "Path planning using lazy PRM",
ICRA 2000), and the verdict is kept. The answer on a node is its shortest way of free edges, whoever
has asked before.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from burg_drake.core import Array, Arrays, cached, content_hash, rng_from
from burg_drake.motion.collision import EdgeChecker
from burg_drake.motion.transit.object_postures import random_postures

NEIGHBOURS = 6
"""Nearest nodes that a node is connected with, where the way is free."""
CLEARANCE = 0.01
"""Lower bound of the clearance of every node but home [m]; less where home itself has less, by
`BELOW`."""
BELOW = 1e-3
"""See `CLEARANCE` [m]."""

POSTURES = 64
"""Random postures over which displacements are averaged."""
TURN = 1e-3
"""Of a joint, to see how far it moves the arm [rad or m]."""


class Roadmap:
    """Configurations around home, and segments between them that nothing speaks against yet.

    Attributes:
        q: (N, n) configurations, home first.
        scale: (n,) mean displacement per unit of each joint [m/rad or 1].
    """

    def __init__(
        self,
        edges: EdgeChecker,
        home: Array,
        lower: Array,
        upper: Array,
        *,
        focus: Array | None,
        seed: object,
        nodes: int,
    ) -> None:
        """Lays the graph out.

        Args:
            edges: judges segments.
            home: (n,) the posture that all ways begin at.
            lower, upper: (n,) joint limits [rad or m].
            focus: (F, n) postures like the goals to come, for two thirds of the nodes.
            seed: content that the samples follow from, see `core.content.rng_from`.
            nodes: how many configurations to look for; those that home does not lead to are
                dropped.
        """
        self._edges = edges
        near = np.empty((0, len(home))) if focus is None else focus
        asked = (edges.content, home, lower, upper, near, seed, nodes)
        arrays = cached(
            "roadmap",
            content_hash(*asked),
            lambda: _laid_out(edges, home, lower, upper, near, seed, nodes),
        )
        self.q, self.scale = arrays["q"], arrays["scale"]
        self._ends, self._length = arrays["ends"], arrays["length"]
        self._free: set[tuple[int, int]] = set()
        self._blocked: set[tuple[int, int]] = set()
        self._search()

    def _search(self) -> None:
        self.distance, self._before = _shortest(self._ends, self._length, len(self.q))

    def near(self, q: Array, count: int) -> NDArray[np.intp]:
        """The nodes with the least displacement to `q` (n,), nearest first."""
        distance = (np.abs(self.q - q) * self.scale).sum(axis=1)
        return np.argsort(distance, kind="stable")[:count]

    def check_ahead(self, nodes: NDArray[np.intp]) -> None:
        """Judges the edges of the ways that `path` will look at first, with one batch of the fast
        tier; the verdicts are the same."""
        reached = nodes[np.isfinite(self.distance[nodes])]
        paths = (pairwise(self._chain(int(node))) for node in dict.fromkeys(reached.tolist()))
        asked = {(min(edge), max(edge)) for path in paths for edge in path}
        new = np.array(sorted(asked - self._free - self._blocked), dtype=np.intp).reshape(-1, 2)
        q_a, q_b = self.q[new[:, 0]], self.q[new[:, 1]]
        screened = self._edges.screen(q_a, q_b)
        for k, (first, second) in enumerate(new.tolist()):
            free = self._edges.confirm(q_a, q_b, screened, k)
            (self._free if free else self._blocked).add((first, second))

    def path(self, node: int) -> Array | None:
        """The shortest free way to a node: (M, n) corners from home, or None."""
        while np.isfinite(self.distance[node]):
            chain = self._chain(node)
            refuted = next((e for e in pairwise(chain) if not self._is_free(e)), None)
            if refuted is None:
                return np.asarray(self.q[chain])
            keep = (self._ends != sorted(refuted)).any(axis=1)
            self._ends, self._length = self._ends[keep], self._length[keep]
            self._search()
        return None

    def _chain(self, node: int) -> list[int]:
        """The nodes from home to one, by what is known."""
        chain = [node]
        while chain[-1] != 0:
            chain.append(int(self._before[chain[-1]]))
        return chain[::-1]

    def _is_free(self, edge: tuple[int, int]) -> bool:
        first, second = sorted(edge)  # so that the verdict is that of the edge, not of a direction
        if (first, second) not in self._free and (first, second) not in self._blocked:
            free = self._edges.is_free(self.q[first], self.q[second])
            (self._free if free else self._blocked).add((first, second))
        return (first, second) in self._free


def _laid_out(
    edges: EdgeChecker,
    home: Array,
    lower: Array,
    upper: Array,
    focus: Array,
    seed: object,
    nodes: int,
) -> Arrays:
    """Nodes and edges of a roadmap; for the arguments see there."""
    rng = rng_from("burg_drake home tree", seed, nodes)
    scale = _levers(edges, rng.uniform(lower, upper, (POSTURES, len(home))))
    at_home = float(edges.proximity.bounds(home[None]).lower[0])
    clearance = min(CLEARANCE, at_home - BELOW)
    wide = random_postures(home, lower, upper, 2 * nodes, rng)
    near = _clear(edges, focus, 2 * nodes // 3, clearance)
    q = np.concatenate([home[None], near, _clear(edges, wide, nodes - len(near), clearance)])
    ends, length = _connect(edges, q, scale)
    reached = np.isfinite(_shortest(ends, length, len(q))[0])
    number = np.cumsum(reached) - 1
    keep = reached[ends[:, 0]]
    kept_ends = {"ends": number[ends[keep]], "length": length[keep]}
    return {"q": q[reached], "scale": scale, **kept_ends}


def _clear(edges: EdgeChecker, q: Array, count: int, clearance: float) -> Array:
    """The first `count` configurations with clearance."""
    q = q[: 3 * count]
    return q[edges.proximity.bounds(q).lower > clearance][:count]


def _connect(edges: EdgeChecker, q: Array, scale: Array) -> tuple[NDArray[np.intp], Array]:
    """(E, 2) pairs of near nodes that seem to be connected, and the displacements [m]."""
    scaled = q * scale
    ranks = np.arange(1, min(NEIGHBOURS + 1, len(q)) + 1)
    _, near = cKDTree(scaled).query(scaled, k=ranks, p=1.0)
    pairs = np.stack([np.repeat(np.arange(len(q)), near.shape[1]), near.ravel()], axis=1)
    pairs = np.unique(np.sort(pairs[pairs[:, 0] != pairs[:, 1]], axis=1), axis=0)
    screened = edges.screen(q[pairs[:, 0]], q[pairs[:, 1]], fine=np.inf)
    seems = edges.seem_free(screened)
    return pairs[seems], screened.length[seems]


def _levers(edges: EdgeChecker, q: Array) -> Array:
    """(n,) displacement per unit of each joint, the mean over postures (P, n)."""
    q_a = np.repeat(q, q.shape[1], axis=0)
    q_b = q_a + TURN * np.tile(np.eye(q.shape[1]), (len(q), 1))
    moved = edges.proximity.displacement(q_a, q_b).reshape(len(q), -1)
    return np.asarray(moved.mean(axis=0) / TURN)


def _shortest(ends: NDArray[np.intp], length: Array, nodes: int) -> tuple[Array, NDArray[np.int32]]:
    """(N,) distances from node 0, infinite where no way leads, and the nodes before."""
    graph = csr_matrix((length, (ends[:, 0], ends[:, 1])), shape=(nodes, nodes))
    distance, before = dijkstra(graph, directed=False, indices=0, return_predecessors=True)
    return distance, before
