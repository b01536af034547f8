"""The screen of the open hand against the scene, with the hand's real collision geometry.

Objects are what they are in simulation, with one exception: where that is a rigid mesh, of which
Drake would see the convex hull here, the object's convex pieces take its place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    GeometryId,
    GeometrySet,
    Mesh,
    QueryObject,
    SceneGraphInspector,
    Sphere,
)
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array, check_pose
from burg_drake.core.outcome import Outcome
from burg_drake.grasping.screen import Body, HandScreen
from burg_drake.grasping.shape import Shape
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.floating_hand import FloatingHand
from burg_drake.station.hollow import mesh_by_pieces

TRAVEL_STEPS = (0.125, 0.025)
"""Steps of `free_travel`: 5 and 1 mm a finger of the Panda hand, both a fraction of a pad."""
PRIORITY = (
    Outcome.COLLISION_TARGET,
    Outcome.COLLISION_TABLE,
    Outcome.COLLISION_BACKGROUND,
    Outcome.COLLISION_CLUTTER,
)


@dataclass(frozen=True)
class Clearance:
    """Verdict of the screen.

    Attributes:
        outcome: one of the `COLLISION_*` outcomes, or None if the hand is clear.
        blocker: name of the instance, obstacle or `table` that decided the outcome.
        overlap: depth of the deepest overlap with it [m]; 0 if clear.
    """

    outcome: Outcome | None
    blocker: str = ""
    overlap: float = 0.0


class HandClearance:
    """Checks grasps of one scene; objects stand where the scene document places them.

    Args:
        station_diagram: a diagram built with `robot="hand"`.

    Raises:
        InvalidInputError: a collision geometry is of a shape that the screen does not know.
    """

    def __init__(self, station_diagram: StationDiagram) -> None:
        self._hand = FloatingHand(station_diagram)
        self._context = station_diagram.diagram.CreateDefaultContext()
        self._plant_context = station_diagram.plant.GetMyMutableContextFromRoot(self._context)
        self._query_port = station_diagram.scene_graph.get_query_output_port()
        self._names = _names(station_diagram)
        self._bodies = _filter_scene(station_diagram, self._context)
        self._graph_context = station_diagram.scene_graph.GetMyContextFromRoot(self._context)
        self._station_diagram = station_diagram
        self._screen = self._build_screen()

    def check(self, instance: str, X_WG: Array) -> Clearance:
        """Screens one grasp: the same to the last bit as in a batch.

        Args:
            instance: the target's name in the scene.
            X_WG: (4, 4) grasp in the world.
        """
        return self.check_all(instance, X_WG[None])[0]

    def check_all(self, instance: str, X_WG: Array) -> list[Clearance]:
        """Screens grasps.

        Args:
            instance: the target's name in the scene.
            X_WG: (N, 4, 4) grasps in the world.

        Returns:
            N verdicts. Where several bodies are overlapped, the one decides that would be in the
            way in an emptier scene, too: the target, then the table, then background, then
            clutter. What is no deeper than `screen.TOUCHING` is no overlap.

        Raises:
            InvalidInputError: `X_WG` are not poses.
        """
        outcomes = self.outcomes(instance)
        blockers, depths = self._screen.deepest(check_pose(X_WG, "X_WG"), list(outcomes))
        return [
            Clearance(outcomes[name], name, depth) if name else Clearance(None)
            for name, depth in zip(blockers.tolist(), depths.tolist(), strict=True)
        ]

    def outcomes(self, instance: str) -> dict[str, Outcome]:
        """What an overlap with each body means to grasps of `instance`, the deciding ones first."""
        outcomes = {name: self._outcome(instance, name) for name in self._screen.bodies}
        order = sorted(outcomes, key=lambda name: (PRIORITY.index(outcomes[name]), name))
        return {name: outcomes[name] for name in order}

    def free_travel(self, X_WG: Array) -> float:
        """How far the fingers can close before anything is touched.

        Args:
            X_WG: (4, 4) grasp at which the open hand is clear.

        Returns:
            0 (open) to 1 (pads together), to within the last of `TRAVEL_STEPS`; the fingers are
            clear there and on the way.
        """
        closed = 0.0
        for step in TRAVEL_STEPS:
            while closed + step <= 1.0 and not self.touched(X_WG, closed + step):
                closed += step
        return closed

    def touched(self, X_WG: Array, closed: float = 0.0) -> dict[str, float]:
        """What the hand overlaps by Drake's own query, which takes one grasp at a time.

        Args:
            X_WG: (4, 4) grasp in the world.
            closed: how far the fingers are closed, from 0 (open) to 1 (pads together).

        Returns:
            Names and depths [m]; a depth is along some separating direction, and may be larger
            than that along the nearest one.
        """
        self._hand.place(self._plant_context, X_WG, closed)
        names, bodies = self._names, self._bodies
        found: dict[str, float] = {}
        for p in self._query().ComputePointPairPenetration():
            name = names.get(bodies[p.id_A]) or names[bodies[p.id_B]]
            found[name] = max(found.get(name, 0.0), p.depth)
        return found

    def _query(self) -> QueryObject:
        return self._query_port.Eval(self._graph_context)

    def _build_screen(self) -> HandScreen:
        """Reads the collision geometry of hand and scene."""
        self._hand.place(self._plant_context, np.eye(4))
        query = self._query()
        robot = set(self._station_diagram.robot_bodies)
        hand: list[Shape] = []
        pieces: dict[BodyIndex, list[Shape]] = {}
        for geometry, body in self._bodies.items():
            if query.inspector().GetProximityProperties(geometry) is None:
                continue
            if body in robot:  # with X_WG = 1 the world is the grasp frame
                X_GP = query.GetPoseInWorld(geometry).GetAsMatrix4()
                hand.append(_shape(query.inspector(), geometry, X_GP))
            else:
                X_BP = query.inspector().GetPoseInFrame(geometry).GetAsMatrix4()
                pieces.setdefault(body, []).append(_shape(query.inspector(), geometry, X_BP))
        plant = self._station_diagram.plant
        bodies = {}
        for body, shapes in pieces.items():
            X_WB = plant.EvalBodyPoseInWorld(self._plant_context, plant.get_body(body))
            bodies[self._names[body]] = Body(X_WB.GetAsMatrix4(), shapes)
        return HandScreen(hand, bodies)

    def _outcome(self, instance: str, blocker: str) -> Outcome:
        if blocker == instance:
            return Outcome.COLLISION_TARGET
        if blocker == "table":
            return Outcome.COLLISION_TABLE
        if blocker in self._station_diagram.free:
            return Outcome.COLLISION_CLUTTER
        return Outcome.COLLISION_BACKGROUND


def _names(station_diagram: StationDiagram) -> dict[BodyIndex, str]:
    """Names of all bodies that a hand can collide with."""
    bodies = {**station_diagram.free, **station_diagram.fixed, "table": station_diagram.table}
    return {index: name for name, index in bodies.items()}


def _shape(inspector: SceneGraphInspector, geometry: GeometryId, X_BP: Array) -> Shape:
    """A collision geometry at a pose (4, 4)."""
    shape = inspector.GetShape(geometry)
    match shape:
        case Box():
            return Shape.box(X_BP, np.asarray(shape.size()) / 2)
        case Sphere():
            return Shape.ball(X_BP, shape.radius())
        case Cylinder():
            return Shape.cylinder(X_BP, shape.radius(), shape.length() / 2)
        case Convex() | Mesh():
            hull = inspector.GetConvexHull(geometry)
            points = np.array([hull.vertex(i) for i in range(hull.num_vertices())])
            return Shape.hull(X_BP, points)
    raise InvalidInputError(
        f"collision geometry {inspector.GetName(geometry)!r} is a {type(shape).__name__}; the"
        " hand's screen knows boxes, cylinders, spheres and convex meshes"
    )


def _filter_scene(station_diagram: StationDiagram, context: Context) -> dict[GeometryId, BodyIndex]:
    """Leaves only the pairs hand against scene in the context; returns geometry -> body."""
    plant, scene_graph = station_diagram.plant, station_diagram.scene_graph
    mesh_by_pieces(station_diagram, context)
    graph_context = scene_graph.GetMyMutableContextFromRoot(context)
    inspector = scene_graph.get_query_output_port().Eval(graph_context).inspector()
    bodies = {
        geometry: plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).index()
        for geometry in inspector.GetAllGeometryIds()
    }
    robot = set(station_diagram.robot_bodies)
    collision = [g for g in bodies if inspector.GetProximityProperties(g) is not None]
    sides = (
        GeometrySet([g for g in collision if bodies[g] in robot]),
        GeometrySet([g for g in collision if bodies[g] not in robot]),
    )
    declaration = CollisionFilterDeclaration()
    for side in sides:
        declaration.ExcludeWithin(side)
    scene_graph.collision_filter_manager(graph_context).Apply(declaration)
    return bodies
