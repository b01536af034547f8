"""Objects whose contact geometry is a rigid mesh, where only point queries are asked.

In Drake a mesh meets pads and tables with its real surface, but point queries see its convex hull:
no finger could reach into a mug. Where nothing is simulated the object's convex pieces stand in for
the mesh. In simulation they cannot, as they would be touched beside it: there, two such objects
meet with their hulls.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydrake.geometry import Convex, GeometryInstance, ProximityProperties, Role
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from burg_drake.objects.library import model_sdf
from burg_drake.scene.document import Scene
from burg_drake.station.world.model_file import file_uri

if TYPE_CHECKING:
    from burg_drake.station.diagram import StationDiagram


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


def sdf_by_pieces(scene: Scene, name: str) -> str:
    """The model of an instance with pieces, for a diagram that is never simulated."""
    library, entry = scene.library, scene.entry(name)
    pieces = [file_uri(library.path(path)) for path in entry.pieces]
    visual = file_uri(library.path(entry.mesh))
    return model_sdf(name, entry.mass_properties, entry.friction, visual, pieces)


def is_mesh(scene: Scene, name: str) -> bool:
    """Whether `name` is an instance whose contact geometry is a rigid mesh."""
    instances = {**scene.instances, **scene.background}
    return name in instances and scene.entry(name).contact.kind == "mesh"
