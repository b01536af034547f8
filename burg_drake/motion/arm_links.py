"""Forward kinematics of all links of a serial arm at once, for large batches.

Arrays are of single precision, one per coordinate, with the configurations of a batch side by
side. Every operation is elementwise, so that no result depends on the rest of the batch.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from pydrake.math import RotationMatrix
from pydrake.multibody.tree import BodyIndex, Joint, PrismaticJoint, RevoluteJoint

from burg_drake.core import Array, Indices, InvalidInputError, Single, inverse, make_pose
from burg_drake.station import StationDiagram


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Poses in the world of the frame after each joint, K configurations side by side.

    Attributes:
        table: (4, 3, frames, K) x, y and z axis of the frames, and their origins [m].
    """

    table: Single

    def z(self, frame: int) -> Single:
        """(3, K) axis z of a frame, about or along which its joint moves it."""
        return self.table[2, :, frame]

    def p(self, frame: int) -> Single:
        """(3, K) origin of a frame [m]."""
        return self.table[3, :, frame]

    def transform_points(self, frame: int, points: Single) -> Single:
        """(3, M, K) points in the world, given as points (M, 3) in a frame."""
        return _transform_points(self.table[:, :, frame, None], points.T[:, :, None])

    def transform_per_frame(self, frames: Indices, points: Single) -> Single:
        """(3, B, K) points in the world, given as points (B, 3) in frames (B,)."""
        return _transform_points(self.table.take(frames, axis=2), points.T[:, :, None])

    def transform_per_node(self, frame: Indices, centers: Single, which: Indices) -> Single:
        """(3, M, F) points in the world, given as points (3, M, F) in frames (F,) of configurations
        `which` (F,)."""
        flat = self.table.reshape(12, -1)
        poses = flat.take(frame * self.table.shape[3] + which, axis=1)
        return _transform_points(poses.reshape(4, 3, 1, -1), centers)


def _transform_points(poses: Single, points: Single) -> Single:
    """Transforms points (3, ...) by frame poses (4, 3, ...)."""
    x, y, z, p = poses
    placed: Single = x * points[0]
    product = y * points[1]
    placed += product
    np.multiply(z, points[2], out=product)
    placed += product
    placed += p
    return placed


@dataclass(frozen=True, eq=False)
class ArmLinks:
    """A serial arm with n joints: frame 0 is the world, joint i moves frame i about or along its z.

    Attributes:
        X_before: (n, 4, 4) pose of each joint's frame at position 0 in the frame before it.
        turns: per joint whether it turns; it slides otherwise.
        frame_of: the frame in which each body of the robot is fixed.
        X_FB: (4, 4) pose of each body of the robot in that frame; fingers as in the default
            context.
    """

    X_before: Array
    turns: tuple[bool, ...]
    frame_of: dict[BodyIndex, int]
    X_FB: dict[BodyIndex, Array]

    @classmethod
    def from_diagram(cls, station_diagram: StationDiagram) -> ArmLinks:
        """Reads the arm of a station diagram.

        Raises:
            InvalidInputError: a joint of the arm neither turns nor slides.
        """
        plant, joints = station_diagram.plant, station_diagram.arm_joints
        context = plant.CreateDefaultContext()
        positions = plant.GetPositions(context)
        positions[[joint.position_start() for joint in joints]] = 0.0
        plant.SetPositions(context, positions)
        frame_of = dict.fromkeys(station_diagram.robot_bodies, 0)
        X_WF = [np.eye(4)]
        for i, joint in enumerate(joints):
            X_WJ = joint.frame_on_parent().CalcPoseInWorld(context).GetAsMatrix4()
            X_WF.append(X_WJ @ make_pose(_rotation_from_z(joint)))
            moved = plant.GetBodiesKinematicallyAffectedBy([joint.index()])
            frame_of |= {body: i + 1 for body in moved if body in frame_of}
        X_FB = {}
        for body, frame in frame_of.items():
            X_WB = plant.EvalBodyPoseInWorld(context, plant.get_body(body)).GetAsMatrix4()
            X_FB[body] = inverse(X_WF[frame]) @ X_WB
        X_before = [inverse(a) @ b for a, b in itertools.pairwise(X_WF)]
        turns = tuple(isinstance(joint, RevoluteJoint) for joint in joints)
        return cls(np.array(X_before), turns, frame_of, X_FB)

    def relative_poses(self, joints: tuple[int, ...], positions: Array) -> Array:
        """(C, 4, 4) poses of the frame after m neighbouring joints in the frame before them, at
        joint positions (C, m) [rad or m]."""
        X = np.tile(np.eye(4), (len(positions), 1, 1))
        for joint, position in zip(joints, positions.T, strict=True):
            moved = np.tile(np.eye(4), (len(positions), 1, 1))
            if self.turns[joint]:
                moved[:, 0, 0] = moved[:, 1, 1] = np.cos(position)
                moved[:, 1, 0] = np.sin(position)
                moved[:, 0, 1] = -moved[:, 1, 0]
            else:
                moved[:, 2, 3] = position
            X = X @ (self.X_before[joint] @ moved)
        return X

    def poses(self, q: Array) -> LinkPoses:
        """Poses of all frames at arm positions `q` (K, n) [rad or m]."""
        table = np.zeros((4, 3, len(self.turns) + 1, len(q)), dtype=np.float32)
        for i in range(3):
            table[i, i, 0] = 1.0
        x, y, z, p = table[:, :, 0]
        positions = np.ascontiguousarray(q.T, dtype=np.float32)
        cosines, sines = np.cos(positions), np.sin(positions)
        for i, (X, turns) in enumerate(zip(self.X_before, self.turns, strict=True)):
            p = _combine_axes((x, y, z), X[:3, 3], p)
            x, y, z = (_combine_axes((x, y, z), X[:3, k]) for k in range(3))
            if turns:
                cos, sin = cosines[i], sines[i]
                x, y = cos * x + sin * y, cos * y - sin * x
            else:
                p = p + positions[i] * z
            for k, part in enumerate((x, y, z, p)):
                table[k, :, i + 1] = part
        return LinkPoses(table)


def _combine_axes(
    axes: tuple[Single, Single, Single], factors: Array, start: Single | None = None
) -> Single:
    """`start` plus the axes times (3,) factors; factors of 0 and 1 cost nothing."""
    total = start
    for axis, factor in zip(axes, factors, strict=True):
        if abs(factor) < 1e-12:
            continue
        term = axis if abs(factor - 1.0) < 1e-12 else axis * np.float32(factor)
        total = term if total is None else total + term
    assert total is not None  # a column of a rotation is not zero
    return total


def _rotation_from_z(joint: Joint) -> Array:
    """(3, 3) rotation that turns z onto the joint's axis.

    Raises:
        InvalidInputError: the joint neither turns nor slides.
    """
    if isinstance(joint, RevoluteJoint):
        axis = joint.revolute_axis()
    elif isinstance(joint, PrismaticJoint):
        axis = joint.translation_axis()
    else:
        raise InvalidInputError(
            f"arm joint {joint.name()!r} is {joint.type_name()}; the joints of an arm must be"
            " revolute or prismatic"
        )
    if np.allclose(axis, (0.0, 0.0, 1.0), atol=1e-12):
        return np.eye(3)
    return np.asarray(RotationMatrix.MakeFromOneVector(axis, 2).matrix())
