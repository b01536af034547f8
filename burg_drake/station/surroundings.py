"""What stands around a scene: table, printed board and the station's obstacles, as plant bodies."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array
from burg_drake.scene.scene import Board
from burg_drake.station.robot import ROBOT_MODELS
from burg_drake.station.station import Station

TABLE_MODULUS = 1e6
"""Hydroelastic modulus of table and obstacles [Pa]. Household objects sink in by some hundredths of
a millimetre. At 1e7 the contact of an object at rest chatters from step to step, and a thrown one
stops four times too early; at 1e6 it obeys Coulomb's law."""
DISSIPATION = 5.0
"""Hunt-Crossley dissipation of table and obstacles [s/m]."""

TABLE_COLOR = (0.82, 0.79, 0.74, 1.0)
BOARD_COLOR = (0.97, 0.97, 0.95, 1.0)
OBSTACLE_COLOR = (0.55, 0.58, 0.62, 1.0)
BOARD_THICKNESS = 5e-4


def add_table(plant: MultibodyPlant, station: Station) -> RigidBody:
    """Adds the table; its top face lies in the plane z = 0 of the world."""
    table = station.document.table
    X_WB = np.eye(4)
    X_WB[:3, 3] = (*table.center, -table.size[2] / 2)
    return _add_box(plant, "table", X_WB, np.array(table.size), table.friction, TABLE_COLOR)


def add_board(plant: MultibodyPlant, board: Board, station: Station) -> None:
    """Adds the printed sheet, to look at only."""
    size = np.array([*board.size, BOARD_THICKNESS])
    X_SB = np.eye(4)
    X_SB[:3, 3] = (size[0] / 2, size[1] / 2, -BOARD_THICKNESS / 4)
    X_WB = station.document.X_WS.matrix() @ X_SB
    instance = plant.AddModelInstance("board")
    body = plant.AddRigidBody("board", instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    plant.RegisterVisualGeometry(
        body, RigidTransform(), Box(*size), "visual", np.array(BOARD_COLOR)
    )
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WB))


def add_obstacles(plant: MultibodyPlant, station: Station) -> dict[str, RigidBody]:
    """Adds the station's fixed boxes.

    Raises:
        InvalidInputError: a name is taken by the scene or the robot.
    """
    friction = station.document.table.friction
    bodies = {}
    for name, box in station.document.background.items():
        if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
            raise InvalidInputError(
                f"{station.path}: background.{name}: the name is taken by the scene or the robot;"
                " choose another"
            )
        size = np.array(box.size)
        bodies[name] = _add_box(plant, name, box.X_WB.matrix(), size, friction, OBSTACLE_COLOR)
    return bodies


def _add_box(
    plant: MultibodyPlant, name: str, X_WB: Array, size: Array, friction: float, color: tuple
) -> RigidBody:
    """A box welded to the world as a body of its own: with collision geometry on the world body
    itself, locking a joint crashes (drake#24773)."""
    instance = plant.AddModelInstance(name)
    body = plant.AddRigidBody(name, instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    box = Box(*size)
    plant.RegisterCollisionGeometry(
        body, RigidTransform(), box, "collision", _compliant_box(size, friction)
    )
    plant.RegisterVisualGeometry(body, RigidTransform(), box, "visual", np.array(color))
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(X_WB))
    return body


def _compliant_box(size: Array, friction: float) -> ProximityProperties:
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(float(np.max(size)), TABLE_MODULUS, properties)
    AddContactMaterial(
        dissipation=DISSIPATION, friction=CoulombFriction(friction, friction), properties=properties
    )
    return properties
