"""Distances between two links with one or two joints between them, as tables over these joints.

The table holds the signed distance of the collision geometry at the centres of cells. In between
it is bounded through levers: while a joint moves, no point of the one link moves farther, as seen
from the other, than the joint's step times the link's lever, and so far may the distance change at
most, also the negative one of links that overlap. Cells are as large as that allows.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, Indices, Single
from burg_drake.motion.ik import ArmLinks
from burg_drake.motion.proximity.ball_tree import BodyBalls
from burg_drake.motion.proximity.link_distance import LinkDistance

MOST_JOINTS = 2
"""Between the links of a table; more would take too many cells."""
TURN, SLIDE = np.deg2rad(3.0), 6e-3
"""Largest size of the smallest cells [rad, m]."""
LEVELS = 4
"""How many times the largest cells are halved at most."""
FINER = 2
"""How many times more they are halved to see whether links can meet."""
MOST_CELLS = 200_000
"""Above this many there is no table."""
MOST_DISTANCES = 500_000
"""Distances of shapes at the smallest cells above which there is none either, nor a closer look
whether links can meet: some seconds."""
KNOWN = 0.03
"""Up to this distance [m] they are known well; beyond, they are bounded by about that."""
SHARE = 0.5
"""Uncertainty of a distance in a cell that is not halved any more, as a share of the distance."""
DEPTH = 0.02
"""By how much an overlap may be deeper than is known, for the lower bounds' sake [m]."""
ACCURACY = 5e-5
"""Above the errors of distances [m]: Drake's, which the bounds have to agree with, are off by up to
6e-6 m for cylinders (documentation of QueryObject), and by 3e-5 m from its test for overlaps."""


@dataclass(frozen=True, eq=False)
class JointGrid:
    """Cells over the range of m joints.

    Attributes:
        joints: (m,) their numbers.
        low, step: (m,) where the first cells begin and how large they are [rad or m].
        count: (m,) numbers of cells.
        whole: (m,) whether the cells go once around, and positions count modulo a turn.
        lever: (m,) how far a joint moves the one link as seen from the other at most, by the
            joint's way [m/rad, or 1].
    """

    joints: tuple[int, ...]
    low: Array
    step: Array
    count: Indices
    whole: tuple[bool, ...]
    lever: Array

    @classmethod
    def over(
        cls, links: ArmLinks, a: BodyBalls, several: Sequence[BodyBalls], limits: Array
    ) -> JointGrid | None:
        """The grid for a body and some others, all in one frame beyond it; None if there are too
        many joints between them, or too long a range.

        Args:
            links: the arm.
            a, several: the bodies.
            limits: (n, 2) of the joints' positions [rad or m].
        """
        joints = tuple(range(a.frame, several[0].frame))
        if len(joints) > MOST_JOINTS:
            return None
        turns = np.array([links.turns[i] for i in joints], dtype=bool)
        low, high = limits[list(joints)].reshape(-1, 2).T
        whole = turns & ~(high - low < 2.0 * np.pi)
        low, high = np.where(whole, -np.pi, low), np.where(whole, np.pi, high)
        finest = np.where(turns, TURN, SLIDE)
        if not np.isfinite(high - low).all():
            return None
        count = np.ceil((high - low) / (finest * 2**LEVELS) - 1e-9).astype(int).clip(1) * 2**LEVELS
        if np.prod(count) > MOST_CELLS:
            return None
        lever = np.max([_levers(links, a, b, joints, limits) for b in several], axis=0)
        return cls(joints, low, (high - low) / count, count, tuple(whole.tolist()), lever)

    def centers(self, cells: Indices, level: int) -> Array:
        """(C, m) middles of cells (C, m) that are larger by 2^level [rad or m]."""
        return np.asarray(self.low + (cells + 0.5) * (self.step * 2**level))

    def within(self, cells: Indices, level: int) -> tuple[Indices, Array]:
        """(C, F) numbers of the smallest cells in larger ones (C, m), and (F,) how far the link
        may move between their middles and those of the larger ones [m]."""
        part = _lattice([2**level] * len(self.joints))
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
        lower, upper: (cells,) bounds at the middles of the smallest cells [m].
    """

    grid: JointGrid
    lower: Single
    upper: Single

    @classmethod
    def of(cls, grid: JointGrid, distance: LinkDistance) -> PairTable:
        """Measures the distances."""
        lower, upper = np.empty((2, int(np.prod(grid.count))))
        cells = _lattice(grid.count // 2**LEVELS)
        for level in reversed(range(LEVELS + 1)):
            slack = float(grid.step @ grid.lever) * 2**level / 2
            ceiling = KNOWN + slack
            found = distance.at(grid.centers(cells, level), ceiling)
            inside = found + slack < -ACCURACY
            done = (slack <= SHARE * found) | (found >= ceiling) | inside | (level == 0)
            number, reach = grid.within(cells[done], level)
            at = found[done, None]
            lower[number] = (
                np.where(at > 0.0, np.minimum(at, ceiling), at - DEPTH) - reach - ACCURACY
            )
            upper[number] = at + reach + ACCURACY
            cells = _halved(cells[~done])
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


def may_meet(grid: JointGrid, distance: LinkDistance) -> bool:
    """Whether two bodies overlap anywhere in the grid, or come so close that it is not sure, or
    would take too long to find out."""
    cells = _lattice(grid.count // 2**LEVELS)
    for level in range(LEVELS, -FINER - 1, -1):
        slack = float(grid.step @ grid.lever) * 2**level / 2 + ACCURACY
        found = distance.at(grid.centers(cells, level), slack)
        if found.min() <= ACCURACY:
            return True
        cells = _halved(cells[found <= slack])
        if not len(cells):
            return False
        if len(cells) * distance.pairs > MOST_DISTANCES:
            return True
    return True


def is_affordable(grid: JointGrid, distance: LinkDistance) -> bool:
    """Whether a table of these distances is made in seconds."""
    return bool(np.prod(grid.count) * distance.pairs <= MOST_DISTANCES)


def _lattice(counts: Iterable[int]) -> Indices:
    """(C, m) all the cells of a grid with m counts; one if m is 0."""
    sizes = tuple(int(count) for count in counts)
    return np.asarray(np.indices(sizes, dtype=np.intp).reshape(len(sizes), math.prod(sizes)).T)


def _halved(cells: Indices) -> Indices:
    """(2^m C, m) cells of half the size in cells (C, m)."""
    count, m = cells.shape
    return (2 * cells[:, None] + _lattice([2] * m)).reshape(count * 2**m, m)


def _levers(
    links: ArmLinks, a: BodyBalls, b: BodyBalls, joints: tuple[int, ...], limits: Array
) -> list[float]:
    """By each joint, how far it moves one of the bodies as seen from the other, at most.

    The first joint's axis stands still in the first body's frame and the last one's in the
    other's, so that the distance from it is that of points that do not move.
    """
    levers = []
    for joint in joints:
        if not links.turns[joint]:
            levers.append(1.0)
            continue
        bounds = []
        if joint == joints[0]:
            X = links.X_before[joint]
            bounds.append(_from_z((a.balls.center - X[:3, 3]) @ X[:3, :3]) + a.balls.outer)
            reach = np.linalg.norm(b.balls.center, axis=1) + b.balls.outer
            for later in joints[1:]:
                reach = reach + np.linalg.norm(links.X_before[later][:3, 3])
                if not links.turns[later]:
                    reach = reach + np.abs(limits[later]).max()
            bounds.append(reach)
        if joint == joints[-1]:
            bounds.append(_from_z(b.balls.center) + b.balls.outer)
        levers.append(min(float(bound.max()) for bound in bounds))
    return levers


def _from_z(p: Array) -> Array:
    return np.asarray(np.hypot(p[:, 0], p[:, 1]))
