"""What of bodies touches others, as Drake holds it: of a library's objects, and of what stands
around a scene."""

from __future__ import annotations

from pydrake.geometry import SceneGraphInspector, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core.paths import Packages
from burg_drake.objects.library import ObjectLibrary
from burg_drake.scene.document import Instance, Scene, SceneDocument
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.document import ENGINES
from burg_drake.station.world import add_instance, set_packages

PosedShapes = tuple[tuple[RigidTransform, Shape], ...]
"""Convex shapes with their poses in one frame. Drake takes a mesh for its convex hull."""

ALONE = "alone"
"""Name of the instance in a plant that holds nothing else."""


def object_shapes(library: ObjectLibrary, name: str, packages: Packages) -> PosedShapes:
    """Shapes of an object in its own frame; those of a rigid mesh are its convex pieces.

    Args:
        library: where the object is.
        name: of the object.
        packages: what the station says of packages.

    Raises:
        UnknownNameError: no such object.
        InvalidInputError: its model cannot be loaded, or does not weigh what the library says.
    """
    instance = Instance(name=ALONE, object=name)
    document = SceneDocument(name=ALONE, library=str(library.root), instances=(instance,))
    scene = Scene(document, library, library.root)
    builder = RobotDiagramBuilder(time_step=ENGINES["standard"].time_step)
    set_packages(builder.parser(), {})
    builder.parser().SetAutoRenaming(True)
    body = add_instance(builder, scene, packages, ALONE, by_pieces=True)
    inspector = builder.scene_graph().model_inspector()
    return _shapes(builder.plant(), inspector, body, RigidTransform())


def surrounding_shapes(station_diagram: StationDiagram) -> dict[str, PosedShapes]:
    """Shapes in the world of all that is not an instance of the scene: the table, the station's
    obstacles, and the links of the robot in its home posture, by their names."""
    plant, inspector = station_diagram.plant, station_diagram.scene_graph.model_inspector()
    obstacles = station_diagram.station.document.background
    bodies = {"table": station_diagram.table}
    bodies |= {name: station_diagram.fixed[name] for name in obstacles}
    bodies |= {plant.get_body(i).name(): i for i in station_diagram.robot_bodies}
    context = plant.CreateDefaultContext()
    return {
        name: _shapes(plant, inspector, body, plant.EvalBodyPoseInWorld(context, body))
        for name, body in ((name, plant.get_body(i)) for name, i in bodies.items())
    }


def _shapes(
    plant: MultibodyPlant, inspector: SceneGraphInspector, body: RigidBody, X_FB: RigidTransform
) -> PosedShapes:
    return tuple(
        (X_FB @ inspector.GetPoseInFrame(geometry), inspector.GetShape(geometry))
        for geometry in plant.GetCollisionGeometriesForBody(body)
    )
