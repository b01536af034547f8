"""Balls meet table and objects at a point, as they do in the world, and pads on a patch.

Drake's patches come from a polyhedron. A ball among them rolls by itself: over its facets, 2 mm in
the first five seconds on a level table, and on for as long as one looks. At a point it stands. What
grips it needs the patch, which a point does not replace: it bears no torque.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydrake.geometry import (
    AddContactMaterial,
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.tree import RigidBody
from pydrake.planning import RobotDiagramBuilder
from pydrake.systems.framework import Context

from burg_drake.scene.document import Scene

if TYPE_CHECKING:
    from burg_drake.station.diagram import StationDiagram

ROLLING = "rolling"
"""Name of the geometry of a ball that meets things at points."""


def is_ball(scene: Scene, name: str) -> bool:
    """Whether `name` is an instance whose contact geometry is a sphere."""
    if name not in scene.instances and name not in scene.background:
        return False
    contact = scene.entry(name).contact
    return (
        contact.kind == "primitive"
        and contact.primitive is not None
        and contact.primitive.shape == "sphere"
    )


def add_rolling(builder: RobotDiagramBuilder, scene: Scene, name: str, body: RigidBody) -> None:
    """Adds the sphere by which a ball rolls; `part_rolling` says what it meets."""
    primitive = scene.entry(name).contact.primitive
    assert primitive is not None
    plant = builder.plant()
    (patch,) = plant.GetCollisionGeometriesForBody(body)
    rigid = builder.scene_graph().model_inspector().GetProximityProperties(patch)
    properties = ProximityProperties()
    AddContactMaterial(
        dissipation=rigid.GetProperty("material", "hunt_crossley_dissipation"),
        friction=rigid.GetProperty("material", "coulomb_friction"),
        properties=properties,
    )
    X_OP = RigidTransform(primitive.X_OP.matrix())
    plant.RegisterCollisionGeometry(body, X_OP, Sphere(primitive.size[0]), ROLLING, properties)


def part_rolling(station_diagram: StationDiagram, context: Context | None = None) -> None:
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
