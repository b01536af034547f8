"""Closed-form inverse kinematics of the Panda arm, for many poses and redundant joints at once.

Seven joints have one degree of freedom more than a pose; the last joint q7 is the parameter of
that freedom. With q7 the wrist W is known, where the axes of joints 5 and 6 meet. Three problems
remain, each with two solutions, which makes eight branches:

1. the triangle from the shoulder S, where the axes of joints 1 to 3 meet, over the elbow to W: q4;
2. the rotation about the axis of joint 6 that brings the plane of the triangle through S: q6, q5;
3. the three joints whose axes meet in S: q1, q2, q3.

Link frames are Craig's (frame i turns about its z axis, and z7 points to the flange F). Lengths
and limits are those of the Franka Control Interface's documentation.

Vectors are (3, K), one component after the other: the arithmetic is elementwise, so that a
solution does not depend on the rest of the batch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, Indices, InvalidInputError, check_pose, inverse
from burg_drake.geometry import Poses
from burg_drake.motion.numeric_ik import ArmKinematics

SHOULDER_HEIGHT = 0.333  # Metres above the base.
UPPER_ARM_LENGTH = 0.316  # Metres from shoulder to elbow, along the link.
FOREARM_LENGTH = 0.384  # Metres from elbow to wrist, along the link.
ELBOW_OFFSET = 0.0825  # Metres from the elbow's axis to both links.
WRIST_OFFSET = 0.088  # Metres from the wrist to the last axis.
FLANGE_LENGTH = 0.107  # Metres along the last axis to the flange.
IK_BRANCHES = 8  # Solutions of the Panda at one hand pose and one value of its last joint, at most.


@dataclass(frozen=True, eq=False)
class PandaPostures:
    """S arm configurations that meet wanted poses, ordered by pose, then by parameter.

    Attributes:
        pose: (S,) index of the pose.
        parameter: (S,) index of the value of the redundant joint.
        branch: (S,) index of the solution, 0 to 7: 4 elbow + 2 wrist + shoulder.
        q: (S, 7) joint positions within the limits [rad].
    """

    pose: Indices
    parameter: Indices
    branch: NDArray[np.int8]
    q: Array

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True, eq=False)
class PandaIk:
    """The arm with a hand on its flange.

    Attributes:
        X_FH: (4, 4) hand body in the flange frame.
        lower, upper: (7,) joint limits [rad]; those of q1, q2, q3, q5 and q7 within half a turn of
            0, those of q6 less than a turn apart.
    """

    X_FH: Array
    lower: Array
    upper: Array

    @classmethod
    def of(cls, arm: ArmKinematics) -> PandaIk | None:
        """The closed form of an arm, or None if it is not kinematically a Panda.

        Its joints have to move as the Panda's, on a base frame A like that of link 0. Limits and
        the pose of the hand on the flange may differ.
        """
        if len(arm.lower) != len(PANDA_DH_PARAMETERS) or not (arm.turns == 1.0).all():
            return None
        q = np.linspace(-1.0, 1.0, 5)[:, None] * np.arange(1.0, 8.0) % 2.0 - 1.0
        X_FH = inverse(panda_forward(q)) @ arm.forward(q)[0]
        if np.abs(X_FH - X_FH[0]).max() > 1e-9:
            return None
        return cls(X_FH[0], arm.lower, arm.upper)

    def within(self, margin: float) -> PandaIk:
        """The same arm with joint limits that are closer by a margin [rad]."""
        return replace(self, lower=self.lower + margin, upper=self.upper - margin)

    def solve(self, X_AH: ArrayLike, q7: ArrayLike) -> PandaPostures:
        """All configurations within the limits.

        Args:
            X_AH: (N, 4, 4) wanted poses of the hand body in the arm's base frame.
            q7: (M,) values of the last joint for all poses, or (N, M) for each [rad].

        Returns:
            Up to eight for every pair of pose and value. At singular postures (upper arm upright),
            where two joints may turn against each other, one of the solutions.

        Raises:
            InvalidInputError: the poses are not poses, or the shapes do not fit.
        """
        chunk_size = 4096  # Pairs solved together. They fit a processor's caches.
        X = check_pose(X_AH, "X_AH")
        if X.ndim != 3:
            raise InvalidInputError(f"X_AH has shape {X.shape}; expected (N, 4, 4)")
        values = np.asarray(q7, dtype=float)
        if values.ndim not in (1, 2) or (values.ndim == 2 and len(values) != len(X)):
            raise InvalidInputError(f"q7 has shape {values.shape}; expected (M,) or ({len(X)}, M)")
        m = values.shape[-1]
        values = np.broadcast_to(values, (len(X), m))
        X_AF = Poses.of(X) @ Poses.of(inverse(self.X_FH))
        found: list[_Solved] = [(np.empty(0, np.intp), np.empty(0, np.int8), np.empty((0, 7)))]
        step = max(1, chunk_size // max(1, m))
        for k in range(0, len(X) if m else 0, step):
            found += self._solve(_Wrist.of(X_AF[k : k + step], values[k : k + step], first=k * m))
        pair, branch, q = (np.concatenate(part) for part in zip(*found, strict=True))
        order = np.argsort(IK_BRANCHES * pair + branch)
        pair = pair[order]
        return PandaPostures(pair // max(1, m), pair % max(1, m), branch[order], q[order])

    def _solve(self, wrist: _Wrist) -> Iterator[_Solved]:
        """Solves for joint 4, then 5 and 6, then 1, 2 and 3, each within its limits."""
        full_turn = 2.0 * np.pi  # Radians.
        lower, upper = self.lower, self.upper
        for elbow, q4, bent in wrist.solve_elbow():
            kept = np.flatnonzero((lower[3] <= q4) & (q4 <= upper[3]))
            for side, q5, q6, arm in bent.select(kept).solve_wrist(q4[kept]):
                q6 = lower[5] + (q6 - lower[5]) % full_turn
                kept = np.flatnonzero((lower[4] <= q5) & (q5 <= upper[4]) & (q6 <= upper[5]))
                arm, q5, q6 = arm.select(kept), q5[kept], q6[kept]
                for back, q1, q2, q3 in arm.solve_shoulder():
                    q = np.stack([q1, q2, q3, arm.q4, q5, q6, arm.q7], axis=1)
                    inside = ((lower <= q) & (q <= upper))[:, :3].all(axis=1)
                    branch = np.full(inside.sum(), 4 * elbow + 2 * side + back, np.int8)
                    yield arm.pair[inside], branch, q[inside]


_Solved = tuple[Indices, NDArray[np.int8], Array]
"""Pairs (S,), branches (S,) and joint positions (S, 7)."""


@dataclass(frozen=True, eq=False)
class _PoseParameterPairs:
    """Arrays whose last axis belongs to the same K pairs of a pose and a parameter."""

    pair: Indices
    q7: Array

    def select(self, kept: Indices) -> Self:
        """Selects pairs by index."""
        if len(kept) == len(self.pair):
            return self
        return type(self)(**{f.name: getattr(self, f.name)[..., kept] for f in fields(self)})


@dataclass(frozen=True, eq=False)
class _Wrist(_PoseParameterPairs):
    """Position of the shoulder relative to the wrist.

    Attributes:
        v: (3, K) vectors from the wrist to the shoulder [m].
        x6, y6: (3, K) axes of frame 6.
        along: (3, K) components of v in frame 6 [m].
    """

    v: Array
    x6: Array
    y6: Array
    along: Array

    @classmethod
    def of(cls, X_AF: Poses, q7: Array, first: int) -> _Wrist:
        """From N flange poses and last joints (N, M); `first` is the number of the first pair."""
        c, s = np.cos(q7), np.sin(q7)
        x, y, z = (X_AF.R[:, :, k].T[:, :, None] for k in range(3))
        x6, z6 = c * x - s * y, s * x + c * y
        y6 = np.broadcast_to(-z, x6.shape)
        v = WRIST_OFFSET * x6 + FLANGE_LENGTH * z - X_AF.p.T[:, :, None]
        v[2] += SHOULDER_HEIGHT
        along = np.stack([_dot(v, x6), _dot(v, y6), _dot(v, z6)])
        pair = np.arange(first, first + q7.size)
        return cls(pair, q7.ravel(), *(a.reshape(3, -1) for a in (v, x6, y6, along)))

    def solve_elbow(self) -> Iterator[tuple[int, Array, _Wrist]]:
        """Solves for joint 4 from the length of the triangle's side opposite to the elbow; yields
        the elbow branch, q4 and the wrists with a solution."""
        p = UPPER_ARM_LENGTH * FOREARM_LENGTH - ELBOW_OFFSET**2
        q = -ELBOW_OFFSET * (UPPER_ARM_LENGTH + FOREARM_LENGTH)
        straight = 2.0 * ELBOW_OFFSET**2 + UPPER_ARM_LENGTH**2 + FOREARM_LENGTH**2
        cosine = (_dot(self.v, self.v) - straight) / (2.0 * np.hypot(p, q))
        reached = np.flatnonzero(np.abs(cosine) <= 1.0)
        reachable, half = self.select(reached), np.arccos(cosine[reached])
        yield 0, np.arctan2(q, p) - half, reachable
        yield 1, np.arctan2(q, p) + half, reachable

    def solve_wrist(self, q4: Array) -> Iterator[tuple[int, Array, Array, _Arm]]:
        """Solves for joints 5 and 6; yields the wrist branch, q5, q6 and the elbow plane.

        In frame 4 the shoulder lies at `across` along x4 and `h` along y4 from the wrist, and y4,
        the axis of joint 5, is perpendicular to the axis of joint 6.
        """
        c4, s4 = np.cos(q4), np.sin(q4)
        across = ELBOW_OFFSET - ELBOW_OFFSET * c4 - UPPER_ARM_LENGTH * s4
        h = ELBOW_OFFSET * s4 - UPPER_ARM_LENGTH * c4 - FOREARM_LENGTH
        x, y, z = self.along
        radius = np.sqrt(x * x + y * y)
        possible = np.flatnonzero(np.abs(h) <= radius)
        if len(possible) < len(h):
            wrist = self.select(possible)
            q4, c4, s4, across, h, radius = (a[possible] for a in (q4, c4, s4, across, h, radius))
            x, y, z = wrist.along
        else:
            wrist = self
        rest = np.sqrt(radius * radius - h * h)
        middle, half = np.arctan2(x, y), np.arctan2(rest, h)
        for side, sign in ((0, -1.0), (1, 1.0)):
            s6 = (x * h + sign * y * rest) / (radius * radius)
            c6 = (y * h - sign * x * rest) / (radius * radius)
            y4 = s6 * wrist.x6 + c6 * wrist.y6
            x4 = (wrist.v - h * y4) / across
            q5 = np.arctan2(z, -sign * rest)
            yield side, q5, middle + sign * half, _Arm(wrist.pair, wrist.q7, q4, c4, s4, x4, y4)


@dataclass(frozen=True, eq=False)
class _Arm(_PoseParameterPairs):
    """Orientation of the elbow's plane.

    Attributes:
        q4: (K,) joint 4 [rad], with its cosine and sine.
        x4, y4: (3, K) axes of frame 4.
    """

    q4: Array
    c4: Array
    s4: Array
    x4: Array
    y4: Array

    def solve_shoulder(self) -> Iterator[tuple[int, Array, Array, Array]]:
        """Solves for joints 1, 2 and 3 from the orientation of frame 3; yields the shoulder branch
        and the joints."""
        x4, y4 = self.x4, self.y4
        x3, z3 = self.c4 * x4 - self.s4 * y4, self.s4 * x4 + self.c4 * y4
        y3 = y4[1] * x4[2] - x4[1] * y4[2], x4[0] * y4[2] - y4[0] * x4[2]  # -z4, without its z
        s2 = np.sqrt(z3[0] * z3[0] + z3[1] * z3[1])
        upright = s2 == 0.0
        length = np.where(upright, 1.0, s2)
        c1, s1 = np.where(upright, 1.0, z3[0] / length), z3[1] / length
        q1, q2 = np.arctan2(s1, c1), np.arctan2(s2, z3[2])
        q3 = np.arctan2(c1 * x3[1] - s1 * x3[0], c1 * y3[1] - s1 * y3[0])
        yield 0, q1, q2, q3
        yield 1, q1 - np.copysign(np.pi, q1), -q2, q3 - np.copysign(np.pi, q3)


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


PANDA_DH_PARAMETERS = (
    (0.0, SHOULDER_HEIGHT, 0.0),
    (0.0, 0.0, -np.pi / 2),
    (0.0, UPPER_ARM_LENGTH, np.pi / 2),
    (ELBOW_OFFSET, 0.0, np.pi / 2),
    (-ELBOW_OFFSET, FOREARM_LENGTH, -np.pi / 2),
    (0.0, 0.0, np.pi / 2),
    (WRIST_OFFSET, 0.0, np.pi / 2),
)
"""Craig's parameters a [m], d [m] and alpha [rad] of each joint."""


def panda_forward(q: ArrayLike) -> Array:
    """Flange poses `X_AF` (N, 4, 4) of joint positions (N, 7) [rad], by `PANDA_DH_PARAMETERS`."""
    positions = np.asarray(q, dtype=float).T
    cosines, sines = np.cos(positions), np.sin(positions)
    x, y, z = np.repeat(np.eye(3)[:, :, None], positions.shape[1], axis=2)
    p = np.zeros_like(x)
    for (a, d, alpha), c, s in zip(PANDA_DH_PARAMETERS, cosines, sines, strict=True):
        y, z = np.cos(alpha) * y + np.sin(alpha) * z, np.cos(alpha) * z - np.sin(alpha) * y
        p = p + a * x + d * z
        x, y = c * x + s * y, c * y - s * x
    X = np.zeros((positions.shape[1], 4, 4))
    for k, column in enumerate((x, y, z, p + FLANGE_LENGTH * z)):
        X[:, :3, k] = column.T
    X[:, 3, 3] = 1.0
    return X
