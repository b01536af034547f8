"""Ties what does not move to the world, inside a collision checker.

Drake updates the geometry of every body at each configuration, and looks for neighbours among it,
also where bodies are welded to the world: with twelve objects of many pieces that is more than half
of a check. Geometry of the world itself costs next to nothing. Verdicts stay the same.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometryInstance,
    GeometrySet,
    ProximityProperties,
    Role,
)
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import CollisionCheckerContext, RobotDiagram, SceneGraphCollisionChecker

from burg_drake.station.diagram import StationDiagram


def anchor(
    checker: SceneGraphCollisionChecker,
    station_diagram: StationDiagram,
    bodies: Collection[BodyIndex],
) -> dict[GeometryId, BodyIndex]:
    """Gives the collision geometry of bodies to the world, where they are by default.

    Args:
        checker: all its contexts are changed; its filter matrix must not be set afterwards.
        station_diagram: what it checks; it stays as it is.
        bodies: what does not move, and does not overlap robot links that do not move either: those
            the world does not collide with.

    Returns:
        The body that each of the world's new geometries belongs to.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    plant_context = plant.CreateDefaultContext()
    inspector, source = graph.model_inspector(), plant.get_source_id()
    filtered = checker.GetFilteredCollisionMatrix()[int(plant.world_body().index())]
    never = [  # of fixed links, and of what is carried, which counts against links alone
        geometry
        for i in range(plant.num_bodies())
        if filtered[i] and BodyIndex(i) not in bodies
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(BodyIndex(i)))
    ]
    body_of: dict[GeometryId, BodyIndex] = {}

    def anchor(body: BodyIndex, context: CollisionCheckerContext) -> None:
        graph_context = context.scene_graph_context()
        X_WB = plant.EvalBodyPoseInWorld(plant_context, plant.get_body(body))
        anchored = []
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(body)):
            X_WP, shape = X_WB @ inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry)
            instance = GeometryInstance(X_WP, shape, f"anchored_{geometry.get_value()}")
            instance.set_proximity_properties(ProximityProperties())
            graph.RemoveRole(graph_context, source, geometry, Role.kProximity)
            world = inspector.world_frame_id()
            anchored.append(graph.RegisterGeometry(graph_context, source, world, instance))
        body_of.update(dict.fromkeys(anchored, body))
        declaration = CollisionFilterDeclaration()
        declaration.ExcludeBetween(GeometrySet(anchored), GeometrySet(never))
        graph.collision_filter_manager(graph_context).Apply(declaration)

    def anchor_all(_: RobotDiagram, context: CollisionCheckerContext) -> None:
        for body in bodies:
            anchor(body, context)

    checker.PerformOperationAgainstAllModelContexts(anchor_all)
    return body_of


def release(
    checker: SceneGraphCollisionChecker,
    station_diagram: StationDiagram,
    body: BodyIndex,
    anchored: Mapping[GeometryId, BodyIndex],
    ignored: Collection[BodyIndex],
) -> None:
    """Takes the collision geometry of a body back from the world, so that the body moves again.

    Args:
        checker: all its contexts are changed, in which `anchor` has been at work.
        station_diagram: what it checks; it stays as it is.
        body: the body.
        anchored: what `anchor` has returned.
        ignored: bodies that it does not collide with.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    inspector, source = graph.model_inspector(), plant.get_source_id()
    own = plant.GetCollisionGeometriesForBody(plant.get_body(body))
    free = {*ignored} - {*anchored.values()}
    others = {g for b in free for g in plant.GetCollisionGeometriesForBody(plant.get_body(b))}
    others |= {geometry for geometry, of in anchored.items() if of in ignored}
    tied = {geometry for geometry, of in anchored.items() if of == body}

    def release(_: RobotDiagram, context: CollisionCheckerContext) -> None:
        graph_context = context.scene_graph_context()
        known = {*context.GetQueryObject().inspector().GetAllGeometryIds()}  # each has its own
        for geometry in tied & known:
            graph.RemoveRole(graph_context, source, geometry, Role.kProximity)
        for geometry in own if tied else ():
            properties = inspector.GetProximityProperties(geometry)
            graph.AssignRole(graph_context, source, geometry, properties)
        declaration = CollisionFilterDeclaration()
        declaration.ExcludeWithin(GeometrySet(own))
        declaration.ExcludeBetween(GeometrySet(own), GeometrySet([*(others & known)]))
        graph.collision_filter_manager(graph_context).Apply(declaration)

    checker.PerformOperationAgainstAllModelContexts(release)
