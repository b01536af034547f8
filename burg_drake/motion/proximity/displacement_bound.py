"""How far an arm moves at most on a straight segment between two configurations."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array, Single
from burg_drake.motion.ik import ArmLinks, LinkPoses
from burg_drake.motion.proximity.ball_tree import BallTrees, BodyBalls

ROUNDING = 1e-5
"""Far above what single precision does to a distance within some metres [m]."""


def joint_reaches(links: ArmLinks, bodies: tuple[BodyBalls, ...], limits: Array) -> Array:
    """(n,) largest distance [m] from the origin of each joint's frame to a point of the bodies
    beyond it, at any positions within limits (n, 2); links in between are at most stretched out.
    """
    n = len(links.turns)
    beyond = np.full(n, -np.inf)
    for i in reversed(range(n)):
        for body in bodies:
            if body.frame == i + 1:
                own = np.linalg.norm(body.balls.center, axis=1) + body.balls.outer
                beyond[i] = max(beyond[i], own.max())
        if i + 1 < n:
            reach = np.linalg.norm(links.X_before[i + 1][:3, 3])
            if not links.turns[i + 1]:
                reach += np.abs(limits[i + 1]).max()
            beyond[i] = max(beyond[i], beyond[i + 1] + reach)
    return np.maximum(beyond, 0.0)


class DisplacementBound:
    """Bounds the way of every point of the robot.

    While joint i turns by d, a point at distance r from its axis moves by r d. What r may become
    on a segment is bounded from its values at the two ends: it changes by no more than the way
    that the joints beyond i move the point.

    Args:
        links: the arm.
        trees: balls that cover it and its hand.
        limits: (n, 2) of the joints' positions [rad or m].
    """

    def __init__(self, links: ArmLinks, trees: BallTrees, limits: Array) -> None:
        self._links = links
        self._trees = trees
        self._reach = joint_reaches(links, trees.bodies, limits)
        frames = [body.frame for body in trees.bodies]  # rising
        self._first_beyond = np.searchsorted(frames, np.arange(len(links.turns)), side="right")
        self._radius = np.array([body.radius + ROUNDING for body in trees.bodies])[:, None]

    def between(self, q_a: Array, q_b: Array) -> Array:
        """Upper bounds (K,) [m] for segments from `q_a` to `q_b` (K, n) within the limits."""
        displacement = np.abs(q_b - q_a).T
        of_all = self._from_axes(np.concatenate([q_a, q_b]))
        ends = of_all[:, : len(q_a)] + of_all[:, len(q_a) :]
        total = np.zeros(displacement.shape[1])
        for i in reversed(range(len(displacement))):
            if self._links.turns[i]:
                total += displacement[i] * np.minimum(self._reach[i], (ends[i] + total) / 2)
            else:
                total += displacement[i]
        return total

    def _from_axes(self, q: Array) -> Array:
        """(n, K) largest distance of a point beyond each joint from its axis."""
        poses = self._links.poses(q)
        centers = self._trees.roots_placed(poses)
        largest = np.zeros((len(self._links.turns), len(q)))
        for i, turns in enumerate(self._links.turns):
            if turns:
                beyond = slice(self._first_beyond[i], None)
                distance = from_axis(poses, i + 1, centers[:, beyond]) + self._radius[beyond]
                largest[i] = distance.max(axis=0, initial=0.0)
        return largest


def from_axis(poses: LinkPoses, frame: int, p: Single) -> Array:
    """(..., K) distances of points (3, ..., K) from the z axis of a frame."""
    x, y, z = (a - b for a, b in zip(p, poses.p(frame), strict=True))
    a, b, c = poses.z(frame)
    u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
    return np.asarray(np.sqrt(u * u + v * v + w * w))
