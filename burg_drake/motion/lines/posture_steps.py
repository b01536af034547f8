"""Steps between an arm's postures at neighbouring poses, and shortest ways over them.

A row holds the postures of one branch of the inverse kinematics by the value of the redundant
joint; a step leads to a near value in the same row at the next pose, or in the row of the branch
that it may go over into. Rows without any posture at some pose need not be looked at.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Booleans, Indices, Single
from burg_drake.motion.ik import BRANCHES

FAR = np.float32(np.inf)
CROSSINGS = np.arange(BRANCHES) ^ np.array([[2], [1]])
"""(2, 8) the branches that branches can go over into: those with the other sign in problem 2 of
`motion.ik.panda`, which meet in a fold, and those with the other sign in problem 3, which meet
where the upper arm is upright."""


@dataclass(frozen=True, eq=False)
class PostureRows:
    """Some rows of an array indexed by pose, grasp, way, branch and value, ordered by the grasp.

    Attributes:
        grasp, way, branch: (R,) of each row.
        other: (2, R) numbers of the rows with the other branches.
    """

    grasp: Indices
    flip: Indices
    branch: Indices
    other: Indices

    @classmethod
    def where(cls, wanted: Booleans) -> PostureRows:
        """Those wanted (n, 2, 8), with all that they can go over into."""
        for crossing in CROSSINGS:
            wanted = wanted | wanted[..., crossing]
        grasp, flip, branch = np.nonzero(wanted)
        number = np.cumsum(wanted).reshape(wanted.shape) - 1
        return cls(grasp, flip, branch, number[grasp, flip, CROSSINGS[:, branch]])

    @property
    def index(self) -> tuple[slice, Indices, Indices, Indices]:
        """What picks the rows of an array (L, n, 2, 8, Q): as (L, R, Q)."""
        return slice(None), self.grasp, self.flip, self.branch

    def some(self, chosen: Indices) -> PostureRows:
        """All the rows of some grasps, by their numbers, rising."""
        other = np.searchsorted(chosen, self.other[:, chosen])
        return PostureRows(self.grasp[chosen], self.flip[chosen], self.branch[chosen], other)

    def number(self, grasp: int, flip: int, branch: int) -> int:
        """The number of a row."""
        here = (self.grasp == grasp) & (self.flip == flip) & (self.branch == branch)
        return int(np.flatnonzero(here)[0])


@dataclass(frozen=True, eq=False)
class PostureSteps:
    """Steps from each posture of R rows at L poses with Q values.

    Attributes:
        length: (L - 1, S, R, Q) way of the joint that moves most [rad]; infinite where there is no
            step. The S kinds are those in the row, by the offset of the value, then those that go
            over into each of the other rows.
        other: (2, R) the rows that each may go over into.
        offsets, crossing: by how many values a step may lead up in its row, and to the others;
            negative ones down.
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
        """Between postures (n, L, R, Q), NaN where there is none, by steps in which no joint moves
        more than `travel` [rad]."""
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
            length[:, kind] = np.where(change <= travel, change, FAR)
        return replace(steps, length=length)

    def some(self, rows: Indices) -> PostureSteps:
        """Those of some rows, each with its other ones."""
        other = np.searchsorted(rows, self.other[:, rows])
        return replace(self, length=self.length[:, :, rows], other=other)

    def cut(self, pose: int, row: int, value: int, offset: int, crossing: int | None) -> None:
        """Takes a step out; `crossing` is the number of the other row, None in the same row."""
        self.length[pose, self._kinds().index((offset, crossing)), row, value] = FAR

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
        target = np.array([0 if crossing is None else 1 + crossing for _, crossing in kinds])
        to = np.concatenate([np.arange(self.other.shape[1])[None], self.other])
        rows, ks = [row], [value]
        for length, onwards in zip(self.length, values[1:], strict=True):
            row, value = rows[-1], ks[-1]
            there = to[target][:, row].T
            k = value[:, None] + offset
            total = length[:, row, value].T + self._padded(onwards, FAR)[there, k + self._margin]
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
        count, margin = usable.shape[-1], self._margin
        for pose, length in enumerate(self.length):
            begun = np.isfinite(length) & led[pose]
            there = np.zeros((*usable.shape[1:-1], count + 2 * margin), dtype=bool)
            for kind, (offset, crossing) in enumerate(self._kinds()):
                shift = margin + offset
                come = begun[kind] if crossing is None else begun[kind][self.other[crossing]]
                there[:, shift : shift + count] |= come
            led[pose + 1] = there[:, margin : margin + count] & usable[pose + 1]
        return led

    @property
    def _margin(self) -> int:
        return max(self.offsets[-1], self.crossing[-1])

    def _kinds(self) -> list[tuple[int, int | None]]:
        """By how many values a step leads up, and to which of the other rows."""
        kinds: list[tuple[int, int | None]] = [(k, None) for k in self.offsets]
        return kinds + [(k, i) for i in range(len(self.other)) for k in self.crossing]

    def _onwards(self, length: Single, value: Single) -> Single:
        """(S, R, Q) costs of going on by each kind of step."""
        padded, total = self._padded(value, FAR), np.empty_like(length)
        for kind, (offset, crossing) in enumerate(self._kinds()):
            there = self._shifted(padded, offset)
            there = there if crossing is None else there[self.other[crossing]]
            np.add(length[kind], there, out=total[kind])
        return total

    def _padded(self, values: Single, outside: np.float32) -> Single:
        width = [(0, 0)] * (values.ndim - 1) + [(self._margin, self._margin)]
        return np.pad(values, width, constant_values=outside)

    def _shifted(self, padded: Single, offset: int) -> Single:
        """The values that are up by an offset, of an array with margins."""
        count = padded.shape[-1] - 2 * self._margin
        return padded[..., self._margin + offset : self._margin + offset + count]
