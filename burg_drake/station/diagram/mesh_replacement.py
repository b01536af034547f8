"""Convex pieces in the place of rigid meshes in a Context; `world.mesh_pieces` says why."""

from __future__ import annotations

from pydrake.geometry import Convex, GeometryInstance, ProximityProperties, Role
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from burg_drake.station.diagram.station_diagram import StationDiagram
from burg_drake.station.world import is_mesh


def mesh_by_pieces(station_diagram: StationDiagram, context: Context) -> None:
    """In a Context, puts pieces in the place of the objects' meshes; all else stays.

    Args:
        station_diagram: the diagram.
        context: of the whole diagram; not to be simulated with afterwards.
    """
    plant, graph = station_diagram.plant, station_diagram.scene_graph
    source = plant.get_source_id()
    graph_context = graph.GetMyMutableContextFromRoot(context)
    for name, index in {**station_diagram.free, **station_diagram.fixed}.items():
        if not is_mesh(station_diagram.scene, name):
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
