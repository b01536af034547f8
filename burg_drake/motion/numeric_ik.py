"""A serial arm with its hand, and its numeric inverse kinematics: Levenberg-Marquardt in numpy.

Many poses are solved at a time, each from a start of its own.

Joints are revolute or prismatic, in series. The kinematics is read once from a Drake plant as a
product of exponentials (Lynch and Park, "Modern Robotics", 2017, chapter 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint, PrismaticJoint, RevoluteJoint

from burg_drake.core import Array, InvalidInputError
from burg_drake.station import StationDiagram


@dataclass(frozen=True, eq=False)
class ArmKinematics:
    """A serial arm with n joints on its base frame A, carrying the hand body H.

    Attributes:
        turns: (n,) 1 for revolute joints, 0 for prismatic ones.
        axis: (n, 3) directions of the joint axes in A at q = 0.
        p_AJ: (n, 3) a point on each axis at q = 0 [m].
        X_AH0: (4, 4) hand body at q = 0.
        lower, upper: (n,) joint limits [rad or m].
    """

    turns: Array
    axis: Array
    p_AJ: Array
    X_AH0: Array
    lower: Array
    upper: Array

    @classmethod
    def from_plant(
        cls, plant: MultibodyPlant, joints: Sequence[Joint], base: Frame, hand: Frame
    ) -> ArmKinematics:
        """Reads the kinematics of `joints`, ordered from base to hand.

        Raises:
            InvalidInputError: a joint is neither revolute nor prismatic.
        """
        max_range = 2.0 * np.pi  # Radians or metres, for joints without limits.
        context = plant.CreateDefaultContext()
        positions = plant.GetPositions(context)
        for joint in joints:
            if not isinstance(joint, (RevoluteJoint, PrismaticJoint)):
                raise InvalidInputError(
                    f"arm joint {joint.name()!r} is {joint.type_name()}; inverse kinematics"
                    " supports revolute and prismatic joints"
                )
            positions[joint.position_start()] = 0.0
        plant.SetPositions(context, positions)
        X_AF = [j.frame_on_parent().CalcPose(context, base).GetAsMatrix4() for j in joints]
        revolute = [isinstance(j, RevoluteJoint) for j in joints]
        axis_F = [
            j.revolute_axis() if turns else j.translation_axis()
            for j, turns in zip(joints, revolute, strict=True)
        ]
        return cls(
            turns=np.array(revolute, dtype=float),
            axis=np.array([X[:3, :3] @ a for X, a in zip(X_AF, axis_F, strict=True)]),
            p_AJ=np.array([X[:3, 3] for X in X_AF]),
            X_AH0=hand.CalcPose(context, base).GetAsMatrix4(),
            lower=np.array([max(j.position_lower_limits()[0], -max_range) for j in joints]),
            upper=np.array([min(j.position_upper_limits()[0], max_range) for j in joints]),
        )

    @classmethod
    def of(cls, station_diagram: StationDiagram) -> ArmKinematics:
        """Reads the arm of a diagram built with `robot="arm"`, with the hand that it carries."""
        plant, station = station_diagram.plant, station_diagram.station
        arm, hand = (plant.GetModelInstanceByName(name) for name in ("arm", "hand"))
        assert station.document.arm is not None
        return cls.from_plant(
            plant,
            station_diagram.arm_joints,
            base=plant.GetFrameByName(station.document.arm.base, arm),
            hand=plant.GetFrameByName(station.hand.body, hand),
        )

    def unlimited(self) -> ArmKinematics:
        """The same arm without joint limits."""
        infinite = np.full(len(self.lower), np.inf)
        return replace(self, lower=-infinite, upper=infinite)

    def one_revolution_around(self, posture: Array, margin: float) -> tuple[Array, Array]:
        """Joint limits for planning, in which each hand pose occurs about once.

        Args:
            posture: (n,) joint positions.
            margin: distance to keep from the joint limits [rad or m].

        Returns:
            (n,) smallest and (n,) largest positions: the joint limits. Revolute joints with a range
            of a whole turn or more are limited to slightly more than half a turn from `posture`.
        """
        # Radians from home. Straight segments need a little more than half a turn.
        max_turn = np.pi + 0.5
        wide = (self.turns == 1.0) & (self.upper - self.lower >= 2.0 * np.pi - 1e-6)
        half = np.where(wide, max_turn, np.inf)
        lower, upper = self.lower + margin, self.upper - margin
        return np.maximum(lower, posture - half), np.minimum(upper, posture + half)

    def wrapped_near(self, q: Array, posture: Array) -> Array:
        """Turns revolute joints by whole turns.

        Args:
            q: (N, n) joint positions.
            posture: (n,) joint positions within the limits.

        Returns:
            (N, n) positions with the same hand poses, each joint within its limits if possible, and
            then as near to `posture` as possible.
        """
        turn = 2.0 * np.pi
        near = posture + (q - posture + np.pi) % turn - np.pi
        near = np.where((near > self.upper) & (near - turn >= self.lower), near - turn, near)
        near = np.where((near < self.lower) & (near + turn <= self.upper), near + turn, near)
        return np.where(self.turns == 1.0, near, q)

    @cached_property
    def _generators(self) -> tuple[Array, Array, Array]:
        """(n, 4, 4) matrices that multiply sin(q), 1 - cos(q) and q in the joint exponentials."""
        sine, cosine, linear = np.zeros((3, len(self.turns), 4, 4))
        S = np.cross(np.eye(3), self.axis[:, None, :] * self.turns[:, None, None])
        for block, rotation in ((sine, S), (cosine, S @ S)):
            block[:, :3, :3] = rotation
            block[:, :3, 3] = -(rotation @ self.p_AJ[..., None])[..., 0]
        linear[:, :3, 3] = (1.0 - self.turns)[:, None] * self.axis
        return sine, cosine, linear

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Hand poses and Jacobians.

        Args:
            q: (N, n) joint positions.

        Returns:
            `X_AH` (N, 4, 4), and the Jacobians (N, 6, n): angular [1/s] over translational [m/s]
            velocity of H in A for a unit rate of each joint.
        """
        sine, cosine, linear = self._generators
        s, c, t = np.sin(q), 1.0 - np.cos(q), q
        E = np.eye(4) + s[..., None, None] * sine + c[..., None, None] * cosine
        E += t[..., None, None] * linear
        n = q.shape[1]
        X = np.empty((len(q), n + 1, 4, 4))
        X[:, 0] = np.eye(4)
        for i in range(n):
            np.matmul(X[:, i], E[:, i], out=X[:, i + 1])
        X_AH = X[:, n] @ self.X_AH0
        R, p = X[:, :n, :3, :3], X[:, :n, :3, 3]
        axis = (R @ self.axis[..., None])[..., 0]
        lever = X_AH[:, None, :3, 3] - p - (R @ self.p_AJ[..., None])[..., 0]
        turns = self.turns[:, None]
        J = np.empty((len(q), 6, n))
        J[:, :3] = (turns * axis).swapaxes(-1, -2)
        J[:, 3:] = (turns * _cross(axis, lever) + (1.0 - turns) * axis).swapaxes(-1, -2)
        return X_AH, J


def solve_ik(
    arm: ArmKinematics,
    X_AH: Array,
    start: Array,
    *,
    iterations: int,
    tolerance: float,
    margin: float = 0.0,
) -> tuple[Array, NDArray[np.bool_]]:
    """Iterates every start towards its goal within the joint limits.

    Args:
        arm: the arm.
        X_AH: (N, 4, 4) wanted hand poses.
        start: (N, n) joint positions to start at.
        iterations: largest number of steps.
        tolerance: a goal counts as met below this position [m] and rotation [rad] error.
        margin: distance to keep from the joint limits [rad or m].

    Returns:
        (N, n) joint positions, and (N,) whether they meet the goal.
    """
    damping_factor = 1e-2  # Ratio of the damping of the normal equations to the squared error.
    min_damping = 1e-12  # Damping that singular postures need.
    lower, upper = arm.lower + margin, arm.upper - margin
    found = np.clip(start, lower, upper)
    met = np.zeros(len(found), dtype=bool)
    left = np.arange(len(found))  # solved rows are frozen, so that batches do not matter
    q = found.copy()
    for step in range(iterations + 1):
        error, J = _pose_error(arm, X_AH[left], q)
        done = (np.abs(error) < tolerance).all(axis=-1)
        found[left], met[left] = q, done
        if done.any():
            left, q, error, J = left[~done], q[~done], error[~done], J[~done]
        if not len(left) or step == iterations:
            break
        damping = min_damping + damping_factor * (error**2).sum(axis=-1)
        transposed = J.swapaxes(-1, -2)
        A = J @ transposed + damping[:, None, None] * np.eye(6)
        q = np.clip(q + (transposed @ np.linalg.solve(A, error[..., None]))[..., 0], lower, upper)
    return found, met


def _pose_error(arm: ArmKinematics, X_AH: Array, q: Array) -> tuple[Array, Array]:
    """(N, 6) remaining rotation vector [rad] and translation [m], and the Jacobians at q."""
    X, J = arm.forward(q)
    error = np.empty((len(q), 6))
    error[:, :3] = rotation_vector(X_AH[:, :3, :3] @ X[:, :3, :3].swapaxes(-1, -2))
    error[:, 3:] = X_AH[:, :3, 3] - X[:, :3, 3]
    return error, J


def rotation_vector(R: Array) -> Array:
    """(N, 3, 3) rotations -> (N, 3) axis times angle [rad]. At half a turn, where the formula does
    not determine the axis, it takes x, which is good enough for a search step."""
    v = 0.5 * np.stack(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=-1
    )
    sine = np.sqrt((v**2).sum(axis=-1))
    angle = np.arctan2(sine, 0.5 * (R[:, 0, 0] + R[:, 1, 1] + R[:, 2, 2] - 1.0))
    small = sine < 1e-9
    v *= np.where(small, 1.0, angle / np.where(small, 1.0, sine))[:, None]
    v[small & (angle > 1.0)] = (np.pi, 0.0, 0.0)
    return v


def _cross(a: Array, b: Array) -> Array:
    """Cross products (..., 3); several times faster than numpy's on small batches."""
    c = a[..., (1, 2, 0)] * b[..., (2, 0, 1)] - a[..., (2, 0, 1)] * b[..., (1, 2, 0)]
    return np.asarray(c)
