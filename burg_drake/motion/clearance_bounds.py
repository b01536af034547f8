"""Bounds on the clearance of an arm in a scene, for thousands of configurations at a time.

A configuration is free where the lower bound is above zero, and in collision where the upper bound
is below zero. In between, Drake's checker has to decide.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, Indices, InvalidInputError, Single, content_hash
from burg_drake.grasping import shape_of
from burg_drake.motion.arm_links import ArmLinks, LinkPoses
from burg_drake.motion.arm_shape import ArmShape
from burg_drake.motion.ball_tree import BallTrees, BodyBalls
from burg_drake.motion.distance_field import DistanceField, ProximitySolid, solid_of, solids_hash
from burg_drake.station import StationDiagram


class Bounding:
    """Accuracy and batch sizes of the bounds."""

    rounding = 1e-5  # Metres. Far above single precision within some metres.
    block_size = 2**12  # Configurations evaluated together. They fit a processor's caches.
    chunk_size = 2**13  # Tree nodes evaluated together, for the same reason.
    refine_below = 0.022  # Metres. Balls with a smaller lower bound are opened.
    likely_free_above = -0.008  # Metres. Lower bound above which a configuration is likely free.


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
    """Bounds the path length of every point of the robot.

    While joint i turns by d, a point at distance r from its axis moves by r d. On a segment, r is
    bounded from its values at the two ends: it changes by no more than the path length by which
    the joints beyond i move the point.

    Args:
        links: the arm.
        trees: balls that cover it and its hand.
        limits: (n, 2) limits of the joints' positions [rad or m].
    """

    def __init__(self, links: ArmLinks, trees: BallTrees, limits: Array) -> None:
        self._links = links
        self._trees = trees
        self._reach = joint_reaches(links, trees.bodies, limits)
        frames = [body.frame for body in trees.bodies]  # rising
        self._first_beyond = np.searchsorted(frames, np.arange(len(links.turns)), side="right")
        self._radius = np.array([body.radius + Bounding.rounding for body in trees.bodies])[:, None]

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
        """(n, K) largest distance from each joint's axis to a point of the bodies beyond it."""
        poses = self._links.poses(q)
        centers = self._trees.body_ball_centers(poses)
        largest = np.zeros((len(self._links.turns), len(q)))
        for i, turns in enumerate(self._links.turns):
            if turns:
                beyond = slice(self._first_beyond[i], None)
                distance = (
                    distance_from_axis(poses, i + 1, centers[:, beyond]) + self._radius[beyond]
                )
                largest[i] = distance.max(axis=0, initial=0.0)
        return largest


def distance_from_axis(poses: LinkPoses, frame: int, p: Single) -> Array:
    """(..., K) distances of points (3, ..., K) from the z axis of a frame."""
    x, y, z = (a - b for a, b in zip(p, poses.p(frame), strict=True))
    a, b, c = poses.z(frame)
    u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
    return np.asarray(np.sqrt(u * u + v * v + w * w))


@dataclass(frozen=True, eq=False)
class ClearanceBounds:
    """Bounds on clearances from the scene, and of the arm from itself.

    Pairs of links that cannot meet within the joint limits are left out. Values below zero mean a
    collision (upper) or a possible one (lower); as depths they are only rough.

    Attributes:
        lower: (N,) lower bounds [m]; above zero, the configuration is proven free.
        upper: (N,) below zero where a collision is proven, else infinite [m].
    """

    lower: Array
    upper: Array

    @property
    def free(self) -> np.ndarray:
        """(N,) whether the configuration is proven free."""
        return self.lower > 0.0

    @property
    def blocked(self) -> np.ndarray:
        """(N,) whether a collision is proven."""
        return self.upper < 0.0

    @property
    def likely_free(self) -> np.ndarray:
        """(N,) the best guess without Drake's checker."""
        return (self.lower > Bounding.likely_free_above) & ~self.blocked


class ArmProximity:
    """Bounds the clearance of an arm and its open hand from the scene and from itself.

    Attributes:
        links: the arm's forward kinematics.
        field: distances from the scene.
        content: hash of the inputs of the bounds.
        apart: pairs of the robot's bodies that are proven not to meet within the joint limits.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        """Reads the diagram; nothing of it is kept.

        Args:
            station_diagram: built with `robot="arm"` and `weld_objects=True`.

        Raises:
            InvalidInputError: the diagram has no arm, or a shape or joint that is not known.
        """
        if station_diagram.robot != "arm":
            raise InvalidInputError(
                f"the diagram was built with robot={station_diagram.robot!r}; build it with 'arm'"
            )
        plant = station_diagram.plant
        shape = ArmShape.of(station_diagram)
        self.links = shape.links
        solids = _fixed_solids(station_diagram)
        self.field = DistanceField.of(solids)
        self.content = content_hash(shape.content, solids_hash(solids))
        self._trees, self._self_clearance = shape.trees, shape.self_clearance
        self._bodies = self._trees.bodies
        hand = set(plant.GetBodyIndices(plant.GetModelInstanceByName("hand")))
        moving = [i for i, body in enumerate(self._bodies) if body.frame]
        self._moving = np.array(moving, dtype=np.intp)
        links = [i for i in moving if self._bodies[i].body not in hand]
        self._arm = np.array(links, dtype=np.intp)
        self._radius = np.array([b.radius for b in self._bodies], dtype=np.float32)[:, None]
        self._roots = np.array([body.root for body in self._bodies])
        bodies = [body.body for body in self._bodies]
        self.apart = [(bodies[i], bodies[j]) for i, j in self._self_clearance.apart]
        self._displacement = DisplacementBound(self.links, self._trees, shape.limits)

    def bounds(self, q: Array, *, hand: bool = True) -> ClearanceBounds:
        """Bounds at arm positions `q` (N, n).

        Args:
            q: positions [rad or m].
            hand: whether hand and fingers, open as in the default context, count against the
                scene; against the arm's own links they always do.
        """
        q = np.asarray(q, dtype=float)
        lower = np.empty(len(q))
        upper = np.empty(len(q))
        for start in range(0, len(q), Bounding.block_size):
            block = slice(start, start + Bounding.block_size)
            lower[block], upper[block] = self._bounds(q[block], hand)
        return ClearanceBounds(lower - Bounding.rounding, upper + Bounding.rounding)

    def displacement(self, q_a: Array, q_b: Array) -> Array:
        """Largest displacement of any point of the robot, with the hand's fingers open.

        It also bounds how far two parts of the robot approach each other, as only the joints
        between them matter. So if the lower bounds at the two ends add up to more than this, the
        whole segment is free.

        Args:
            q_a, q_b: (N, n) ends of straight segments, within the joints' limits.

        Returns:
            (N,) upper bounds [m].
        """
        q_a, q_b = np.asarray(q_a, dtype=float), np.asarray(q_b, dtype=float)
        found = np.empty(len(q_a))
        for start in range(0, len(q_a), Bounding.block_size):
            block = slice(start, start + Bounding.block_size)
            found[block] = self._displacement.between(q_a[block], q_b[block])
        return found

    def _bounds(self, q: Array, hand: bool) -> tuple[Single, Single]:
        poses = self.links.poses(q)
        centers = self._trees.body_ball_centers(poses)
        counted = self._moving if hand else self._arm
        bound = self.field.lower_at(centers[:, counted]) - self._radius[counted]
        row, which = np.nonzero(bound < Bounding.refine_below)
        bound[row, which] = np.inf
        lower = bound.min(axis=0, initial=np.inf)
        upper = np.full_like(lower, np.inf)
        self._descend(poses, which, self._roots[counted[row]], lower, upper)
        low, up = self._self_clearance.bounds(q, poses, centers, upper >= -Bounding.rounding)
        lower, upper = np.minimum(lower, low), np.minimum(upper, up)
        return lower, np.where(upper < -Bounding.rounding, upper, np.float32(np.inf))

    def _descend(
        self, poses: LinkPoses, which: Indices, node: Indices, lower: Single, upper: Single
    ) -> None:
        """Lowers `lower` and `upper` by the distances of tree nodes (F,) from the scene in
        configurations `which` (F,)."""
        trees = self._trees
        for start in range(0, len(which), Bounding.chunk_size):
            part = slice(start, start + Bounding.chunk_size)
            k, at = which[part], node[part]
            places = trees.node_ball_centers(at, poses, k)
            bound = self.field.lower_at(places) - trees.outer.take(at, axis=1)
            if trees.child[0, at[0]] >= 0:
                i, f = np.nonzero(bound < Bounding.refine_below)
                bound[i, f] = np.inf
                self._descend(poses, k[f], trees.child[i, at[f]], lower, upper)
            else:
                i, f = np.nonzero(bound <= 0.0)
                if len(f):
                    up = self.field.upper_at(places[:, i, f]) - trees.inner[i, at[f]]
                    np.minimum.at(upper, k[f], up)
            np.minimum.at(lower, k, bound.min(axis=0))


def _fixed_solids(station_diagram: StationDiagram) -> list[ProximitySolid]:
    """Collision geometry of everything but the robot, at its default pose."""
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    context = plant.CreateDefaultContext()
    robot = set(station_diagram.robot_bodies)
    solids = []
    for geometry in inspector.GetAllGeometryIds():
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        if body.index() in robot or inspector.GetProximityProperties(geometry) is None:
            continue
        X_WB = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
        X_BP = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        solids.append(solid_of(shape_of(inspector, geometry, X_BP), X_WB))
    return solids
