"""Objects of a scene as bodies of a plant: free, welded, rolling, or with convex pieces."""

from __future__ import annotations

import logging

import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Convex,
    GeometryId,
    GeometryInstance,
    IllustrationProperties,
    Mesh,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RigidBody, SpatialInertia
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import Array, InvalidInputError, Packages
from burg_drake.objects import LINK_NAME, MassProperties, hull_corners, model_sdf
from burg_drake.scene import Scene
from burg_drake.station.model_file import (
    add_models,
    buffer_drake_log,
    file_uri,
    without_collisions,
    without_hydroelastic,
)
from burg_drake.station.robot import ROBOT_MODELS

ROLLING_GEOMETRY = "rolling"
"""Name of the sphere on which a ball rolls."""


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


def add_rolling_sphere(
    builder: RobotDiagramBuilder, scene: Scene, name: str, body: RigidBody
) -> None:
    """Adds the sphere on which a ball rolls; `filter_contact_pairs` sets its contacts."""
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
    plant.RegisterCollisionGeometry(
        body, X_OP, Sphere(primitive.size[0]), ROLLING_GEOMETRY, properties
    )


def sdf_by_pieces(scene: Scene, name: str) -> str:
    """SDF of an instance with convex pieces, for a diagram that is never simulated."""
    library, entry = scene.library, scene.entry(name)
    pieces = [file_uri(library.path(path)) for path in entry.pieces]
    visual = file_uri(library.path(entry.mesh))
    return model_sdf(name, entry.mass_properties, entry.friction, visual, pieces)


def has_mesh_contact(scene: Scene, name: str) -> bool:
    """Whether `name` is an instance whose contact geometry is a rigid mesh."""
    instances = {**scene.instances, **scene.background}
    return name in instances and scene.entry(name).contact.kind == "mesh"


VERTICAL_JOINT_NAME = "rise"  # Name of the vertical joint of a welded object.
PLACEMENT_FRAME_NAME = "place"  # Name of the frame in the world on which a vertical joint stands.


def add_instance(
    builder: RobotDiagramBuilder,
    scene: Scene,
    packages: Packages,
    name: str,
    *,
    by_pieces: bool = False,
    bare: bool = False,
) -> RigidBody:
    """Adds the object's SDF; the model instance has the name of the scene's instance.

    Args:
        builder: the builder.
        scene: the scene.
        packages: the station's package folders.
        name: the instance.
        by_pieces: use pieces instead of rigid meshes, for point queries only.
        bare: leave out the contact geometry.
    """
    plant, parser = builder.plant(), builder.parser()
    if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
        raise name_taken_error(scene, name)
    path = scene.library.path(scene.entry(name).sdf)
    try:
        with buffer_drake_log() as remarks:
            if by_pieces and has_mesh_contact(scene, name):
                text = without_hydroelastic(sdf_by_pieces(scene, name))
                (model,) = parser.AddModelsFromString(text, "sdf")
            else:
                edit = without_hydroelastic if by_pieces else without_collisions if bare else None
                (model,) = add_models(parser, path, packages, edit=edit)
            body = plant.GetBodyByName(LINK_NAME, model)
            _require_inertia(body, scene.entry(name).mass_properties)
            if is_ball(scene, name) and not by_pieces:
                add_rolling_sphere(builder, scene, name, body)
    except (RuntimeError, ValueError) as error:
        raise InvalidInputError(
            f"{path} cannot be loaded ({' '.join(str(error).split())}); build the library"
            f" {scene.library.name!r} again"
        ) from error
    for remark in remarks:
        logging.getLogger("drake").handle(remark)
    plant.RenameModelInstance(model, name)
    return body


def name_taken_error(scene: Scene, name: str) -> InvalidInputError:
    """The error for an instance with the name of a part of the station."""
    return InvalidInputError(
        f"{scene.path}: the station has something called {name!r} already; rename this instance"
    )


def _require_inertia(body: RigidBody, listed: MassProperties) -> None:
    """Checks a body's mass and inertia against the library: if those of an SDF are invalid, Drake's
    parser warns and replaces them.

    Raises:
        ValueError: they differ.
    """
    tolerance = 1e-6  # Relative; Drake shifts moments to the origin and back.
    inertia = body.default_spatial_inertia()
    about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    moments = [*about_com.get_moments(), *about_com.get_products()]
    if abs(inertia.get_mass() - listed.mass) > tolerance * listed.mass:
        raise ValueError(f"its mass differs from the {listed.mass:g} kg in library.yaml")
    if not np.allclose(moments, listed.inertia, rtol=0.0, atol=tolerance * max(moments)):
        raise ValueError("its inertia differs from that in library.yaml")


def add_vertical_joint(plant: MultibodyPlant, body: RigidBody, X_WO: RigidTransform) -> None:
    """Attaches a body to a joint along world z, with position 0 at the body's pose."""
    model = body.model_instance()
    place = plant.AddFrame(FixedOffsetFrame(PLACEMENT_FRAME_NAME, plant.world_frame(), X_WO, model))
    up_O = X_WO.rotation().matrix()[2]
    plant.AddJoint(PrismaticJoint(VERTICAL_JOINT_NAME, place, body.body_frame(), up_O))


def add_fixed_instance(plant: MultibodyPlant, scene: Scene, name: str, X_WO: Array) -> RigidBody:
    """Adds an instance as a collision hull and a visual mesh, welded at its pose."""
    if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
        raise name_taken_error(scene, name)
    entry, model = scene.entry(name), plant.AddModelInstance(name)
    body = plant.AddRigidBody(
        LINK_NAME, model, SpatialInertia.SolidSphereWithMass(entry.mass, 0.01)
    )
    add_hull(plant, scene, name, body)
    look = GeometryInstance(RigidTransform(), Mesh(str(scene.library.path(entry.mesh))), "visual")
    look.set_illustration_properties(IllustrationProperties())
    plant.RegisterVisualGeometry(body, look)
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WO))
    return body


def add_hull(plant: MultibodyPlant, scene: Scene, name: str, body: RigidBody) -> GeometryId:
    """Adds the convex hull of an instance's contact geometry."""
    shape = Convex(hull_corners(scene.library, scene.entry(name)).T, name)
    X = RigidTransform()
    return plant.RegisterCollisionGeometry(body, X, shape, "hull", ProximityProperties())
