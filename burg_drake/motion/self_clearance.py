"""Bounds on the distances of the arm and its hand from the arm's own links.

Distances between links with one or two joints between them are tables over these joints. All
other pairs are compared by their trees of balls.

A table holds the signed distance of the collision geometry at the centres of cells. In between,
levers bound the distance: while a joint moves, no point of one link moves farther relative to the
other link than the joint's step times the lever.

Distances come from `geometry`, as Drake's are wrong by centimetres for some boxes with parallel
edges (drake 1.51).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    GeometryId,
    Mesh,
    SceneGraphInspector,
    Sphere,
)
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, Indices, Single, transform_points
from burg_drake.geometry import Poses, ShapeBatch, shape_distances
from burg_drake.motion.arm_links import ArmLinks, LinkPoses
from burg_drake.motion.ball_tree import (
    BallTrees,
    BodyBalls,
    unsupported_shape_error,
)
from burg_drake.station import StationDiagram, hull_vertices


@dataclass(frozen=True, eq=False)
class _Core:
    """A shape as the Minkowski sum of a polytope, a disc and a ball, in its own frame.

    Attributes:
        vertices: (V, 3) [m].
        disc: radius of the disc across z [m].
        ball: radius of the ball [m].
    """

    vertices: Array
    disc: float = 0.0
    ball: float = 0.0


class LinkDistance:
    """The distance of one body of the robot from others that are fixed in one frame of the arm."""

    def __init__(
        self,
        station_diagram: StationDiagram,
        links: ArmLinks,
        body: BodyIndex,
        others: Sequence[BodyIndex],
    ) -> None:
        """Reads the collision geometry of the bodies.

        Raises:
            InvalidInputError: a geometry has an unsupported shape.
        """
        self._links = links
        self._joints = tuple(range(links.frame_of[body], links.frame_of[others[0]]))
        self._one = _cores(station_diagram, links, others)
        self._other = _cores(station_diagram, links, [body])
        pairs = np.indices((len(self._one.ball), len(self._other.ball))).reshape(2, -1)
        self._shape, self._piece = pairs
        self._balls = self._one.ball[self._shape] + self._other.ball[self._piece]

    def at(self, positions: Array, ceiling: float) -> Array:
        """Distances [m].

        Args:
            positions: (C, m) positions of the joints between the bodies [rad or m].
            ceiling: larger distances may be returned as infinite [m].

        Returns:
            (C,) distances. For bodies that overlap it is 0 or less, and the overlap is at least as
            deep.
        """
        size = max(1, 2**16 // self.pairs)  # bounds the memory
        starts = range(0, len(positions), size)
        found = [self._distances_at(positions[start : start + size], ceiling) for start in starts]
        return np.concatenate([np.empty(0), *found])

    @property
    def pairs(self) -> int:
        """Number of pairs of shapes that are compared in each configuration."""
        return len(self._balls)

    def _distances_at(self, positions: Array, ceiling: float) -> Array:
        X = Poses.of(self._links.relative_poses(self._joints, positions))
        pair = np.tile(np.arange(self.pairs), len(positions))
        which = np.repeat(np.arange(len(positions)), self.pairs)
        core_distances = shape_distances(
            replace(self._one, ball=np.zeros_like(self._one.ball)),
            self._shape[pair],
            replace(self._other, ball=np.zeros_like(self._other.ball)),
            self._piece[pair],
            X[which],
            ceiling + self._balls[pair],
        )
        found = core_distances - self._balls[pair]
        return np.asarray(found.reshape(len(positions), self.pairs).min(axis=1))


def _cores(
    station_diagram: StationDiagram, links: ArmLinks, bodies: Sequence[BodyIndex]
) -> ShapeBatch:
    """The collision geometry of bodies, in the arm's frame."""
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    cores, poses = [], []
    for body in bodies:
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(body)):
            cores.append(_core(inspector, geometry))
            poses.append(links.X_FB[body] @ inspector.GetPoseInFrame(geometry).GetAsMatrix4())
    vertices = [transform_points(X, core.vertices) for X, core in zip(poses, cores, strict=True)]
    return ShapeBatch.from_vertices(
        vertices,
        np.array(poses),
        center=np.array([v.mean(axis=0) for v in vertices]),
        disc=np.array([core.disc for core in cores]),
        ball=np.array([core.ball for core in cores]),
    )


def _core(inspector: SceneGraphInspector, geometry: GeometryId) -> _Core:
    shape = inspector.GetShape(geometry)
    match shape:
        case Sphere():
            return _Core(np.zeros((1, 3)), ball=shape.radius())
        case Capsule():
            return _Core(_segment_ends(shape.length()), ball=shape.radius())
        case Cylinder():
            return _Core(_segment_ends(shape.length()), disc=shape.radius())
        case Box():
            signs = np.indices((2, 2, 2)).reshape(3, -1).T - 0.5
            return _Core(signs * shape.size())
        case Convex() | Mesh():
            return _Core(hull_vertices(shape))
    raise unsupported_shape_error(inspector, geometry)


def _segment_ends(length: float) -> Array:
    return np.array([(0.0, 0.0, -length / 2), (0.0, 0.0, length / 2)])


class Tables:
    """Size and accuracy of the tables of distances between links."""

    max_joints = 2  # Joints between the links of a table.
    cell_angle = np.deg2rad(3.0)  # Radians. Largest size of the smallest cells.
    cell_length = 6e-3  # Metres. Largest size of the smallest cells of prismatic joints.
    levels = 4  # Largest number of halvings of the largest cells.
    extra_levels = 2  # Further halvings, to decide whether links can meet.
    max_cells = 200_000  # Cells of a table. With more there is none.
    max_distances = 500_000  # Distances of shapes for a table; some seconds. With more: none.
    known_distance = 0.03  # Metres. Lower bounds of larger distances are about this value.
    relative_error = 0.5  # Ratio of uncertainty to distance below which cells are not halved.
    depth_margin = 0.02  # Metres that an overlap may be deeper than computed.
    accuracy = 5e-5  # Metres. Above the errors of distances, Drake's included (3e-5 m).


@dataclass(frozen=True, eq=False)
class JointGrid:
    """Cells over the range of m joints.

    Attributes:
        joints: (m,) their indices.
        low, step: (m,) start of the first cell and size of the cells [rad or m].
        count: (m,) numbers of cells.
        whole: (m,) whether the cells cover a whole turn; positions then count modulo a turn.
        lever: (m,) largest motion of one link relative to the other per unit of the joint [m/rad,
            or 1].
    """

    joints: tuple[int, ...]
    low: Array
    step: Array
    count: Indices
    whole: tuple[bool, ...]
    lever: Array

    @classmethod
    def over(
        cls, links: ArmLinks, a: BodyBalls, others: Sequence[BodyBalls], limits: Array
    ) -> JointGrid | None:
        """The grid for a body and others, all fixed in one frame beyond it; None if there are too
        many joints between them, or their range is too large.

        Args:
            links: the arm.
            a, others: the bodies.
            limits: (n, 2) limits of the joints' positions [rad or m].
        """
        joints = tuple(range(a.frame, others[0].frame))
        if len(joints) > Tables.max_joints:
            return None
        turns = np.array([links.turns[i] for i in joints], dtype=bool)
        low, high = limits[list(joints)].reshape(-1, 2).T
        whole = turns & ~(high - low < 2.0 * np.pi)
        low, high = np.where(whole, -np.pi, low), np.where(whole, np.pi, high)
        finest = np.where(turns, Tables.cell_angle, Tables.cell_length)
        if not np.isfinite(high - low).all():
            return None
        count = (
            np.ceil((high - low) / (finest * 2**Tables.levels) - 1e-9).astype(int).clip(1)
            * 2**Tables.levels
        )
        if np.prod(count) > Tables.max_cells:
            return None
        lever = np.max([_levers(links, a, b, joints, limits) for b in others], axis=0)
        return cls(joints, low, (high - low) / count, count, tuple(whole.tolist()), lever)

    def centers(self, cells: Indices, level: int) -> Array:
        """(C, m) centres of cells (C, m) that are 2^level times the smallest ones [rad or m]."""
        return np.asarray(self.low + (cells + 0.5) * (self.step * 2**level))

    def finest_cells(self, cells: Indices, level: int) -> tuple[Indices, Array]:
        """(C, F) numbers of the smallest cells in larger cells (C, m), and (F,) largest motion of
        the link between the centres of the two [m]."""
        part = _all_cells([2**level] * len(self.joints))
        inner = cells[:, None] * 2**level + part
        number = np.zeros(inner.shape[:2], dtype=int)
        for axis, count in enumerate(self.count):
            number = number * count + inner[..., axis]
        return number, np.abs(part + 0.5 - 2**level / 2) @ (self.step * self.lever)


@dataclass(frozen=True, eq=False)
class PairTable:
    """Bounds on the distance of a body from others.

    Attributes:
        grid: the cells.
        lower, upper: (cells,) bounds at the centres of the smallest cells [m].
    """

    grid: JointGrid
    lower: Single
    upper: Single

    @classmethod
    def of(cls, grid: JointGrid, distance: LinkDistance) -> PairTable:
        """Measures the distances."""
        lower, upper = np.empty((2, int(np.prod(grid.count))))
        cells = _all_cells(grid.count // 2**Tables.levels)
        for level in reversed(range(Tables.levels + 1)):
            slack = float(grid.step @ grid.lever) * 2**level / 2
            ceiling = Tables.known_distance + slack
            found = distance.at(grid.centers(cells, level), ceiling)
            inside = found + slack < -Tables.accuracy
            done = (
                (slack <= Tables.relative_error * found)
                | (found >= ceiling)
                | inside
                | (level == 0)
            )
            number, reach = grid.finest_cells(cells[done], level)
            at = found[done, None]
            lower[number] = (
                np.where(at > 0.0, np.minimum(at, ceiling), at - Tables.depth_margin)
                - reach
                - Tables.accuracy
            )
            upper[number] = at + reach + Tables.accuracy
            cells = _halve_cells(cells[~done])
        return cls(grid, lower.astype(np.float32), upper.astype(np.float32))

    def bounds(self, q: Array) -> tuple[Single, Single]:
        """Lower and upper bounds (K,) [m] at arm positions `q` (K, n)."""
        grid = self.grid
        number = np.zeros(len(q), dtype=np.intp)
        shift = np.zeros(len(q))
        for axis, joint in enumerate(grid.joints):
            at = (q[:, joint] - grid.low[axis]) / grid.step[axis]
            if grid.whole[axis]:
                at %= grid.count[axis]
            cell = np.floor(at).clip(0, grid.count[axis] - 1)
            shift += np.abs(at - cell - 0.5) * (grid.step[axis] * grid.lever[axis])
            number *= grid.count[axis]
            number += cell.astype(np.intp)
        slack = shift.astype(np.float32)
        return self.lower[number] - slack, self.upper[number] + slack


def may_collide(grid: JointGrid, distance: LinkDistance) -> bool:
    """Whether two bodies may overlap anywhere in the grid. True also if they come too close to
    decide, or if deciding would take too long."""
    cells = _all_cells(grid.count // 2**Tables.levels)
    for level in range(Tables.levels, -Tables.extra_levels - 1, -1):
        slack = float(grid.step @ grid.lever) * 2**level / 2 + Tables.accuracy
        found = distance.at(grid.centers(cells, level), slack)
        if found.min() <= Tables.accuracy:
            return True
        cells = _halve_cells(cells[found <= slack])
        if not len(cells):
            return False
        if len(cells) * distance.pairs > Tables.max_distances:
            return True
    return True


def _all_cells(counts: Iterable[int]) -> Indices:
    """(C, m) all cells of a grid with m counts; a single cell if m is 0."""
    sizes = tuple(int(count) for count in counts)
    return np.asarray(np.indices(sizes, dtype=np.intp).reshape(len(sizes), math.prod(sizes)).T)


def _halve_cells(cells: Indices) -> Indices:
    """(2^m C, m) cells of half the size in cells (C, m)."""
    count, m = cells.shape
    return (2 * cells[:, None] + _all_cells([2] * m)).reshape(count * 2**m, m)


def _levers(
    links: ArmLinks, a: BodyBalls, b: BodyBalls, joints: tuple[int, ...], limits: Array
) -> list[float]:
    """For each joint, the largest motion of one body relative to the other per unit of the joint.

    The first joint's axis is fixed in the first body's frame and the last joint's axis in the other
    body's frame, so that their distances from the body's points are constant.
    """
    levers = []
    for joint in joints:
        if not links.turns[joint]:
            levers.append(1.0)
            continue
        bounds = []
        if joint == joints[0]:
            X = links.X_before[joint]
            bounds.append(_distance_from_z((a.balls.center - X[:3, 3]) @ X[:3, :3]) + a.balls.outer)
            reach = np.linalg.norm(b.balls.center, axis=1) + b.balls.outer
            for later in joints[1:]:
                reach = reach + np.linalg.norm(links.X_before[later][:3, 3])
                if not links.turns[later]:
                    reach = reach + np.abs(limits[later]).max()
            bounds.append(reach)
        if joint == joints[-1]:
            bounds.append(_distance_from_z(b.balls.center) + b.balls.outer)
        levers.append(min(float(bound.max()) for bound in bounds))
    return levers


def _distance_from_z(p: Array) -> Array:
    return np.asarray(np.hypot(p[:, 0], p[:, 1]))


Pair = tuple[int, int]
ClearanceTable = tuple[PairTable, tuple[Pair, ...]]

SELF_REFINE_BELOW = 0.022
"""Metres. Pairs of balls with a smaller lower bound are opened."""


def collision_pairs(
    plant: MultibodyPlant, inspector: SceneGraphInspector, bodies: Sequence[BodyIndex]
) -> list[tuple[BodyIndex, BodyIndex]]:
    """Pairs of bodies that Drake includes in collision checks."""
    own = {body: plant.GetCollisionGeometriesForBody(plant.get_body(body)) for body in bodies}

    def collide(a: BodyIndex, b: BodyIndex) -> bool:
        pairs = itertools.product(own[a], own[b])
        return any(not inspector.CollisionFiltered(one, two) for one, two in pairs)

    return [(a, b) for a, b in itertools.combinations(bodies, 2) if collide(a, b)]


class SelfClearance:
    """Clearance of the arm from itself.

    Args:
        trees: balls that cover the robot.
        pairs: pairs of body indices that are compared by their trees, the earlier body first.
        tables: tables of the other pairs, each with the pairs that it holds for.
        apart: pairs that are proven not to meet within the joint limits.
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
        self._radius_sum = (radius[self._one] + radius[self._two]).astype(np.float32)[:, None]
        self._root = np.array([body.root for body in trees.bodies], dtype=np.intp)

    @classmethod
    def of(
        cls, station_diagram: StationDiagram, links: ArmLinks, trees: BallTrees, limits: Array
    ) -> SelfClearance:
        """Computes tables for all pairs that can meet within the joint limits (n, 2) [rad or m]."""
        inspector = station_diagram.scene_graph.model_inspector()
        bodies = [body.body for body in trees.bodies]
        counted = {
            frozenset(pair) for pair in collision_pairs(station_diagram.plant, inspector, bodies)
        }
        pairs = [
            (i, j)
            for i, j in itertools.combinations(range(len(bodies)), 2)
            if frozenset((bodies[i], bodies[j])) in counted
        ]
        tables, left = _tables(station_diagram, links, trees, limits, pairs)
        meeting = {*left, *(pair for _, covered in tables for pair in covered)}
        apart = [pair for pair in pairs if pair not in meeting]
        return cls(trees, left, tables, apart)

    def bounds(
        self, q: Array, poses: LinkPoses, centers: Single, wanted: NDArray[np.bool_]
    ) -> tuple[Single, Single]:
        """Lower and upper bounds (K,) [m].

        Args:
            q: (K, n) configurations.
            poses: link poses of the configurations.
            centers: (3, B, K) centres of the bounding balls of the bodies.
            wanted: (K,) whether to descend into the trees for a configuration.
        """
        block_size = 2**9  # Configurations evaluated together. They fit a processor's caches.
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
        for start in range(0, len(q), block_size):
            part = slice(start, start + block_size)
            bound = _norm(centers[:, self._one, part] - centers[:, self._two, part])
            bound -= self._radius_sum
            pair, which = np.nonzero((bound < SELF_REFINE_BELOW) & wanted[part])
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
        """Lowers `lower` and `upper` by the distances of tree nodes `one` and `two` (F,) in
        configurations `which` (F,)."""
        chunk_size = 2**9  # Pairs of nodes compared together. They fit a processor's caches.
        trees = self._trees
        for start in range(0, len(which), chunk_size):
            part = slice(start, start + chunk_size)
            k, a, b = which[part], one[part], two[part]
            centers_a = trees.node_ball_centers(a, poses, k)
            centers_b = trees.node_ball_centers(b, poses, k)
            gap = centers_a[:, :, None] - centers_b[:, None]
            distance = _norm(gap)
            bound = distance - (trees.outer[:, a][:, None] + trees.outer[:, b][None])
            below = trees.child[0, a[0]] >= 0
            if below:
                i, j, at = np.nonzero(bound < SELF_REFINE_BELOW)
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
    """Tables of pairs with few joints between them, and the pairs without a table.

    Pairs with few joints between them that cannot meet are in neither.
    """
    close: dict[tuple[int, int], list[int]] = {}
    left = []
    for i, j in pairs:
        a, b = trees.bodies[i], trees.bodies[j]
        grid = JointGrid.over(links, a, [b], limits)
        if grid is None:
            left.append((i, j))
        elif may_collide(grid, LinkDistance(station_diagram, links, a.body, [b.body])):
            close.setdefault((i, b.frame), []).append(j)
    tables = []
    for (i, _), indices in close.items():
        a, others = trees.bodies[i], [trees.bodies[j] for j in indices]
        grid = JointGrid.over(links, a, others, limits)
        assert grid is not None
        distance = LinkDistance(station_diagram, links, a.body, [b.body for b in others])
        if np.prod(grid.count) * distance.pairs <= Tables.max_distances:
            tables.append((PairTable.of(grid, distance), tuple((i, j) for j in indices)))
        else:
            left += [(i, j) for j in indices]
    return tables, left


def _norm(v: Single) -> Single:
    x, y, z = v
    return np.asarray(np.sqrt(x * x + y * y + z * z))
