"""Whether arm, hand and target can go the rest of a lift without touching anything: geometry."""

from __future__ import annotations

from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex

from burg_drake.core import Array, inverse
from burg_drake.simulation.trials.scene_trial import collision_geometries
from burg_drake.station.diagram import MountedHand, StationDiagram
from burg_drake.station.world import mesh_by_pieces


class ArmLiftClearance:
    """Looks along the way up of one target in the hand of an arm.

    Args:
        station_diagram: a diagram built with `robot="arm"`.
        target: the body in the hand.
    """

    def __init__(self, station_diagram: StationDiagram, target: BodyIndex) -> None:
        self._diagram = station_diagram
        self._plant = plant = station_diagram.plant
        self._target = plant.get_body(target)
        self._context = station_diagram.diagram.CreateDefaultContext()
        self._plant_context = plant.GetMyMutableContextFromRoot(self._context)
        mesh_by_pieces(station_diagram, self._context)
        self._hand = MountedHand(station_diagram)
        carried = {target, *station_diagram.robot_bodies} - self._hand.links
        others = {station_diagram.table, *station_diagram.free.values()}
        others |= set(station_diagram.fixed.values())
        manager = station_diagram.scene_graph.collision_filter_manager(
            station_diagram.scene_graph.GetMyMutableContextFromRoot(self._context)
        )
        for side in (carried, others - {target}):
            geometries = GeometrySet(collision_geometries(plant, side))
            manager.Apply(CollisionFilterDeclaration().ExcludeWithin(geometries))

    def is_free(self, positions: Array, q: Array) -> bool:
        """Whether nothing is met.

        Args:
            positions: of the plant, at present.
            q: (K, n) arm positions on the way.
        """
        context = self._plant_context
        self._plant.SetPositions(context, positions)
        X_WO = self._plant.EvalBodyPoseInWorld(context, self._target).GetAsMatrix4()
        X_HO = inverse(self._hand.X_WH(context)) @ X_WO
        graph = self._diagram.scene_graph
        graph_context = graph.GetMyContextFromRoot(self._context)
        for row in q:
            self._hand.set_arm(context, row)
            X_WO = self._hand.X_WH(context) @ X_HO
            self._plant.SetFloatingBaseBodyPoseInWorldFrame(
                context, self._target, RigidTransform(X_WO)
            )
            if graph.get_query_output_port().Eval(graph_context).HasCollisions():
                return False
        return True
