"""Who meets whom, of objects that several geometries stand for: `world.rolling` and
`world.contact_parts` say why there are several."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.station.diagram.station_diagram import StationDiagram
from burg_drake.station.world import ROLLING, is_ball


def separate_contact(station_diagram: StationDiagram, context: Context | None = None) -> None:
    """Has each geometry of an object meet what it is for, and nothing else.

    The hand meets the patches of balls and the own surfaces of objects; the table meets the spheres
    that balls roll by and the feet of objects; all others meet these spheres, and the pieces, or
    the hull where there is one.

    Args:
        station_diagram: a built diagram.
        context: in this Context of the diagram alone; by default in all that are created from now
            on.
    """
    graph = station_diagram.diagram.mutable_scene_graph()
    objects = {**station_diagram.free, **station_diagram.standing, **station_diagram.fixed}
    geometries = {name: _of(station_diagram, [index]) for name, index in objects.items()}
    robot = _of(station_diagram, station_diagram.robot_bodies)
    table = _of(station_diagram, [station_diagram.table])
    surroundings = [g for one in geometries.values() for g in one] + table
    declaration = CollisionFilterDeclaration()
    patches, rolling = _ball_geometries(station_diagram, geometries)
    _exclude(declaration, patches, surroundings)
    _exclude(declaration, rolling, robot)
    parts = station_diagram.parts
    surfaces, feet, hulls = set(parts.surfaces), set(parts.feet), set(parts.hulls)
    soft = [g for g in robot if _is_hydroelastic(station_diagram, g)]
    hard = [g for g in robot if g not in set(soft)]
    _exclude(declaration, surfaces, surroundings + hard)
    _exclude(declaration, feet, [g for g in surroundings if g not in set(table)] + robot)
    _exclude(declaration, hulls, table + soft)
    for one in geometries.values():
        pieces = [g for g in one if g not in surfaces | feet | hulls]
        if surfaces & set(one):
            _exclude(declaration, pieces, soft)
        if feet & set(one):
            _exclude(declaration, pieces, table)
        if hulls & set(one):
            _exclude(declaration, pieces, [g for g in surroundings if g not in set(table)])
    manager = (
        graph.collision_filter_manager()
        if context is None
        else graph.collision_filter_manager(graph.GetMyMutableContextFromRoot(context))
    )
    manager.Apply(declaration)


def _exclude(
    declaration: CollisionFilterDeclaration,
    some: Collection[GeometryId],
    others: Collection[GeometryId],
) -> None:
    if some and others:
        declaration.ExcludeBetween(GeometrySet(list(some)), GeometrySet(list(others)))


def _of(station_diagram: StationDiagram, bodies: Iterable[BodyIndex]) -> list[GeometryId]:
    plant = station_diagram.plant
    return [g for i in bodies for g in plant.GetCollisionGeometriesForBody(plant.get_body(i))]


def _ball_geometries(
    station_diagram: StationDiagram, geometries: dict[str, list[GeometryId]]
) -> tuple[list[GeometryId], list[GeometryId]]:
    """Patches of balls, and the spheres that they roll by."""
    inspector = station_diagram.scene_graph.model_inspector()
    patches: list[GeometryId] = []
    rolling: list[GeometryId] = []
    for name, own in geometries.items():
        if is_ball(station_diagram.scene, name):
            for geometry in own:
                by_point = inspector.GetName(geometry).endswith(ROLLING)
                (rolling if by_point else patches).append(geometry)
    return patches, rolling


def _is_hydroelastic(station_diagram: StationDiagram, geometry: GeometryId) -> bool:
    inspector = station_diagram.scene_graph.model_inspector()
    properties = inspector.GetProximityProperties(geometry)
    return bool(properties.HasProperty("hydroelastic", "compliance_type"))
