"""Bounds on the distance of the arm and its hand to the arm's own links."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, Indices, Single
from burg_drake.motion.ik import ArmLinks, LinkPoses
from burg_drake.motion.proximity.ball_tree import BallTrees
from burg_drake.motion.proximity.link_distance import LinkDistance
from burg_drake.motion.proximity.pair_table import JointGrid, PairTable, is_affordable, may_meet
from burg_drake.station.diagram import StationDiagram

Pair = tuple[int, int]
ClearanceTable = tuple[PairTable, tuple[Pair, ...]]

REFINED = 0.022
"""Below this lower bound [m] of two balls what is in them is compared."""
GLANCE = 2**9
"""Configurations whose pairs of bodies are looked at together: what fits a processor's caches."""
CHUNK = 2**9
"""Pairs of nodes that are compared together: what fits a processor's caches."""


def counted_pairs(
    plant: MultibodyPlant, inspector: SceneGraphInspector, bodies: Sequence[BodyIndex]
) -> list[tuple[BodyIndex, BodyIndex]]:
    """Pairs of bodies that Drake does not leave out of collision checks."""
    geometries = {
        body: plant.GetCollisionGeometriesForBody(plant.get_body(body)) for body in bodies
    }
    return [
        (a, b)
        for a, b in itertools.combinations(bodies, 2)
        if any(
            not inspector.CollisionFiltered(one, two)
            for one in geometries[a]
            for two in geometries[b]
        )
    ]


class SelfClearance:
    """The arm against itself.

    Args:
        trees: balls that cover the robot.
        pairs: numbers of bodies of the trees that are compared by them, the earlier one first.
        tables: of other pairs, which stand beside them.
        apart: pairs that are proven not to meet within the joints' limits.
    """

    def __init__(
        self,
        trees: BallTrees,
        pairs: Sequence[Pair],
        tables: Sequence[ClearanceTable] = (),
        apart: Sequence[Pair] = (),
    ) -> None:
        self._trees = trees
        self.pairs, self.tables, self.apart = tuple(pairs), tuple(tables), tuple(apart)
        self._one, self._two = np.array(self.pairs, dtype=np.intp).reshape(-1, 2).T
        radius = np.array([body.radius for body in trees.bodies])
        self._both = (radius[self._one] + radius[self._two]).astype(np.float32)[:, None]
        self._root = np.array([body.root for body in trees.bodies], dtype=np.intp)

    @classmethod
    def of(
        cls, station_diagram: StationDiagram, links: ArmLinks, trees: BallTrees, limits: Array
    ) -> SelfClearance:
        """Of all pairs that can meet within limits (n, 2) of the joints' positions [rad or m]."""
        inspector = station_diagram.scene_graph.model_inspector()
        bodies = [body.body for body in trees.bodies]
        counted = {
            frozenset(pair) for pair in counted_pairs(station_diagram.plant, inspector, bodies)
        }
        pairs = [
            (i, j)
            for i, j in itertools.combinations(range(len(bodies)), 2)
            if frozenset((bodies[i], bodies[j])) in counted
        ]
        tables, left = _tables(station_diagram, links, trees, limits, pairs)
        meeting = {*left, *(pair for _, several in tables for pair in several)}
        apart = [pair for pair in pairs if pair not in meeting]
        return cls(trees, left, tables, apart)

    def bounds(
        self, q: Array, poses: LinkPoses, centers: Single, wanted: NDArray[np.bool_]
    ) -> tuple[Single, Single]:
        """Lower and upper bounds (K,) [m].

        Args:
            q: (K, n) configurations.
            poses: theirs.
            centers: (3, B, K) places of the bodies' balls.
            wanted: (K,) of which configurations more is wanted than a glance at those balls.
        """
        lower = np.full(len(q), np.inf, dtype=np.float32)
        upper = np.full(len(q), np.inf, dtype=np.float32)
        for table, pairs in self.tables:
            low, up = table.bounds(q)
            np.minimum(lower, low, out=lower)
            np.minimum(upper, up, out=upper)
            doubtful = np.flatnonzero((low <= 0.0) & (upper >= 0.0) & wanted)
            which = np.tile(doubtful, len(pairs))
            one, two = np.repeat(self._root[np.array(pairs)].T, len(doubtful), axis=1)
            self._descend(poses, which, one, two, lower.copy(), upper)
        wanted = wanted & (upper >= 0.0)
        for start in range(0, len(q), GLANCE):
            part = slice(start, start + GLANCE)
            bound = _length(centers[:, self._one, part] - centers[:, self._two, part])
            bound -= self._both
            pair, which = np.nonzero((bound < REFINED) & wanted[part])
            bound[pair, which] = np.inf
            np.minimum(lower[part], bound.min(axis=0, initial=np.inf), out=lower[part])
            one, two = self._root[self._one[pair]], self._root[self._two[pair]]
            self._descend(poses, which + start, one, two, lower, upper)
        return lower, upper

    def _descend(
        self,
        poses: LinkPoses,
        which: Indices,
        one: Indices,
        two: Indices,
        lower: Single,
        upper: Single,
    ) -> None:
        """Brings in what nodes `one` and `two` of the trees are apart in configurations `which`."""
        trees = self._trees
        for start in range(0, len(which), CHUNK):
            part = slice(start, start + CHUNK)
            k, a, b = which[part], one[part], two[part]
            gap = trees.placed(a, poses, k)[:, :, None] - trees.placed(b, poses, k)[:, None]
            distance = _length(gap)
            bound = distance - (trees.outer[:, a][:, None] + trees.outer[:, b][None])
            below = trees.child[0, a[0]] >= 0
            if below:
                i, j, at = np.nonzero(bound < REFINED)
                bound[i, j, at] = np.inf
                self._descend(
                    poses, k[at], trees.child[i, a[at]], trees.child[j, b[at]], lower, upper
                )
            else:
                distance -= trees.inner[:, a][:, None] + trees.inner[:, b][None]
                np.minimum.at(upper, k, distance.min(axis=(0, 1)))
            np.minimum.at(lower, k, bound.min(axis=(0, 1)))


def _tables(
    station_diagram: StationDiagram,
    links: ArmLinks,
    trees: BallTrees,
    limits: Array,
    pairs: Sequence[Pair],
) -> tuple[list[ClearanceTable], list[Pair]]:
    """Tables of pairs with few joints between them, and the pairs that there is no table of.

    Of links that cannot meet wherever these joints stand nothing is kept.
    """
    close: dict[tuple[int, int], list[int]] = {}
    left = []
    for i, j in pairs:
        a, b = trees.bodies[i], trees.bodies[j]
        grid = JointGrid.over(links, a, [b], limits)
        if grid is None:
            left.append((i, j))
        elif may_meet(grid, LinkDistance(station_diagram, links, a.body, [b.body])):
            close.setdefault((i, b.frame), []).append(j)
    tables = []
    for (i, _), several in close.items():
        a, others = trees.bodies[i], [trees.bodies[j] for j in several]
        grid = JointGrid.over(links, a, others, limits)
        assert grid is not None
        distance = LinkDistance(station_diagram, links, a.body, [b.body for b in others])
        if is_affordable(grid, distance):
            tables.append((PairTable.of(grid, distance), tuple((i, j) for j in several)))
        else:
            left += [(i, j) for j in several]
    return tables, left


def _length(v: Single) -> Single:
    x, y, z = v
    return np.asarray(np.sqrt(x * x + y * y + z * z))
