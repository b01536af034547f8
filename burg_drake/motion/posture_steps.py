"""Steps between an arm's postures at neighbouring poses, and shortest ways over them.

A row holds the postures of one branch of the inverse kinematics by the value of the redundant
joint; a step leads to a near value in the same row at the next pose, or in the row of the branch
that it may go over into. Rows without any posture at some pose need not be looked at.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from burg_drake.motion.panda_ik import BRANCHES

Indices = NDArray[np.intp]
Booleans = NDArray[np.bool_]
Single = NDArray[np.float32]

FAR = np.float32(np.inf)
OTHER_SIDE = np.arange(BRANCHES) ^ 2
"""The branches that branches can go over into: those with the other sign in problem 2 of
`motion.panda_ik`."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Some rows of an array indexed by pose, grasp, way, branch and value, ordered by the grasp.

    Attributes:
        grasp, way, branch: (R,) of each row.
        other: (R,) number of the row with the other branch.
    """

    grasp: Indices
    way: Indices
    branch: Indices
    other: Indices

    @classmethod
    def where(cls, wanted: Booleans) -> Rows:
        """Those wanted (n, 2, 8); of two branches that go over into each other both or none."""
        grasp, way, branch = np.nonzero(wanted)
        number = np.cumsum(wanted).reshape(wanted.shape) - 1
        return cls(grasp, way, branch, number[grasp, way, OTHER_SIDE[branch]])

    @property
    def index(self) -> tuple[slice, Indices, Indices, Indices]:
        """What picks the rows of an array (L, n, 2, 8, Q): as (L, R, Q)."""
        return slice(None), self.grasp, self.way, self.branch

    def some(self, chosen: Indices) -> Rows:
        """All the rows of some grasps, by their numbers, rising."""
        other = np.searchsorted(chosen, self.other[chosen])
        return Rows(self.grasp[chosen], self.way[chosen], self.branch[chosen], other)

    def number(self, grasp: int, way: int, branch: int) -> int:
        """The number of a row."""
        here = (self.grasp == grasp) & (self.way == way) & (self.branch == branch)
        return int(np.flatnonzero(here)[0])


@dataclass(frozen=True, eq=False)
class PostureSteps:
    """Steps from each posture of R rows at L poses with Q values.

    Attributes:
        length: (L - 1, S, R, Q) way of the joint that moves most [rad]; infinite where there is no
            step. The S kinds are those in the row, by the offset of the value, then those that go
            over into the other row.
        other: (R,) the row that each may go over into.
        offsets, crossing: by how many values a step may lead up or down in its row, and to the
            other.
    """

    length: Single
    other: Indices
    offsets: int
    crossing: int

    @classmethod
    def of(cls, q: Single, other: Indices, *, travel: float, offsets: int) -> PostureSteps:
        """Between postures (n, L, R, Q), NaN where there is none, by steps in which no joint moves
        more than `travel` [rad]."""
        steps = cls(np.empty(0, dtype=np.float32), other, offsets, offsets // 2)
        here, after = q[:, :-1], steps._padded(q[:, 1:], np.float32(np.nan))
        kinds = steps._kinds()
        length = np.empty((here.shape[1], len(kinds), *here.shape[2:]), dtype=np.float32)
        for kind, (offset, crosses) in enumerate(kinds):
            there = after[..., offsets + offset : offsets + offset + q.shape[-1]]
            there = there[..., other, :] if crosses else there
            way = np.abs(there[0] - here[0])
            for joint in range(1, len(q)):
                np.maximum(way, np.abs(there[joint] - here[joint]), out=way)
            length[:, kind] = np.where(way <= travel, way, FAR)
        return replace(steps, length=length)

    def some(self, rows: Indices) -> PostureSteps:
        """Those of some rows, each with its other one."""
        other = np.searchsorted(rows, self.other[rows])
        return replace(self, length=self.length[:, :, rows], other=other)

    def cut(self, pose: int, row: int, value: int, offset: int, crosses: bool) -> None:
        """Takes a step out."""
        self.length[pose, self._kinds().index((offset, crosses)), row, value] = FAR

    def onwards(self, cost: Single) -> list[Single]:
        """Least costs (R, Q) of ways from the postures of each pose to the last pose, with the
        costs (L, R, Q) of all postures on them."""
        values = [cost[-1]]
        for length, here in zip(self.length[::-1], cost[-2::-1], strict=True):
            values.append(self._onwards(length, values[-1]).min(axis=0) + here)
        return values[::-1]

    def follow(self, values: list[Single], row: Indices, value: Indices) -> tuple[Indices, Indices]:
        """Rows and values (m, L) of the least ways from (m,) postures of the first pose."""
        kinds = self._kinds()
        offset = np.array([offset for offset, _ in kinds])
        crosses = np.array([crosses for _, crosses in kinds])
        rows, ks = [row], [value]
        for length, onwards in zip(self.length, values[1:], strict=True):
            row, value = rows[-1], ks[-1]
            there = np.where(crosses, self.other[row][:, None], row[:, None])
            k = value[:, None] + offset
            total = length[:, row, value].T + self._padded(onwards, FAR)[there, k + self.offsets]
            best = total.argmin(axis=1)
            every = np.arange(len(row))
            rows.append(there[every, best])
            ks.append(k[every, best])
        return np.stack(rows, axis=1), np.stack(ks, axis=1)

    def joined(self, exists: Booleans) -> Booleans:
        """(L, R, Q) which of the postures that there are lie on ways from the first to the last
        pose."""
        onwards = np.isfinite(self.onwards(np.where(exists, np.float32(0.0), FAR)))
        return self.reached(np.asarray(onwards))

    def reached(self, usable: Booleans) -> Booleans:
        """(L, R, Q) which usable postures are led to from the first pose over usable ones."""
        led = np.zeros_like(usable)
        led[0] = usable[0]
        count = usable.shape[-1]
        for pose, length in enumerate(self.length):
            begun = np.isfinite(length) & led[pose]
            to = np.zeros((2, *usable.shape[1:-1], count + 2 * self.offsets), dtype=bool)
            for kind, (offset, crosses) in enumerate(self._kinds()):
                shift = self.offsets + offset
                to[int(crosses), :, shift : shift + count] |= begun[kind]
            there = to[0] | to[1][self.other]
            led[pose + 1] = there[:, self.offsets : self.offsets + count] & usable[pose + 1]
        return led

    def _kinds(self) -> list[tuple[int, bool]]:
        kinds = [(offset, False) for offset in range(-self.offsets, self.offsets + 1)]
        return kinds + [(offset, True) for offset in range(-self.crossing, self.crossing + 1)]

    def _onwards(self, length: Single, value: Single) -> Single:
        """(S, R, Q) costs of going on by each kind of step."""
        count = value.shape[-1]
        near = sliding_window_view(self._padded(value, FAR), count, axis=-1).swapaxes(0, 1)
        side = near[self.offsets - self.crossing : self.offsets + self.crossing + 1]
        total = np.empty_like(length)
        straight = len(near)
        np.add(length[:straight], near, out=total[:straight])
        np.add(length[straight:], side[:, self.other], out=total[straight:])
        return total

    def _padded(self, values: Single, outside: np.float32) -> Single:
        width = [(0, 0)] * (values.ndim - 1) + [(self.offsets, self.offsets)]
        return np.pad(values, width, constant_values=outside)
