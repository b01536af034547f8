"""Shortest ways through the postures of an arm along a line of hand poses.

A posture at one pose of the line is a branch of the inverse kinematics at one value of the
redundant joint. Those of neighbouring poses are joined where they are near in the redundant joint,
no joint jumps, and they are of one branch, or of two that meet: in a fold, where the sign of the
turn of joint 6 changes, or where the upper arm is upright. The best chain from the first pose to
the last is found by dynamic programming, for many grasps at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, Booleans, Indices
from burg_drake.motion.ik import BRANCHES, PandaIk
from burg_drake.motion.lines.posture_steps import CROSSINGS, FAR, PostureRows, PostureSteps

DEEP = 0.01
"""See `PostureGrid.take_over` [m]: of 17,000 postures between two that deep 8 were free."""
COMFORT = 0.01
"""Clearance from which on more of it is not preferred [m]: ten times what an arm in position
control is off its way."""


@dataclass(frozen=True, eq=False)
class GridChain:
    """A chain's postures, one at each of L poses.

    Attributes:
        flip: index of the finger way.
        branch: (L,) of the inverse kinematics.
        parameter: (L,) indices of values of the redundant joint.
    """

    flip: int
    branch: Indices
    parameter: Indices


class PostureGrid:
    """Postures of n grasps at L poses each, with the fingers in two ways.

    Arrays are indexed by pose, grasp, way, branch and value of the redundant joint.

    Attributes:
        q: (7, L, n, 2, 8, Q) joint positions in single precision; NaN where there is none [rad].
        exists: (L, n, 2, 8, Q) whether there is a posture.
        joined: (L, n, 2, 8, Q) postures on chains from the first pose to the last; see `join`.
        lower, upper: (L, n, 2, 8, Q) bounds of the arm's clearance [m]; infinite until measured.
        refused: (L, n, 2, 8, Q) postures known not to do.
        start: (n, 2, 8, Q) cost of starting at each posture of the first pose [rad].
        parameter: (Q,) values of the redundant joint [rad].
    """

    def __init__(
        self,
        ik: PandaIk,
        X_AH: Array,
        parameter: Array,
        *,
        travel: float,
        offsets: tuple[int, ...],
        crossing: tuple[int, ...],
    ) -> None:
        """Makes room; see `solve`.

        Args:
            ik: the inverse kinematics.
            X_AH: (L, n, 2, 4, 4) hand poses.
            parameter: (Q,) values of the redundant joint [rad].
            travel: most that a joint may move from one pose to the next [rad].
            offsets: by how many values the redundant joint may change there ...
            crossing: ... and where the branch changes.
        """
        shape = (*X_AH.shape[:3], BRANCHES, len(parameter))
        self._ik, self._X_AH, self.parameter = ik, X_AH, parameter
        self._travel, self._offsets, self._crossing = travel, offsets, crossing
        self.q = np.full((len(ik.lower), *shape), np.nan, dtype=np.float32)
        self.exists = np.zeros(shape, dtype=bool)
        self.joined = np.zeros(shape, dtype=bool)
        self.lower = np.full(shape, np.inf, dtype=np.float32)
        self.upper = np.full(shape, np.inf, dtype=np.float32)
        self.refused = np.zeros(shape, dtype=bool)
        self.start = np.zeros(shape[1:], dtype=np.float32)
        self._rows = PostureRows.where(np.zeros(shape[1:-1], dtype=bool))
        self._steps = self._steps_of(self._rows)

    @property
    def poses(self) -> int:
        """Number of poses along the line."""
        return int(self.q.shape[1])

    def solve(self, poses: Indices, grasps: Indices) -> None:
        """Finds the postures at some poses of some grasps."""
        X = self._X_AH[np.ix_(poses, grasps)]
        found = self._ik.solve(X.reshape(-1, 4, 4), self.parameter)
        pose, grasp, flip = np.unravel_index(found.pose, X.shape[:3])
        where = poses[pose], grasps[grasp], flip, found.branch, found.parameter
        self.q[(slice(None), *where)] = found.q.T
        self.exists[where] = True

    def join(self) -> None:
        """Finds what postures are joined, once all have been found."""
        here = np.asarray(self.exists.any(axis=-1))
        for crossing in CROSSINGS:
            here = here | here[..., crossing]
        self._rows = PostureRows.where(np.all(here, axis=0))
        self._steps = self._steps_of(self._rows)
        self.joined[self._rows.index] = self._steps.joined(self.exists[self._rows.index])

    def take_over(self, grasp: int, coarse: PostureGrid, index: int, poses: list[int]) -> None:
        """Takes postures of a grasp for as deep in collision as those are that have been measured
        to either side of them in a coarser grid, where it has the number `index`, if both are
        deeper than `DEEP`."""
        at = np.interp(self.parameter, coarse.parameter, np.arange(len(coarse.parameter)))
        low, high = np.floor(at).astype(np.intp), np.ceil(at).astype(np.intp)
        for pose in poses:
            near = coarse.upper[pose, index]
            upper = np.maximum(near[..., low], near[..., high])
            deep = self.exists[pose, grasp] & (upper < -DEEP)
            for bounds in (self.lower, self.upper):
                bounds[pose, grasp][deep] = upper[deep]

    def usable(self, poses: int | slice, grasp: int) -> Booleans:
        """(..., 2, 8, Q) postures of a grasp that are not known to be in collision."""
        at = poses, grasp
        return np.asarray(self.exists[at] & ~self.refused[at] & (self.upper[at] > 0.0))

    def measured_free(self, pose: int, grasp: int) -> bool:
        """Whether any of the postures that have been measured is usable."""
        return bool((np.isfinite(self.lower[pose, grasp]) & self.usable(pose, grasp)).any())

    def cut(self, grasp: int, pose: int, place: GridChain) -> None:
        """Parts the postures of a chain at `pose` and the next one."""
        (branch, there), k = place.branch[pose : pose + 2].tolist(), int(place.parameter[pose])
        step = int(place.parameter[pose + 1]) - k
        row = self._rows.number(grasp, place.flip, branch)
        crossing = None if there == branch else CROSSINGS[:, branch].tolist().index(there)
        self._steps.cut(pose, row, k, step, crossing)

    def best(self, grasps: Indices, doubt: float) -> list[GridChain | None]:
        """The cheapest chain of each of some grasps.

        A chain costs the way of the joint that moves most from pose to pose, the cost of its
        start, and for each posture a cost that rises to `doubt` as the lower bound of its
        clearance falls from `COMFORT` to 0.

        Args:
            grasps: (m,) indices.
            doubt: cost of a posture whose clearance is not known to be positive [rad].

        Returns:
            The chains; None where there is none.
        """
        rows, steps = self._rows, self._steps
        if len(grasps) < self.q.shape[2]:
            chosen = np.flatnonzero(np.isin(rows.grasp, grasps))
            rows, steps = rows.some(chosen), steps.some(chosen)
        at = rows.index
        usable = self.joined[at] & ~self.refused[at] & (self.upper[at] > 0.0)
        doubts = np.clip(1.0 - self.lower[at] / np.float32(COMFORT), 0.0, 1.0)
        cost = np.where(usable, np.float32(doubt) * doubts, FAR)
        values = steps.onwards(cost)
        first = values[0] + self.start[at[1:]]
        ends = np.searchsorted(rows.grasp, np.stack([grasps, grasps + 1]))
        cheapest = np.full((2, len(grasps)), -1)
        for g, (begin, end) in enumerate(ends.T.tolist()):
            if begin < end:
                row, k = np.unravel_index(first[begin:end].argmin(), (end - begin, first.shape[1]))
                if np.isfinite(first[begin + row, k]):
                    cheapest[:, g] = begin + row, k
        found: list[GridChain | None] = [None] * len(grasps)
        there = np.flatnonzero(cheapest[0] >= 0)
        row, k = steps.follow(values, *cheapest[:, there])
        for g, r, parameter in zip(there.tolist(), row, k, strict=True):
            found[g] = GridChain(int(rows.flip[r[0]]), rows.branch[r], parameter)
        return found

    def reached(self, grasp: int) -> int:
        """The last pose that usable postures of a grasp lead to from the first; -1 if there are
        none at the first."""
        usable = self.usable(slice(None), grasp)
        only = np.zeros(self.q.shape[2:-1], dtype=bool)
        only[grasp] = usable.any(axis=(0, -1))
        rows = PostureRows.where(only)
        led = self._steps_of(rows).reached(usable[:, rows.flip, rows.branch]).any(axis=(1, 2))
        return int(np.flatnonzero(led).max(initial=-1))

    def _steps_of(self, rows: PostureRows) -> PostureSteps:
        q = self.q[(slice(None), *rows.index)]
        return PostureSteps.of(
            *(q, rows.other), travel=self._travel, offsets=self._offsets, crossing=self._crossing
        )
