"""Objects of a scene as bodies of a plant."""

from __future__ import annotations

import logging

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RigidBody
from pydrake.planning import RobotDiagramBuilder

from burg_drake.core import InvalidInputError
from burg_drake.core.paths import Packages
from burg_drake.objects.library import LINK, MassProperties
from burg_drake.scene.document import Scene
from burg_drake.station.world.mesh_pieces import is_mesh, sdf_by_pieces
from burg_drake.station.world.model_file import (
    add_models,
    buffered_remarks,
    without_collisions,
    without_hydroelastic,
)
from burg_drake.station.world.robot import ROBOT_MODELS
from burg_drake.station.world.rolling import add_rolling, is_ball

SAME_INERTIA = 1e-6
"""Masses and moments may differ by this share: Drake shifts moments to the origin and back."""

RISE, PLACE = "rise", "place"
"""The joint of an object that does not turn [m], and the frame in the world that it stands on,
which may be moved through the context; for a plant that is not simulated."""


def add_instance(
    builder: RobotDiagramBuilder,
    scene: Scene,
    packages: Packages,
    name: str,
    *,
    by_pieces: bool = False,
    bare: bool = False,
) -> RigidBody:
    """Parses the object's SDF; the model instance goes by the name of the scene's instance.

    Args:
        builder: to add it to.
        scene: the scene.
        packages: what the station says of packages.
        name: the instance.
        by_pieces: for point queries alone, see `mesh_pieces`.
        bare: without its contact geometry.
    """
    plant, parser = builder.plant(), builder.parser()
    if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
        raise name_taken_error(scene, name)
    path = scene.library.path(scene.entry(name).sdf)
    try:
        with buffered_remarks() as remarks:
            if by_pieces and is_mesh(scene, name):
                text = without_hydroelastic(sdf_by_pieces(scene, name))
                (model,) = parser.AddModelsFromString(text, "sdf")
            else:
                edit = without_hydroelastic if by_pieces else without_collisions if bare else None
                (model,) = add_models(parser, path, packages, edit=edit)
            body = plant.GetBodyByName(LINK, model)
            _require_inertia(body, scene.entry(name).mass_properties)
            if is_ball(scene, name) and not by_pieces:
                add_rolling(builder, scene, name, body)
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
    """The error of an instance whose name is one of the station's."""
    return InvalidInputError(
        f"{scene.path}: the station has something called {name!r} already; rename this instance"
    )


def _require_inertia(body: RigidBody, listed: MassProperties) -> None:
    """Checks that a body weighs what the library says: where no body can have the mass or inertia
    of an SDF, Drake's parser warns, and takes others.

    Raises:
        ValueError: it does not.
    """
    inertia = body.default_spatial_inertia()
    about_com = inertia.Shift(inertia.get_com()).CalcRotationalInertia()
    moments = [*about_com.get_moments(), *about_com.get_products()]
    if abs(inertia.get_mass() - listed.mass) > SAME_INERTIA * listed.mass:
        raise ValueError(f"its mass differs from the {listed.mass:g} kg in library.yaml")
    if not np.allclose(moments, listed.inertia, rtol=0.0, atol=SAME_INERTIA * max(moments)):
        raise ValueError("its inertia differs from that in library.yaml")


def add_vertical_joint(plant: MultibodyPlant, body: RigidBody, X_WO: RigidTransform) -> None:
    """Hangs a body on a joint along world z, which stands at 0 where the body is placed."""
    model = body.model_instance()
    place = plant.AddFrame(FixedOffsetFrame(PLACE, plant.world_frame(), X_WO, model))
    up_O = X_WO.rotation().matrix()[2]
    plant.AddJoint(PrismaticJoint(RISE, place, body.body_frame(), up_O))
