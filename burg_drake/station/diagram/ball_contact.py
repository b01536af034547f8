"""What the spheres meet by which balls roll, and what their patches; `world.rolling` says why."""

from __future__ import annotations

from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet
from pydrake.systems.framework import Context

from burg_drake.station.diagram.station_diagram import StationDiagram
from burg_drake.station.world import ROLLING, is_ball


def separate_ball_contact(station_diagram: StationDiagram, context: Context | None = None) -> None:
    """Has the robot meet the patches of balls, and everything else the spheres they roll by.

    Args:
        station_diagram: a built diagram.
        context: in this Context of the diagram alone; by default in all that are created from now
            on.
    """
    plant, graph = station_diagram.plant, station_diagram.diagram.mutable_scene_graph()
    inspector = graph.model_inspector()
    patches: list[GeometryId] = []
    rolling: list[GeometryId] = []
    robot: list[GeometryId] = []
    others: list[GeometryId] = []
    objects = {**station_diagram.free, **station_diagram.fixed}
    for name, index in objects.items():
        geometries = plant.GetCollisionGeometriesForBody(plant.get_body(index))
        others += geometries
        if is_ball(station_diagram.scene, name):
            for geometry in geometries:
                by_point = inspector.GetName(geometry).endswith(ROLLING)
                (rolling if by_point else patches).append(geometry)
    if not rolling:
        return
    for index in station_diagram.robot_bodies:
        robot += plant.GetCollisionGeometriesForBody(plant.get_body(index))
    others += plant.GetCollisionGeometriesForBody(plant.get_body(station_diagram.table))
    declaration = CollisionFilterDeclaration()
    declaration.ExcludeBetween(GeometrySet(patches), GeometrySet(others))
    declaration.ExcludeBetween(GeometrySet(rolling), GeometrySet(robot))
    manager = (
        graph.collision_filter_manager()
        if context is None
        else graph.collision_filter_manager(graph.GetMyMutableContextFromRoot(context))
    )
    manager.Apply(declaration)
