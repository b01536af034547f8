"""The collision geometry of a hand as parts that move rigidly: its body and two fingers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from burg_drake.core import Array, rng_from
from burg_drake.geometry import Ball, Body, Cylinder, Shape, rotate
from burg_drake.grasping.clearance import (
    hand_against,
    read_shapes,
    screened_bodies,
)
from burg_drake.station.diagram import FloatingHand, StationDiagram

DIRECTIONS = 64
"""In which it is looked whether a hand is symmetric."""
SAME = 1e-9
"""Differences of reach that are roundings [m]."""


@dataclass(frozen=True, eq=False)
class HandPart:
    """Shapes of a hand that are rigid to each other.

    Attributes:
        shapes: in the grasp frame of the open hand.
        closing_G: (3,) how far they move when the open hand closes until its pads meet, or are as
            close as they can be [m]; 0 of the hand's body.
        opening: smallest and largest distance between the pads [m].
    """

    shapes: tuple[Shape, ...]
    closing_G: Array
    opening: tuple[float, float]

    def placed(self, X_WG: Array, width: Array) -> Array:
        """Grasp frames of an open hand that has this part where it is at another width.

        Args:
            X_WG: (N, 4, 4) grasps.
            width: (N,) distance between the pads [m]; NaN where the hand is open.

        Returns:
            (N, 4, 4) poses in the world.
        """
        low, high = self.opening
        closed = np.clip((high - np.where(np.isnan(width), high, width)) / (high - low), 0.0, 1.0)
        moved = X_WG.copy()
        moved[:, :3, 3] += rotate(X_WG[:, :3, :3], closed[:, None] * self.closing_G)
        return moved


def read_hand(station_diagram: StationDiagram) -> tuple[tuple[HandPart, ...], dict[str, Body]]:
    """The hand and all bodies that it can collide with.

    Args:
        station_diagram: a diagram built with `robot="hand"`.

    Returns:
        The hand's body and its fingers, as far as they have shapes; and the other bodies by name.

    Raises:
        InvalidInputError: see `read_shapes`.
    """
    hand = FloatingHand(station_diagram)
    plant = station_diagram.plant
    context = station_diagram.diagram.CreateDefaultContext()
    plant_context = plant.GetMyMutableContextFromRoot(context)
    names = screened_bodies(station_diagram)
    body_of = hand_against(station_diagram, context, names)
    hand.place(plant_context, np.eye(4))
    graph = station_diagram.scene_graph
    query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context))
    shapes, bodies = read_shapes(station_diagram, plant_context, query, body_of, names)
    inspector, robot = query.inspector(), set(station_diagram.robot_bodies)
    owners = [
        body
        for geometry, body in body_of.items()
        if body in robot and inspector.GetProximityProperties(geometry) is not None
    ]
    links = [
        {body.index() for body in plant.GetBodiesWeldedTo(plant.get_body(finger))}
        for finger in hand.fingers
    ]
    links.insert(0, robot - links[0] - links[1])
    paths = [np.zeros(3), *_closing_paths(hand, plant, plant_context)]
    owned = [
        tuple(s for s, owner in zip(shapes, owners, strict=True) if owner in own) for own in links
    ]
    opening = hand.document.opening
    parts = [HandPart(o, path, opening) for o, path in zip(owned, paths, strict=True) if o]
    return tuple(parts), bodies


def is_symmetric(parts: Sequence[HandPart]) -> bool:
    """Whether a hand occupies the same space when it is turned by half a turn about its approach:
    by how far its shapes reach in `DIRECTIONS` directions."""
    rng = rng_from("burg_drake directions")
    directions = rng.normal(size=(DIRECTIONS, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    shapes = [shape for part in parts for shape in part.shapes]
    reach = np.array([_reach(shape, directions) for shape in shapes])
    turned = np.array([_reach(shape, directions * (-1.0, -1.0, 1.0)) for shape in shapes])
    return bool(np.abs(np.sort(reach, axis=0) - np.sort(turned, axis=0)).max(initial=0.0) < SAME)


def _reach(shape: Shape, directions: Array) -> Array:
    """How far a shape reaches along unit vectors (D, 3) from the origin [m]."""
    d_P = directions @ shape.X_BP[:3, :3]
    along = directions @ shape.X_BP[:3, 3]
    if isinstance(shape.convex, (Ball, Cylinder)):
        components = (d_P[:, 0], d_P[:, 1], d_P[:, 2])
        return np.asarray(along + shape.convex.reach(components))
    assert shape.polytope is not None  # all others are polytopes
    return np.asarray(along + (d_P @ shape.polytope.vertices.T).max(axis=1))


def _closing_paths(
    hand: FloatingHand, plant: MultibodyPlant, plant_context: Context
) -> list[Array]:
    """How far each finger moves from open to closed, in the grasp frame (3,) [m]."""
    ends = []
    for closed in (0.0, 1.0):
        hand.place(plant_context, np.eye(4), closed)
        poses = [plant.EvalBodyPoseInWorld(plant_context, plant.get_body(i)) for i in hand.fingers]
        ends.append([X_GF.translation() for X_GF in poses])
    return [np.asarray(end - start) for start, end in zip(*ends, strict=True)]
