"""Islands of objects that touch each other: they come to rest together, and are frozen together."""

from __future__ import annotations

from collections.abc import Collection

from pydrake.geometry import CollisionFilterDeclaration, GeometrySet
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from burg_drake.simulation.rest.neighbours import Neighbours
from burg_drake.station.diagram import StationDiagram


def islands(built: StationDiagram) -> list[list[BodyIndex]]:
    """The free objects, where the documents place them, by islands.

    Args:
        built: a built diagram.
    """
    neighbours, left = Neighbours(built), list(built.free.values())
    found = []
    while left:
        island = neighbours.close_to([left[0]])
        found.append([index for index in left if index in island])
        left = [index for index in left if index not in island]
    return found


def freeze(built: StationDiagram, root: Context, bodies: Collection[BodyIndex]) -> None:
    """Locks bodies, and takes their contacts with each other and with what is fixed out.

    Args:
        built: the diagram.
        root: its Context.
        bodies: free ones.
    """
    if not bodies:
        return
    plant, graph = built.plant, built.scene_graph
    frozen = [plant.get_body(index) for index in bodies]
    context = plant.GetMyMutableContextFromRoot(root)
    for body in frozen:
        body.Lock(context)
    fixed = [plant.get_body(index) for index in (built.table, *built.fixed.values())]
    geometries = GeometrySet(
        [g for body in (*frozen, *fixed) for g in plant.GetCollisionGeometriesForBody(body)]
    )
    declaration = CollisionFilterDeclaration().ExcludeWithin(geometries)
    graph.collision_filter_manager(graph.GetMyMutableContextFromRoot(root)).Apply(declaration)
