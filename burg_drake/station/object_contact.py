"""Contact of objects in a station diagram: pairs that meet, compliance, pieces for meshes."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    CollisionFilterDeclaration,
    Convex,
    GeometryId,
    GeometryInstance,
    GeometrySet,
    ProximityProperties,
    Role,
    RoleAssign,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.station.object_bodies import ROLLING_GEOMETRY, has_mesh_contact, is_ball
from burg_drake.station.station_diagram import StationDiagram
from burg_drake.station.surroundings import SurroundingsProperties


def filter_contact_pairs(station_diagram: StationDiagram, context: Context | None = None) -> None:
    """Restricts each geometry of an object to its intended contacts.

    The hand meets the patches of balls and the surface meshes of objects; the table meets the
    rolling spheres of balls and the feet of objects; all other bodies meet the rolling spheres, and
    the pieces or, if there is one, the hull of an object.

    Args:
        station_diagram: a built diagram.
        context: Context to change; by default all Contexts that are created from now on.
    """
    graph = station_diagram.diagram.mutable_scene_graph()
    objects = {**station_diagram.free, **station_diagram.standing, **station_diagram.fixed}
    plant = station_diagram.plant
    geometries = {name: collision_geometries(plant, [index]) for name, index in objects.items()}
    robot = collision_geometries(plant, station_diagram.robot_bodies)
    table = collision_geometries(plant, [station_diagram.table])
    surroundings = [g for own in geometries.values() for g in own] + table
    declaration = CollisionFilterDeclaration()
    patches, rolling = _ball_geometries(station_diagram, geometries)
    _exclude_pairs(declaration, patches, surroundings)
    _exclude_pairs(declaration, rolling, robot)
    parts = station_diagram.parts
    surfaces, feet, hulls = set(parts.surfaces), set(parts.feet), set(parts.hulls)
    soft = [g for g in robot if _is_hydroelastic(station_diagram, g)]
    hard = [g for g in robot if g not in set(soft)]
    _exclude_pairs(declaration, surfaces, surroundings + hard)
    _exclude_pairs(declaration, feet, [g for g in surroundings if g not in set(table)] + robot)
    _exclude_pairs(declaration, hulls, table + soft)
    for own in geometries.values():
        pieces = [g for g in own if g not in surfaces | feet | hulls]
        if surfaces & set(own):
            _exclude_pairs(declaration, pieces, soft)
        if feet & set(own):
            _exclude_pairs(declaration, pieces, table)
        if hulls & set(own):
            _exclude_pairs(declaration, pieces, [g for g in surroundings if g not in set(table)])
    manager = (
        graph.collision_filter_manager()
        if context is None
        else graph.collision_filter_manager(graph.GetMyMutableContextFromRoot(context))
    )
    manager.Apply(declaration)


def _exclude_pairs(
    declaration: CollisionFilterDeclaration,
    some: Collection[GeometryId],
    others: Collection[GeometryId],
) -> None:
    if some and others:
        declaration.ExcludeBetween(GeometrySet(list(some)), GeometrySet(list(others)))


def collision_geometries(plant: MultibodyPlant, bodies: Iterable[BodyIndex]) -> list[GeometryId]:
    """Collision geometries of bodies, in the plant's order."""
    return [
        geometry
        for index in sorted(bodies)
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
    ]


def _ball_geometries(
    station_diagram: StationDiagram, geometries: dict[str, list[GeometryId]]
) -> tuple[list[GeometryId], list[GeometryId]]:
    """Patches and rolling spheres of balls."""
    inspector = station_diagram.scene_graph.model_inspector()
    patches: list[GeometryId] = []
    rolling: list[GeometryId] = []
    for name, own in geometries.items():
        if is_ball(station_diagram.scene, name):
            for geometry in own:
                by_point = inspector.GetName(geometry).endswith(ROLLING_GEOMETRY)
                (rolling if by_point else patches).append(geometry)
    return patches, rolling


def _is_hydroelastic(station_diagram: StationDiagram, geometry: GeometryId) -> bool:
    inspector = station_diagram.scene_graph.model_inspector()
    properties = inspector.GetProximityProperties(geometry)
    return bool(properties.HasProperty("hydroelastic", "compliance_type"))


LEANING_DISTANCE = 0.001
"""Metres between objects that may lean on each other; poses in scenes are rounded."""


def touching_bodies(
    station_diagram: StationDiagram, bodies: Collection[BodyIndex]
) -> Mapping[BodyIndex, frozenset[BodyIndex]]:
    """Finds bodies closer to each other than `LEANING_DISTANCE`, where the documents place them.

    Args:
        station_diagram: a built diagram.
        bodies: bodies to check.

    Returns:
        The touching bodies of each body that touches another one.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    body_of: dict[GeometryId, BodyIndex] = {
        geometry: index
        for index in bodies
        for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
    }
    beside: dict[BodyIndex, set[BodyIndex]] = defaultdict(set)
    if len(bodies) > 1:
        context = station_diagram.diagram.CreateDefaultContext()
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(context))
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(LEANING_DISTANCE):
            one, other = body_of.get(pair.id_A), body_of.get(pair.id_B)
            if one is not None and other is not None and one != other:
                beside[one].add(other)
                beside[other].add(one)
    return {body: frozenset(others) for body, others in beside.items()}


def make_touching_compliant(station_diagram: StationDiagram) -> None:
    """Makes free objects that touch other objects of the scene compliant, in all Contexts that are
    created from now on."""
    scene = station_diagram.scene
    fixed = [station_diagram.fixed[name] for name in scene.background]
    beside = touching_bodies(station_diagram, {*station_diagram.free.values(), *fixed})
    make_compliant(
        station_diagram, [n for n, index in station_diagram.free.items() if index in beside]
    )


def make_compliant(
    station_diagram: StationDiagram,
    names: Iterable[str],
    *,
    if_rigid: bool = False,
    dissipation: float = SurroundingsProperties.dissipation,
) -> dict[str, dict[GeometryId, ProximityProperties]]:
    """Makes free objects compliant, in all Contexts that are created from now on. Rigid meshes
    cannot be compliant, and balls have point contact with everything; both are unchanged.

    Args:
        station_diagram: a built diagram.
        names: the objects.
        if_rigid: leave geometries as they are that are compliant already.
        dissipation: Hunt-Crossley's [s/m].

    Returns:
        The replaced properties of each object's geometries.
    """
    plant, scene = station_diagram.plant, station_diagram.scene
    inspector = station_diagram.scene_graph.model_inspector()
    replaced: dict[str, dict[GeometryId, ProximityProperties]] = defaultdict(dict)
    for name in names:
        if has_mesh_contact(scene, name) or is_ball(scene, name):
            continue
        for geometry in plant.GetCollisionGeometriesForBody(
            plant.get_body(station_diagram.free[name])
        ):
            before = ProximityProperties(inspector.GetProximityProperties(geometry))
            is_compliant = before.HasProperty("hydroelastic", "hydroelastic_modulus")
            if geometry not in station_diagram.parts.all and not (if_rigid and is_compliant):
                _make_geometry_compliant(station_diagram, geometry, dissipation)
                replaced[name][geometry] = before
    return dict(replaced)


def _make_geometry_compliant(
    station_diagram: StationDiagram, geometry: GeometryId, dissipation: float
) -> None:
    modulus = 5e7  # Pascal; with 1e7 an edge sinks into another object by more than 1 mm.
    graph = station_diagram.diagram.mutable_scene_graph()
    inspector = graph.model_inspector()
    rigid = inspector.GetProximityProperties(geometry)
    half_width = inspector.GetObbInGeometryFrame(geometry).half_width()
    hint = rigid.GetPropertyOrDefault("hydroelastic", "resolution_hint", float(np.min(half_width)))
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(hint, modulus, properties)
    AddContactMaterial(
        dissipation=dissipation,
        friction=rigid.GetProperty("material", "coulomb_friction"),
        properties=properties,
    )
    source = station_diagram.plant.get_source_id()
    graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)


def assign_contact(
    station_diagram: StationDiagram,
    root: Context,
    properties: Mapping[GeometryId, ProximityProperties],
) -> None:
    """Replaces contact properties of geometries in a Context of the whole diagram."""
    graph, source = station_diagram.scene_graph, station_diagram.plant.get_source_id()
    context = graph.GetMyMutableContextFromRoot(root)
    for geometry, own in properties.items():
        graph.AssignRole(context, source, geometry, own, RoleAssign.kReplace)


def replace_meshes_by_pieces(station_diagram: StationDiagram, context: Context) -> None:
    """Replaces the objects' meshes by convex pieces in a Context.

    Args:
        station_diagram: the diagram.
        context: Context of the whole diagram; must not be simulated afterwards.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    source = plant.get_source_id()
    graph_context = graph.GetMyMutableContextFromRoot(context)
    for name, index in {**station_diagram.free, **station_diagram.fixed}.items():
        if not has_mesh_contact(station_diagram.scene, name):
            continue
        body = plant.get_body(index)
        frame = plant.GetBodyFrameIdOrThrow(index)
        for geometry in plant.GetCollisionGeometriesForBody(body):
            graph.RemoveRole(graph_context, source, geometry, Role.kProximity)
        for i, path in enumerate(station_diagram.scene.entry(name).pieces):
            shape = Convex(str(station_diagram.scene.library.path(path)))
            instance = GeometryInstance(RigidTransform(), shape, f"{name}_piece_{i:03d}")
            instance.set_proximity_properties(ProximityProperties())
            graph.RegisterGeometry(graph_context, source, frame, instance)
