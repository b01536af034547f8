"""The screen of the open hand against the scene, with the hand's real collision geometry.

Objects are what they are in simulation, with one exception: where that is a rigid mesh, of which
Drake would see the convex hull here, the object's convex pieces take its place.
"""

from __future__ import annotations

from dataclasses import dataclass

from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    Convex,
    Cylinder,
    GeometryId,
    GeometrySet,
    Mesh,
    PenetrationAsPointPair,
    QueryObject,
    Sphere,
)
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core.frames import Array
from burg_drake.core.outcome import Outcome
from burg_drake.grasping.penetration import Polytope, penetration_depth
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
        self._polytopes: dict[GeometryId, Polytope | None] = {}

    def check(self, instance: str, X_WG: Array) -> Clearance:
        """Screens one grasp.

        Args:
            instance: the target's name in the scene.
            X_WG: (4, 4) grasp in the world.

        Returns:
            The verdict. Where several bodies are overlapped, the one decides that would be in the
            way in an emptier scene, too: the target, then the table, then background, then
            clutter.
        """
        pairs = self._overlapping(X_WG)
        if not pairs:
            return Clearance(None)
        outcomes = {name: self._outcome(instance, name) for name, _ in pairs}
        blocker = min(outcomes, key=lambda name: (PRIORITY.index(outcomes[name]), name))
        overlap = max(self._depth(pair) for name, pair in pairs if name == blocker)
        return Clearance(outcomes[blocker], blocker, overlap)

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
            while closed + step <= 1.0 and not self._overlapping(X_WG, closed + step):
                closed += step
        return closed

    def _overlapping(
        self, X_WG: Array, closed: float = 0.0
    ) -> list[tuple[str, PenetrationAsPointPair]]:
        """What the hand overlaps: name, and pair of geometries."""
        self._hand.place(self._plant_context, X_WG, closed)
        pairs = self._query().ComputePointPairPenetration()
        names, bodies = self._names, self._bodies
        return [(names.get(bodies[p.id_A]) or names[bodies[p.id_B]], p) for p in pairs]

    def _query(self) -> QueryObject:
        return self._query_port.Eval(self._graph_context)

    def _depth(self, pair: PenetrationAsPointPair) -> float:
        """Penetration depth of two geometries of the hand's present place [m]."""
        query = self._query()
        shapes = [self._polytope(query, geometry) for geometry in (pair.id_A, pair.id_B)]
        if shapes[0] is None or shapes[1] is None:
            return pair.depth
        X_WA, X_WB = query.GetPoseInWorld(pair.id_A), query.GetPoseInWorld(pair.id_B)
        return penetration_depth(shapes[0], shapes[1], X_WA.InvertAndCompose(X_WB).GetAsMatrix4())

    def _polytope(self, query: QueryObject, geometry: GeometryId) -> Polytope | None:
        """The polytope or ball of a geometry; None if it is of another shape."""
        if geometry not in self._polytopes:
            inspector = query.inspector()
            known = isinstance(inspector.GetShape(geometry), (Box, Convex, Cylinder, Mesh, Sphere))
            self._polytopes[geometry] = (
                Polytope.from_geometry(inspector, geometry) if known else None
            )
        return self._polytopes[geometry]

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
