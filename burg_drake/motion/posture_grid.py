"""Postures of the Panda on a grid of hand poses and redundant joint values; shortest paths in it.

A posture at one pose is a branch of the inverse kinematics at one value of the redundant joint.
Postures of neighbouring poses are joined if the redundant joint is near, no joint jumps, and they
belong to one branch or to two that meet: in a fold, where joint 6 changes sign, or where the upper
arm is upright. The best chain is found by dynamic programming, for many grasps at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array, Booleans, Indices, Single
from burg_drake.motion.clearance_bounds import ArmProximity, Bounding, ClearanceBounds
from burg_drake.motion.line_poses import HandPath
from burg_drake.motion.motion_settings import ReachSettings
from burg_drake.motion.numeric_ik import ArmKinematics
from burg_drake.motion.panda_ik import IK_BRANCHES, PandaIk

IMPOSSIBLE_STEP = np.float32(np.inf)  # Length of steps that do not exist.
BRANCH_CROSSINGS = np.arange(IK_BRANCHES) ^ np.array([[2], [1]])
"""(2, 8) branches that meet: in a fold, and where the upper arm is upright."""


@dataclass(frozen=True, eq=False)
class PostureRows:
    """Selected rows of an array (pose, grasp, flip, branch, value), ordered by grasp.

    Attributes:
        grasp, flip, branch: (R,) indices of each row.
        other: (2, R) numbers of the rows with the branches that meet each row's branch.
    """

    grasp: Indices
    flip: Indices
    branch: Indices
    other: Indices

    @classmethod
    def where(cls, wanted: Booleans) -> PostureRows:
        """The rows of the wanted branches (n, 2, 8), and of the branches that meet them."""
        for crossing in BRANCH_CROSSINGS:
            wanted = wanted | wanted[..., crossing]
        grasp, flip, branch = np.nonzero(wanted)
        number = np.cumsum(wanted).reshape(wanted.shape) - 1
        return cls(grasp, flip, branch, number[grasp, flip, BRANCH_CROSSINGS[:, branch]])

    @property
    def index(self) -> tuple[slice, Indices, Indices, Indices]:
        """Index that selects the rows of an array (L, n, 2, 8, Q), as (L, R, Q)."""
        return slice(None), self.grasp, self.flip, self.branch

    def select(self, chosen: Indices) -> PostureRows:
        """Selects rows by their numbers, rising; for each grasp all or none."""
        other = np.searchsorted(chosen, self.other[:, chosen])
        return PostureRows(self.grasp[chosen], self.flip[chosen], self.branch[chosen], other)

    def number(self, grasp: int, flip: int, branch: int) -> int:
        """Number of the row of a grasp, finger assignment and branch."""
        here = (self.grasp == grasp) & (self.flip == flip) & (self.branch == branch)
        return int(np.flatnonzero(here)[0])


@dataclass(frozen=True, eq=False)
class PostureSteps:
    """Steps from each posture of R rows at L poses with Q values.

    Attributes:
        length: (L - 1, S, R, Q) motion of the joint that moves most [rad]; infinite where there is
            no step. The S kinds are steps within the row, by the offset of the value, then steps to
            each of the other rows.
        other: (2, R) the other rows that steps from each row may lead to.
        offsets, crossing: allowed changes of the value's index in steps within a row, and to
            another row.
    """

    length: Single
    other: Indices
    offsets: tuple[int, ...]
    crossing: tuple[int, ...]

    @classmethod
    def of(
        cls,
        q: Single,
        other: Indices,
        *,
        travel: float,
        offsets: tuple[int, ...],
        crossing: tuple[int, ...],
    ) -> PostureSteps:
        """Steps between postures `q` (n, L, R, Q), NaN where there is none, in which no joint moves
        by more than `travel` [rad]."""
        steps = cls(np.empty(0, dtype=np.float32), other, offsets, crossing)
        here, after = q[:, :-1], steps._padded(q[:, 1:], np.float32(np.nan))
        kinds = steps._kinds()
        length = np.empty((here.shape[1], len(kinds), *here.shape[2:]), dtype=np.float32)
        for kind, (offset, side) in enumerate(kinds):
            there = steps._shifted(after, offset)
            there = there if side is None else there[..., other[side], :]
            change = np.abs(there[0] - here[0])
            for joint in range(1, len(q)):
                np.maximum(change, np.abs(there[joint] - here[joint]), out=change)
            length[:, kind] = np.where(change <= travel, change, IMPOSSIBLE_STEP)
        return replace(steps, length=length)

    def select(self, rows: Indices) -> PostureSteps:
        """Selects rows, each together with its other rows."""
        other = np.searchsorted(rows, self.other[:, rows])
        return replace(self, length=self.length[:, :, rows], other=other)

    def cut(self, pose: int, row: int, value: int, offset: int, crossing: int | None) -> None:
        """Removes a step; `crossing` is the index of the other row in `other`, or None."""
        self.length[pose, self._kinds().index((offset, crossing)), row, value] = IMPOSSIBLE_STEP

    def cost_to_end(self, cost: Single) -> list[Single]:
        """For each pose, the least costs (R, Q) of paths from its postures to the last pose,
        including the costs (L, R, Q) of the postures on them."""
        values = [cost[-1]]
        for length, here in zip(self.length[::-1], cost[-2::-1], strict=True):
            values.append(self._cost_of_steps(length, values[-1]).min(axis=0) + here)
        return values[::-1]

    def follow(self, values: list[Single], row: Indices, value: Indices) -> tuple[Indices, Indices]:
        """Rows and values (m, L) of the cheapest paths from (m,) postures of the first pose."""
        kinds = self._kinds()
        offset = np.array([offset for offset, _ in kinds])
        target = np.array([0 if crossing is None else 1 + crossing for _, crossing in kinds])
        to = np.concatenate([np.arange(self.other.shape[1])[None], self.other])
        rows, ks = [row], [value]
        for length, next_values in zip(self.length, values[1:], strict=True):
            row, value = rows[-1], ks[-1]
            there = to[target][:, row].T
            k = value[:, None] + offset
            total = (
                length[:, row, value].T
                + self._padded(next_values, IMPOSSIBLE_STEP)[there, k + self._margin]
            )
            best = total.argmin(axis=1)
            every = np.arange(len(row))
            rows.append(there[every, best])
            ks.append(k[every, best])
        return np.stack(rows, axis=1), np.stack(ks, axis=1)

    def joined(self, exists: Booleans) -> Booleans:
        """(L, R, Q) whether existing postures lie on a path from the first to the last pose."""
        reaches_end = np.isfinite(
            self.cost_to_end(np.where(exists, np.float32(0.0), IMPOSSIBLE_STEP))
        )
        return self.reached(np.asarray(reaches_end))

    def reached(self, usable: Booleans) -> Booleans:
        """(L, R, Q) whether usable postures can be reached from the first pose over usable ones."""
        reached = np.zeros_like(usable)
        reached[0] = usable[0]
        count, margin = usable.shape[-1], self._margin
        for pose, length in enumerate(self.length):
            begun = np.isfinite(length) & reached[pose]
            there = np.zeros((*usable.shape[1:-1], count + 2 * margin), dtype=bool)
            for kind, (offset, crossing) in enumerate(self._kinds()):
                shift = margin + offset
                arriving = begun[kind] if crossing is None else begun[kind][self.other[crossing]]
                there[:, shift : shift + count] |= arriving
            reached[pose + 1] = there[:, margin : margin + count] & usable[pose + 1]
        return reached

    @property
    def _margin(self) -> int:
        return max(self.offsets[-1], self.crossing[-1])

    def _kinds(self) -> list[tuple[int, int | None]]:
        """Kinds of steps: change of the value's index, and index in `other` (None: same row)."""
        kinds: list[tuple[int, int | None]] = [(k, None) for k in self.offsets]
        return kinds + [(k, i) for i in range(len(self.other)) for k in self.crossing]

    def _cost_of_steps(self, length: Single, value: Single) -> Single:
        """(S, R, Q) costs to the end for each kind of step."""
        padded, total = self._padded(value, IMPOSSIBLE_STEP), np.empty_like(length)
        for kind, (offset, crossing) in enumerate(self._kinds()):
            there = self._shifted(padded, offset)
            there = there if crossing is None else there[self.other[crossing]]
            np.add(length[kind], there, out=total[kind])
        return total

    def _padded(self, values: Single, outside: np.float32) -> Single:
        width = [(0, 0)] * (values.ndim - 1) + [(self._margin, self._margin)]
        return np.pad(values, width, constant_values=outside)

    def _shifted(self, padded: Single, offset: int) -> Single:
        """View of a padded array, shifted by an offset of the value's index."""
        count = padded.shape[-1] - 2 * self._margin
        return padded[..., self._margin + offset : self._margin + offset + count]


DEEP_PENETRATION = 0.01
"""Metres. A posture between two postures that deep is taken to be in collision."""


@dataclass(frozen=True, eq=False)
class GridChain:
    """A chain's postures, one at each of L poses.

    Attributes:
        flip: finger assignment, 0 or 1.
        branch: (L,) branches of the inverse kinematics.
        parameter: (L,) indices of the values of the redundant joint.
    """

    flip: int
    branch: Indices
    parameter: Indices


class PostureGrid:
    """Postures of n grasps at L poses each, for both finger assignments.

    Arrays are indexed by pose, grasp, finger assignment, branch and value of the redundant joint.

    Attributes:
        q: (7, L, n, 2, 8, Q) joint positions in single precision; NaN where there is none [rad].
        exists: (L, n, 2, 8, Q) whether there is a posture.
        joined: (L, n, 2, 8, Q) postures on chains from the first pose to the last; see `join`.
        lower, upper: (L, n, 2, 8, Q) bounds of the arm's clearance [m]; infinite until measured.
        refused: (L, n, 2, 8, Q) postures excluded from the search.
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
        """Allocates the arrays; `solve` fills them.

        Args:
            ik: the inverse kinematics.
            X_AH: (L, n, 2, 4, 4) hand poses.
            parameter: (Q,) values of the redundant joint [rad].
            travel: largest motion of a joint from one pose to the next [rad].
            offsets: allowed changes of the redundant joint's index within a branch.
            crossing: allowed changes of the redundant joint's index where the branch changes.
        """
        shape = (*X_AH.shape[:3], IK_BRANCHES, len(parameter))
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
        """Solves for the postures at the given poses of the given grasps."""
        X = self._X_AH[np.ix_(poses, grasps)]
        found = self._ik.solve(X.reshape(-1, 4, 4), self.parameter)
        pose, grasp, flip = np.unravel_index(found.pose, X.shape[:3])
        where = poses[pose], grasps[grasp], flip, found.branch, found.parameter
        self.q[(slice(None), *where)] = found.q.T
        self.exists[where] = True

    def join(self) -> None:
        """Computes the steps between postures and `joined`, after all calls of `solve`."""
        here = np.asarray(self.exists.any(axis=-1))
        for crossing in BRANCH_CROSSINGS:
            here = here | here[..., crossing]
        self._rows = PostureRows.where(np.all(here, axis=0))
        self._steps = self._steps_of(self._rows)
        self.joined[self._rows.index] = self._steps.joined(self.exists[self._rows.index])

    def copy_deep_collisions(
        self, grasp: int, coarse: PostureGrid, index: int, poses: list[int]
    ) -> None:
        """Takes over deep collisions of a grasp from a coarser grid, where it has number `index`.

        A posture between two measured ones that are deeper than `DEEP_PENETRATION` gets the bound
        of the less deep one.
        """
        at = np.interp(self.parameter, coarse.parameter, np.arange(len(coarse.parameter)))
        low, high = np.floor(at).astype(np.intp), np.ceil(at).astype(np.intp)
        for pose in poses:
            near = coarse.upper[pose, index]
            upper = np.maximum(near[..., low], near[..., high])
            deep = self.exists[pose, grasp] & (upper < -DEEP_PENETRATION)
            for bounds in (self.lower, self.upper):
                bounds[pose, grasp][deep] = upper[deep]

    def usable(self, poses: int | slice, grasp: int) -> Booleans:
        """(..., 2, 8, Q) postures of a grasp that are not known to be in collision."""
        at = poses, grasp
        return np.asarray(self.exists[at] & ~self.refused[at] & (self.upper[at] > 0.0))

    def measured_free(self, pose: int, grasp: int) -> bool:
        """Whether any measured posture is usable."""
        return bool((np.isfinite(self.lower[pose, grasp]) & self.usable(pose, grasp)).any())

    def cut(self, grasp: int, pose: int, chain: GridChain) -> None:
        """Removes the step of a chain from `pose` to the next one."""
        branch, next_branch = chain.branch[pose : pose + 2].tolist()
        k, next_k = chain.parameter[pose : pose + 2].tolist()
        row = self._rows.number(grasp, chain.flip, branch)
        crossings = BRANCH_CROSSINGS[:, branch].tolist()
        crossing = None if next_branch == branch else crossings.index(next_branch)
        self._steps.cut(pose, row, k, next_k - k, crossing)

    def best(self, grasps: Indices, doubt: float) -> list[GridChain | None]:
        """The cheapest chain of each grasp.

        The cost of a chain is the sum of the largest joint motions from pose to pose, the cost of
        its start, and for each posture a penalty that rises to `doubt` as the lower bound of its
        clearance falls from 1 cm to 0.

        Args:
            grasps: (m,) indices.
            doubt: cost of a posture whose clearance is not known to be positive [rad].

        Returns:
            The chains; None for grasps without one.
        """
        rows, steps = self._rows, self._steps
        if len(grasps) < self.q.shape[2]:
            chosen = np.flatnonzero(np.isin(rows.grasp, grasps))
            rows, steps = rows.select(chosen), steps.select(chosen)
        at = rows.index
        usable = self.joined[at] & ~self.refused[at] & (self.upper[at] > 0.0)
        doubts = np.clip(1.0 - self.lower[at] / np.float32(PREFERRED_CLEARANCE), 0.0, 1.0)
        cost = np.where(usable, np.float32(doubt) * doubts, IMPOSSIBLE_STEP)
        values = steps.cost_to_end(cost)
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
        """The last pose that chains of usable postures of a grasp reach; -1 if the first pose has
        none."""
        usable = self.usable(slice(None), grasp)
        wanted = np.zeros(self.q.shape[2:-1], dtype=bool)
        wanted[grasp] = usable.any(axis=(0, -1))
        rows = PostureRows.where(wanted)
        reached = self._steps_of(rows).reached(usable[:, rows.flip, rows.branch])
        return int(np.flatnonzero(reached.any(axis=(1, 2))).max(initial=-1))

    def _steps_of(self, rows: PostureRows) -> PostureSteps:
        q = self.q[(slice(None), *rows.index)]
        return PostureSteps.of(
            *(q, rows.other), travel=self._travel, offsets=self._offsets, crossing=self._crossing
        )


PREFERRED_CLEARANCE = 0.01
"""Metres, clearance that motions keep if they can: ten times the position error of a controlled
arm."""
START_COST = 0.3
"""Cost of a start per radian of the joint that is farthest from home."""


class PostureGridBuilder:
    """Opens grids of postures.

    Args:
        arm: the arm on its own.
        ik: the inverse kinematics, with the joint limits to keep.
        lines: the hand's path.
        proximity: bounds of the arm's clearance.
        home: (7,) home posture; chains that start near it are preferred [rad].
        settings: effort of the search.
    """

    def __init__(
        self,
        arm: ArmKinematics,
        ik: PandaIk,
        hand_path: HandPath,
        proximity: ArmProximity,
        home: Array,
        settings: ReachSettings,
    ) -> None:
        self.arm, self.ik, self.hand_path, self.proximity = arm, ik, hand_path, proximity
        self.home, self.settings = home, settings
        self.layers, self.at_grasp = hand_path.layers, hand_path.at_grasp

    def parameters(self, count: int) -> Array:
        """(count,) values of the redundant joint within its limits [rad]."""
        low, high = self.ik.lower[-1], self.ik.upper[-1]
        return np.asarray(low + (np.arange(count) + 0.5) / count * (high - low))

    def grid(self, X_AG: Array, count: int) -> PostureGrid:
        """An empty grid for the postures of grasps (n, 2, 4, 4), with `count` redundant values."""
        X_AH = self.hand_path.X_AH(X_AG[None], self.layers[:, None, None])
        values = self.parameters(count)
        spacing = values[1] - values[0] if count > 1 else np.inf
        # The redundant joint changes by at most 0.75 rad from layer to layer, or 0.38 rad where
        # the branch changes.
        return PostureGrid(
            *(self.ik, X_AH, values),
            travel=self.settings.joint_travel,
            offsets=_grid_offsets(0.75 / spacing),
            crossing=_grid_offsets(0.38 / spacing),
        )

    def measure(self, grid: PostureGrid, poses: Indices, grasps: Indices, wanted: Booleans) -> None:
        """Measures the clearance of wanted postures at poses of grasps, unless already measured."""
        if not len(grasps):
            return
        where = np.ix_(poses, grasps)
        new = wanted[where] & np.isinf(grid.lower[where])
        if not new.any():
            return
        q = np.stack([joint[where][new] for joint in grid.q], axis=-1)
        bounds = self.proximity.bounds(q, hand=False)
        lower, upper = grid.lower[where], grid.upper[where]
        lower[new], upper[new] = bounds.lower, decisive_clearance(bounds, self.settings.exact)
        grid.lower[where], grid.upper[where] = lower, upper


def _grid_offsets(max_offset: float) -> tuple[int, ...]:
    """Rising offsets from -`max_offset` to `max_offset` that include 0."""
    # Steps of the redundant joint's index. Large changes need no fine choice.
    steps = (1, 2, 4, 8, 16, 24)
    up = [k for k in steps if k <= max_offset]
    return (*(-k for k in reversed(up)), 0, *up)


def decisive_clearance(bounds: ClearanceBounds, exact: bool) -> Array:
    """(K,) clearance that must be positive for a posture to be kept: the upper bound if Drake
    checks it later; otherwise infinite if it is likely free, and negative if not."""
    if exact:
        return bounds.upper
    return np.where(
        bounds.likely_free,
        np.inf,
        np.minimum(bounds.upper, Bounding.likely_free_above),
    )
