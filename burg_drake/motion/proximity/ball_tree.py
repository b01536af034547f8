"""A tree of balls around each body of the robot: balls around balls around what covers the body.

All trees have the same depth and lie in one set of arrays, so that different nodes of different
bodies are looked at in one go.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, Indices, Single
from burg_drake.motion.ik import ArmLinks, LinkPoses
from burg_drake.motion.proximity.cover import Balls, cover_body
from burg_drake.station.diagram import StationDiagram

ARM_OVERSHOOT = 8e-3
"""How far balls stick out of the moving links [m]; capsules' half as far."""
HAND_OVERSHOOT = 8e-3
"""The same of the hand."""
BASE_OVERSHOOT = 25e-3
"""The same of links that do not move, which only the arm itself can hit."""
DEPTH = 3
"""Levels of a tree."""
NOWHERE = -1e3
"""Radius of a ball that is not there [m]."""


@dataclass(frozen=True, eq=False)
class BodyBalls:
    """A body of the robot.

    Attributes:
        body, frame: the body and the arm's frame in which it is fixed.
        center, radius: (3,), [m] of a ball around it.
        balls: that cover it, in the frame.
        root: the first node of its tree.
    """

    body: BodyIndex
    frame: int
    center: Array
    radius: float
    balls: Balls
    root: int


@dataclass(frozen=True, eq=False)
class BallTrees:
    """T nodes of up to W balls each, the balls' arrays with one row for each place in a node.

    Attributes:
        bodies: those of the robot that have collision geometry, ordered by frames.
        frame: (T,) the arm's frame in which a node is fixed.
        centers: (3, W, T) [m].
        outer: (W, T) radii of balls that together contain the node's part of the body [m].
        inner: (W, T) radii of balls about the same centres inside the body, in leaves [m].
        child: (W, T) the node within the ball; -1 in leaves and where there is no ball.
    """

    bodies: tuple[BodyBalls, ...]
    frame: Indices
    centers: Single
    outer: Single
    inner: Single
    child: Indices

    @cached_property
    def _frames(self) -> Indices:
        return np.array([body.frame for body in self.bodies], dtype=np.intp)

    @cached_property
    def _centers(self) -> Single:
        return np.array([body.center for body in self.bodies], dtype=np.float32)

    @classmethod
    def of(cls, station_diagram: StationDiagram, links: ArmLinks) -> BallTrees:
        """Covers the robot of a diagram."""
        plant = station_diagram.plant
        inspector = station_diagram.scene_graph.model_inspector()
        hand = set(plant.GetBodyIndices(plant.GetModelInstanceByName("hand")))
        bodies: list[BodyBalls] = []
        nodes: list[_Node] = []
        for body in bodies_with_shape(station_diagram, links):
            geometries = plant.GetCollisionGeometriesForBody(plant.get_body(body))
            frame = links.frame_of[body]
            overshoot = HAND_OVERSHOOT if body in hand else ARM_OVERSHOOT
            balls = cover_body(inspector, geometries, overshoot if frame else BASE_OVERSHOOT)
            balls = balls.moved(links.X_FB[body])
            root = _plant(nodes, balls, frame, DEPTH)
            bodies.append(BodyBalls(body, frame, *_around(balls), balls, root))
        width = max(len(node.balls.outer) for node in nodes)
        centers = np.zeros((3, width, len(nodes)), dtype=np.float32)
        outer, inner = np.full((2, width, len(nodes)), NOWHERE, dtype=np.float32)
        child = np.full((width, len(nodes)), -1, dtype=np.intp)
        for t, node in enumerate(nodes):
            size = len(node.balls.outer)
            centers[:, :size, t] = node.balls.center.T
            outer[:size, t], inner[:size, t] = node.balls.outer, node.balls.inner
            child[: len(node.children), t] = node.children
        frames = np.array([node.frame for node in nodes], dtype=np.intp)
        return cls(tuple(bodies), frames, centers, outer, inner, child)

    def roots_placed(self, poses: LinkPoses) -> Single:
        """(3, B, K) centres of the balls around the bodies."""
        return poses.place_own(self._frames, self._centers)

    def placed(self, node: Indices, poses: LinkPoses, which: Indices) -> Single:
        """(3, W, F) centres of the balls of nodes (F,) in configurations `which` (F,)."""
        centers = self.centers.take(node, axis=2)
        return poses.place_each(self.frame[node], centers, which)


def bodies_with_shape(station_diagram: StationDiagram, links: ArmLinks) -> list[BodyIndex]:
    """Bodies of the robot that have collision geometry, ordered by frames."""
    plant = station_diagram.plant
    return [
        body
        for body, _ in sorted(links.frame_of.items(), key=lambda item: (item[1], int(item[0])))
        if plant.GetCollisionGeometriesForBody(plant.get_body(body))
    ]


@dataclass
class _Node:
    frame: int
    balls: Balls
    children: list[int]


def _plant(nodes: list[_Node], balls: Balls, frame: int, depth: int) -> int:
    """Appends a tree to the nodes; returns the place of its root."""
    place = len(nodes)
    node = _Node(frame, balls, [])
    nodes.append(node)
    if depth > 1:
        count = len(balls.outer)
        parts = _parts(balls, int(np.ceil(np.round(count ** (1.0 / depth), 9))))
        around = [_around(part) for part in parts]
        centers, radii = np.array([c for c, _ in around]), np.array([r for _, r in around])
        node.balls = Balls(centers, radii, np.full(len(parts), NOWHERE))
        node.children = [_plant(nodes, part, frame, depth - 1) for part in parts]
    return place


def _around(balls: Balls) -> tuple[Array, float]:
    """A ball around balls, nearly the smallest: its centre steps towards what lies farthest out
    (Badoiu and Clarkson, "Smaller core-sets for balls", SODA 2003)."""
    center = (balls.center.min(axis=0) + balls.center.max(axis=0)) / 2
    best = (center, np.inf)
    for step in range(20):
        offsets = balls.center - center
        distance = np.sqrt((offsets * offsets).sum(axis=1))
        reach = distance + balls.outer
        far = int(reach.argmax())
        if reach[far] < best[1]:
            best = (center, float(reach[far]))
        if distance[far] < 1e-9:
            break
        center = center + offsets[far] / distance[far] * reach[far] / (step + 2)
    return best


def _parts(balls: Balls, count: int) -> list[Balls]:
    """Cuts the balls into parts of about equal size, again and again across the longest side."""
    if count <= 1:
        return [balls]
    order = np.argsort(balls.center[:, np.ptp(balls.center, axis=0).argmax()], kind="stable")
    first = count // 2
    cut = round(len(order) * first / count)
    parts = []
    for chosen, share in ((order[:cut], first), (order[cut:], count - first)):
        part = Balls(balls.center[chosen], balls.outer[chosen], balls.inner[chosen])
        parts += _parts(part, min(share, len(chosen)))
    return parts
