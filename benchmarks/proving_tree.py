"""Paths from home for `reach_prover`: RRT-Connect (Kuffner and LaValle, ICRA 2000) as it stands."""

from __future__ import annotations

import numpy as np
from proving_world import Array, ProvingWorld, RobotKinematics

STRIDE, FINE = 0.5, 0.02
"""Longest edge of a random tree, and between two looks along it: of the joint that moves most
[rad]."""
TREES = 400
"""Samples of a random tree."""


class RandomTrees:
    """Plans in one scene."""

    def __init__(self, world: ProvingWorld, kinematics: RobotKinematics) -> None:
        self._world, self._kinematics = world, kinematics

    def connect(self, home: Array, goal: Array, rng: np.random.Generator) -> Array | None:
        """A path from home to a goal (n,), straight or by two random trees that grow towards each
        other."""
        if self._straight(home, goal):
            return np.array([home, goal])
        k = self._kinematics
        trees = [_Tree(home), _Tree(goal)]
        for turn in range(TREES):
            here, there = trees[turn % 2], trees[1 - turn % 2]
            node = self._extend(here, rng.uniform(k.lower, k.upper))
            if node is None:
                continue
            other: int | None = -1
            while other is not None:
                other = self._extend(there, here.q[node])
                if other is not None and np.abs(there.q[other] - here.q[node]).max() < 1e-9:
                    ways = [here.branch(node), there.branch(other)]
                    first, last = ways if turn % 2 == 0 else ways[::-1]
                    return np.concatenate([first[::-1], last[1:]])
        return None

    def _extend(self, tree: _Tree, towards: Array) -> int | None:
        near = int(np.abs(np.array(tree.q) - towards).max(axis=1).argmin())
        far = np.abs(towards - tree.q[near]).max()
        new = tree.q[near] + min(1.0, STRIDE / max(far, 1e-9)) * (towards - tree.q[near])
        if not self._straight(tree.q[near], new):
            return None
        return tree.add(new, near)

    def _straight(self, q: Array, after: Array) -> bool:
        count = int(np.ceil(np.abs(after - q).max() / FINE)) + 1
        return all(self._world.is_free(q + s * (after - q)) for s in np.linspace(1.0, 0.0, count))


class _Tree:
    def __init__(self, root: Array) -> None:
        self.q, self._before = [root], [-1]

    def add(self, q: Array, before: int) -> int:
        self.q.append(q)
        self._before.append(before)
        return len(self.q) - 1

    def branch(self, node: int) -> Array:
        """Configurations from a node to the root."""
        rows = []
        while node >= 0:
            rows.append(self.q[node])
            node = self._before[node]
        return np.array(rows)
