"""What the quick bounds need to know of an arm and its hand, whatever stands around them.

To find it takes longer than all else, and one process builds many diagrams of the same robot, one
process after the other: so it is kept, by content, in memory and in the user's cache.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    GeometryId,
    Mesh,
    SceneGraphInspector,
    Sphere,
)

from burg_drake.core import Array, Arrays, cached, content_hash
from burg_drake.motion.ik import ArmLinks
from burg_drake.motion.proximity.ball_tree import BallTrees, bodies_with_shape
from burg_drake.motion.proximity.cached_arrays import from_arrays, to_arrays
from burg_drake.motion.proximity.self_clearance import SelfClearance, counted_pairs
from burg_drake.station.diagram import StationDiagram

KEPT = 16
"""Robots that are kept, the latest ones."""

_kept: OrderedDict[str, tuple[BallTrees, SelfClearance]] = OrderedDict()


@dataclass(frozen=True, eq=False)
class ArmShape:
    """An arm with its hand.

    Attributes:
        links: its kinematics.
        limits: (n, 2) of the joints' positions [rad or m].
        trees: balls that cover it.
        itself: its clearance from itself.
        content: hash of all that these follow from.
    """

    links: ArmLinks
    limits: Array
    trees: BallTrees
    itself: SelfClearance
    content: str

    @classmethod
    def of(cls, station_diagram: StationDiagram) -> ArmShape:
        """Reads the robot of a diagram with an arm.

        Raises:
            InvalidInputError: the robot has a shape or a joint that is not known.
        """
        links = ArmLinks.from_diagram(station_diagram)
        limits = np.array(
            [
                (joint.position_lower_limits()[0], joint.position_upper_limits()[0])
                for joint in station_diagram.arm_joints
            ]
        )
        key = content_hash(*_content(station_diagram, links), limits)
        if key not in _kept:

            def make() -> Arrays:
                trees = BallTrees.of(station_diagram, links)
                return to_arrays(trees, SelfClearance.of(station_diagram, links, trees, limits))

            _kept[key] = from_arrays(cached("robot", key, make))
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
        trees, itself = _kept[key]
        own = dict(zip(bodies_with_shape(station_diagram, links), trees.bodies, strict=True))
        # Where a scene has other objects, the robot's bodies have other numbers, in the same order.
        bodies = tuple(replace(known, body=body) for body, known in own.items())
        return cls(links, limits, replace(trees, bodies=bodies), itself, key)


def _content(station_diagram: StationDiagram, links: ArmLinks) -> Iterator[Any]:
    """All that balls and distances follow from."""
    plant = station_diagram.plant
    inspector = station_diagram.scene_graph.model_inspector()
    yield from (links.X_before, list(links.turns))
    bodies = bodies_with_shape(station_diagram, links)
    hand = plant.GetModelInstanceByName("hand")
    for index in bodies:
        body = plant.get_body(index)
        yield from (links.frame_of[index], links.X_FB[index], body.model_instance() == hand)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            yield inspector.GetPoseInFrame(geometry).GetAsMatrix4()
            yield _shape_content(inspector, geometry)
    for pair in counted_pairs(plant, inspector, bodies):
        yield [bodies.index(body) for body in pair]


def _shape_content(inspector: SceneGraphInspector, geometry: GeometryId) -> list[Any]:
    shape = inspector.GetShape(geometry)
    match shape:
        case Sphere():
            sizes: Any = [shape.radius()]
        case Capsule() | Cylinder():
            sizes = [shape.radius(), shape.length()]
        case Box():
            sizes = shape.size().tolist()
        case Convex() | Mesh():
            hull = inspector.GetConvexHull(geometry)
            sizes = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
        case _:
            sizes = []  # not known; to cover it raises an error
    return [type(shape).__name__, sizes]
