"""Free ways from the home posture to postures of the arm, with work shared between them.

A roadmap is laid out once and never changes with what is asked, so that an answer does not depend
on the ones before it. Goals that no segment joins to it get a search of their own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.motion.collision import EdgeChecker
from burg_drake.motion.transit.goal_search import search_from_goals
from burg_drake.motion.transit.roadmap import Roadmap
from burg_drake.motion.transit.shortcutting import shortcut

NODES = 600
"""Configurations of the roadmap."""
FIRST = 2
"""Nearest nodes of the roadmap that a goal is tried with at first."""
THEN = 8
"""Further ones, beside home, if none of those leads there."""


class HomeTree:
    """Leads from home to goals.

    Attributes:
        edges: judges segments.
        roadmap: configurations that home leads to.
    """

    def __init__(
        self,
        edges: EdgeChecker,
        home: Array,
        lower: Array,
        upper: Array,
        *,
        focus: Array | None = None,
        seed: object = "",
        nodes: int = NODES,
    ) -> None:
        """Lays the roadmap out; for the arguments see there."""
        self.edges = edges
        self.roadmap = Roadmap(edges, home, lower, upper, focus=focus, seed=seed, nodes=nodes)
        self._lower, self._upper = lower, upper

    def connect(self, goals: Array) -> tuple[int, Array] | None:
        """A free way to one of several goals.

        Args:
            goals: (K, n) postures in order of preference.

        Returns:
            Index of the first goal that a segment from home or from a near node of the roadmap
            leads to, else of one that a search has reached, and (M, n) the corners of the way, home
            first; None if nothing was found.
        """
        goals = np.asarray(goals, dtype=float)
        for index in range(len(goals)):
            (path,) = self._by_segments(goals[index : index + 1])
            if path is not None:
                return index, path
        return self._search(goals)

    def connect_each(self, goals: Array) -> list[Array | None]:
        """A free way to each of several goals (K, n), with few batches of the fast tier; what is
        found for one does not depend on the others. See `connect`."""
        goals = np.asarray(goals, dtype=float)
        paths = self._by_segments(goals)
        for index in (k for k, path in enumerate(paths) if path is None):
            found = self._search(goals[index : index + 1])
            paths[index] = None if found is None else found[1]
        return paths

    def _search(self, goals: Array) -> tuple[int, Array] | None:
        return search_from_goals(self.roadmap, self.edges, goals, self._lower, self._upper)

    def _by_segments(self, goals: Array) -> list[Array | None]:
        """Ways that end with a segment from home or from a near node, for each goal (K, n)."""
        near = [self.roadmap.near(goal, FIRST + THEN) for goal in goals]
        paths = self._over(goals, [nodes[:FIRST] for nodes in near])
        left = [k for k, way in enumerate(paths) if way is None]
        rest = [np.append(nodes[FIRST:][nodes[FIRST:] != 0], 0) for nodes in near]
        for k, path in zip(left, self._over(goals[left], [rest[k] for k in left]), strict=True):
            paths[k] = path
        return paths

    def _over(self, goals: Array, nodes: list[NDArray[np.intp]]) -> list[Array | None]:
        """Ways over some nodes, for each goal: the shortest segment first among the proven ones."""
        if not len(goals):
            return []
        counts = [len(some) for some in nodes]
        q_a = self.roadmap.q[np.concatenate(nodes)]
        q_b = np.repeat(goals, counts, axis=0)
        screened = self.edges.screen(q_a, q_b)
        order = np.lexsort((screened.length, ~screened.proven))
        owner = np.repeat(np.arange(len(goals)), counts)[order]
        node = np.concatenate(nodes)
        goals_first = np.unique(owner, return_index=True)[1]
        self.roadmap.check_ahead(node[order[goals_first]])
        paths: list[Array | None] = []
        for k, goal in enumerate(goals):
            confirmed = (
                self.roadmap.path(int(node[edge]))
                for edge in order[owner == k]
                if self.edges.confirm(q_a, q_b, screened, edge)
            )
            path = next((way for way in confirmed if way is not None), None)
            paths.append(None if path is None else np.concatenate([path, goal[None]]))
        return paths

    def shortcut(self, path: Array) -> Array:
        """A way with the same ends that is no longer; see `motion.transit.shortcutting`."""
        return shortcut(self.edges, path, self.roadmap.scale)
