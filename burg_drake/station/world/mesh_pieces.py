"""Objects whose contact geometry is a rigid mesh, where only point queries are asked.

In Drake a mesh meets pads and tables with its real surface, but point queries see its convex hull:
no finger could reach into a mug. Where nothing is simulated the object's convex pieces stand in for
the mesh. In simulation they cannot, as they would be touched beside it: there, two such objects
meet with their hulls.
"""

from __future__ import annotations

from burg_drake.objects.library import model_sdf
from burg_drake.scene.document import Scene
from burg_drake.station.world.model_file import file_uri


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
