"""Whether hand and target, and the arm, can go on together without touching anything: geometry, no
steps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet, QueryObject
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.core import Array, inverse
from burg_drake.simulation.trials.trial_world import collision_geometries
from burg_drake.station.diagram import FloatingHand, MountedHand, StationDiagram, mesh_by_pieces
from burg_drake.station.world import ROBOT_MODELS

STEP = 0.01
"""Way between two looks [m]; a hand and what it meets are thicker, taken together."""
GAP = 0.002
"""Boxes that come no closer than this are apart [m]."""


class PlacedRobot(Protocol):
    """A world in its present state, of whatever engine."""

    @property
    def free(self) -> Mapping[str, BodyIndex]:
        """What can move, by name."""
        ...

    def X_WB(self, body: BodyIndex) -> Array:
        """(4, 4) of a body."""
        ...

    def robot_positions(self, model: str) -> Array | None:
        """Of one of `ROBOT_MODELS`, in the order of a station diagram; None if there is none."""
        ...


class HandLiftClearance:
    """Looks along the straight segment ahead of one target in the hand.

    Args:
        station_diagram: a diagram built with `robot="hand"`, without contact parts.
        instance: name of what is in the hand.
    """

    def __init__(self, station_diagram: StationDiagram, instance: str) -> None:
        target = station_diagram.free[instance]
        self._diagram = station_diagram
        self._plant = plant = station_diagram.plant
        self._context = station_diagram.diagram.CreateDefaultContext()
        self._plant_context = plant.GetMyMutableContextFromRoot(self._context)
        mesh_by_pieces(station_diagram, self._context)
        self._hand = FloatingHand(station_diagram)
        carried = {target, *station_diagram.robot_bodies}
        everything = {station_diagram.table, *station_diagram.free.values()}
        everything |= set(station_diagram.fixed.values())
        query = self._query()
        self._carried = self._boxes(query, carried)
        self._others = self._boxes(query, everything - carried)
        manager = station_diagram.scene_graph.collision_filter_manager(
            station_diagram.scene_graph.GetMyMutableContextFromRoot(self._context)
        )
        for side in (self._carried, self._others):
            declaration = CollisionFilterDeclaration()
            manager.Apply(declaration.ExcludeWithin(GeometrySet([g for g, _ in side])))
        start = plant.get_body(target).floating_positions_start() + 4
        self._places = [start, start + 1, start + 2, self._hand.lift.position_start()]

    def is_free(self, world: PlacedRobot, X_WG: Array, length: float, direction_W: Array) -> bool:
        """Whether nothing is met on the way.

        Args:
            world: in its present state.
            X_WG: (4, 4) grasp at which this way began; it sets the frames of the lift.
            length: how far there is to go [m].
            direction_W: (3,) unit vector of the lift.
        """
        self._hand.place(self._plant_context, X_WG, direction_W=direction_W)
        _take_positions(self._diagram, self._plant_context, world)
        positions = self._plant.GetPositions(self._plant_context)
        if not self._boxes_meet(length * direction_W):
            return True
        for travelled in np.append(np.arange(STEP, length, STEP), length):
            moved = positions.copy()
            moved[self._places] += travelled * np.append(direction_W, 1.0)
            self._plant.SetPositions(self._plant_context, moved)
            if self._query().HasCollisions():
                return False
        return True

    def _boxes_meet(self, p_W: Array) -> bool:
        """Whether an upright box about what moves, drawn out by a way (3,), meets one of the
        others."""
        query = self._query()
        low, high = _bounds(query, self._carried)
        low, high = low + np.minimum(p_W, 0.0), high + np.maximum(p_W, 0.0)
        other_low, other_high = _bounds(query, self._others)
        apart = (low[:, None] > other_high[None] + GAP) | (other_low[None] > high[:, None] + GAP)
        return not apart.any(axis=2).all()

    def _query(self) -> QueryObject:
        port = self._diagram.scene_graph.get_query_output_port()
        return port.Eval(self._diagram.scene_graph.GetMyContextFromRoot(self._context))

    def _boxes(
        self, query: QueryObject, bodies: set[BodyIndex]
    ) -> list[tuple[GeometryId, tuple[Array, Array]]]:
        """Collision geometries with the pose (4, 4) and half size (3,) of a box about each."""
        inspector = query.inspector()
        found = []
        for index in sorted(bodies):
            for geometry in self._plant.GetCollisionGeometriesForBody(self._plant.get_body(index)):
                box = inspector.GetObbInGeometryFrame(geometry)
                assert box is not None  # only half spaces have none
                found.append((geometry, (box.pose().GetAsMatrix4(), np.asarray(box.half_width()))))
        return found


class ArmLiftClearance:
    """Looks along the way up of one target in the hand of an arm.

    Args:
        station_diagram: a diagram built with `robot="arm"`, without contact parts.
        instance: name of what is in the hand.
    """

    def __init__(self, station_diagram: StationDiagram, instance: str) -> None:
        target = station_diagram.free[instance]
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

    def is_free(self, world: PlacedRobot, q: Array) -> bool:
        """Whether nothing is met.

        Args:
            world: in its present state.
            q: (K, n) arm positions on the way.
        """
        context = self._plant_context
        _take_positions(self._diagram, context, world)
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


def _take_positions(diagram: StationDiagram, plant_context: Context, world: PlacedRobot) -> None:
    """Puts robot and objects where they are in a world; what cannot move there is in its place."""
    plant = diagram.plant
    for model in ROBOT_MODELS:
        q = world.robot_positions(model)
        if q is not None:
            plant.SetPositions(plant_context, plant.GetModelInstanceByName(model), q)
    for name, index in diagram.free.items():
        moved = world.free.get(name)
        X_WO = diagram.X_WO(name) if moved is None else world.X_WB(moved)
        body = plant.get_body(index)
        plant.SetFloatingBaseBodyPoseInWorldFrame(plant_context, body, RigidTransform(X_WO))


def _bounds(
    query: QueryObject, boxes: list[tuple[GeometryId, tuple[Array, Array]]]
) -> tuple[Array, Array]:
    """Lower and upper corners (N, 3) of upright boxes about geometries, in the world."""
    X_WB = np.array([query.GetPoseInWorld(g).GetAsMatrix4() @ X_GB for g, (X_GB, _) in boxes])
    half = np.array([half for _, (_, half) in boxes])
    reach = np.einsum("nij,nj->ni", np.abs(X_WB[:, :3, :3]), half)
    return X_WB[:, :3, 3] - reach, X_WB[:, :3, 3] + reach
