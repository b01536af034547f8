"""Collision geometry of the open hand and of all bodies of a station diagram as convex shapes.

Drake would use the convex hull of a rigid mesh; here the object's convex pieces replace it.
"""

from __future__ import annotations

from collections.abc import Mapping

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

from burg_drake.core import Array, InvalidInputError
from burg_drake.geometry import Body, Shape
from burg_drake.station import StationDiagram, hull_vertices, replace_meshes_by_pieces


def screened_bodies(station_diagram: StationDiagram) -> dict[BodyIndex, str]:
    """Names of all bodies that a hand can collide with."""
    bodies = {**station_diagram.free, **station_diagram.fixed, "table": station_diagram.table}
    return {index: name for name, index in bodies.items()}


def filter_hand_pairs(
    station_diagram: StationDiagram, context: Context, names: Mapping[BodyIndex, str]
) -> dict[GeometryId, BodyIndex]:
    """Filters collisions in a context to pairs of the hand and named bodies, and replaces meshes of
    objects by their convex pieces.

    Returns:
        The bodies of all geometries of the hand and of the named bodies.
    """
    plant, scene_graph = station_diagram.plant, station_diagram.scene_graph
    replace_meshes_by_pieces(station_diagram, context)
    graph_context = scene_graph.GetMyMutableContextFromRoot(context)
    inspector = scene_graph.get_query_output_port().Eval(graph_context).inspector()
    body_of = {
        geometry: plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)).index()
        for geometry in inspector.GetAllGeometryIds()
    }
    robot = set(station_diagram.robot_bodies)
    collision = [g for g in body_of if inspector.GetProximityProperties(g) is not None]
    hand = GeometrySet([g for g in collision if body_of[g] in robot])
    scene = GeometrySet([g for g in collision if body_of[g] not in robot])
    left_out = [g for g in collision if body_of[g] not in robot and body_of[g] not in names]
    declaration = CollisionFilterDeclaration()
    declaration.ExcludeWithin(hand).ExcludeWithin(scene)
    declaration.ExcludeBetween(hand, GeometrySet(left_out))
    scene_graph.collision_filter_manager(graph_context).Apply(declaration)
    return {g: body for g, body in body_of.items() if body in robot or body in names}


def read_shapes(
    station_diagram: StationDiagram,
    plant_context: Context,
    query: QueryObject,
    body_of: Mapping[GeometryId, BodyIndex],
    names: Mapping[BodyIndex, str],
) -> tuple[list[Shape], dict[str, Body]]:
    """The collision geometry of the hand and of the named bodies.

    Args:
        station_diagram: the diagram to read.
        plant_context: the plant's part of a Context in which the open hand's grasp frame is the
            world.
        query: geometry queries of the scene graph in that Context.
        body_of: bodies of the geometries, see `filter_hand_pairs`.
        names: names of the bodies.

    Returns:
        Shapes of the open hand in the grasp frame, and bodies by name.

    Raises:
        InvalidInputError: a collision geometry has an unsupported shape.
    """
    robot = set(station_diagram.robot_bodies)
    hand: list[Shape] = []
    pieces: dict[BodyIndex, list[Shape]] = {}
    for geometry, body in body_of.items():
        if query.inspector().GetProximityProperties(geometry) is None:
            continue
        if body in robot:
            X_GP = query.GetPoseInWorld(geometry).GetAsMatrix4()
            hand.append(shape_of(query.inspector(), geometry, X_GP))
        else:
            X_BP = query.inspector().GetPoseInFrame(geometry).GetAsMatrix4()
            pieces.setdefault(body, []).append(shape_of(query.inspector(), geometry, X_BP))
    plant = station_diagram.plant
    bodies = {}
    for body, shapes in pieces.items():
        X_WB = plant.EvalBodyPoseInWorld(plant_context, plant.get_body(body))
        bodies[names[body]] = Body(X_WB.GetAsMatrix4(), shapes)
    return hand, bodies


def shape_of(inspector: SceneGraphInspector, geometry: GeometryId, X_BP: Array) -> Shape:
    """A collision geometry at a pose (4, 4), as a shape.

    Raises:
        InvalidInputError: it has an unsupported shape.
    """
    shape = inspector.GetShape(geometry)
    match shape:
        case Box():
            return Shape.box(X_BP, np.asarray(shape.size()) / 2)
        case Sphere():
            return Shape.ball(X_BP, shape.radius())
        case Cylinder():
            return Shape.cylinder(X_BP, shape.radius(), shape.length() / 2)
        case Convex() | Mesh():
            return Shape.hull(X_BP, hull_vertices(shape))
    raise InvalidInputError(
        f"collision geometry {inspector.GetName(geometry)!r} is a {type(shape).__name__};"
        " the clearance check of the hand supports boxes, cylinders, spheres and convex"
        " meshes"
    )
