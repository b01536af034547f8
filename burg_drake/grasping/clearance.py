"""The screen of the open hand against the scene, with the hand's real collision geometry."""

from __future__ import annotations

from dataclasses import dataclass

from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.multibody.tree import BodyIndex

from burg_drake.core.frames import Array
from burg_drake.core.outcome import Outcome
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.floating_hand import FloatingHand

TRAVEL_STEP = 0.025
"""Resolution of `free_travel`: 1 mm a finger of the Panda hand, a fraction of a pad."""
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
        overlaps = self._overlaps(X_WG)
        if not overlaps:
            return Clearance(None)
        outcomes = {name: self._outcome(instance, name) for name in overlaps}
        name = min(overlaps, key=lambda n: (PRIORITY.index(outcomes[n]), n))
        return Clearance(outcomes[name], name, overlaps[name])

    def free_travel(self, X_WG: Array) -> float:
        """How far the fingers can close before anything is touched.

        Args:
            X_WG: (4, 4) grasp at which the open hand is clear.

        Returns:
            0 (open) to 1 (pads together), a multiple of `TRAVEL_STEP`; the fingers are clear there
            and on the way.
        """
        steps = round(1.0 / TRAVEL_STEP)
        for i in range(1, steps + 1):
            if self._overlaps(X_WG, i * TRAVEL_STEP):
                return (i - 1) * TRAVEL_STEP
        return 1.0

    def _overlaps(self, X_WG: Array, closed: float = 0.0) -> dict[str, float]:
        """Depth of the deepest overlap by the name of what the hand overlaps [m]."""
        self._hand.place(self._plant_context, X_WG, closed)
        query = self._query_port.Eval(self._graph_context)
        overlaps: dict[str, float] = {}
        for pair in query.ComputePointPairPenetration():
            name = self._names.get(self._bodies[pair.id_A]) or self._names[self._bodies[pair.id_B]]
            overlaps[name] = max(overlaps.get(name, 0.0), pair.depth)
        return overlaps

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


def _filter_scene(station_diagram: StationDiagram, context) -> dict:  # type: ignore[no-untyped-def, type-arg]
    """Leaves only the pairs hand against scene in the context; returns geometry -> body."""
    plant, scene_graph = station_diagram.plant, station_diagram.scene_graph
    inspector = scene_graph.model_inspector()
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
    graph_context = scene_graph.GetMyMutableContextFromRoot(context)
    scene_graph.collision_filter_manager(graph_context).Apply(declaration)
    return bodies
