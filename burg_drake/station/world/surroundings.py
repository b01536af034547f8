"""What stands around a scene: table, printed board and the station's obstacles, as plant bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    GeometryInstance,
    MakePhongIllustrationProperties,
    PerceptionProperties,
    ProximityProperties,
    Rgba,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from burg_drake.core import Array, InvalidInputError, make_pose
from burg_drake.core.documents import Vector3
from burg_drake.scene.document import Board
from burg_drake.station.document import Station
from burg_drake.station.world.board_visual import board_meshes
from burg_drake.station.world.robot import ROBOT_MODELS

TABLE_MODULUS = 1e6
"""Hydroelastic modulus of table and obstacles [Pa]. Household objects sink in by some hundredths of
a millimetre. At 1e7 the contact of an object at rest chatters from step to step, and a thrown one
stops four times too early; at 1e6 it obeys Coulomb's law."""
DISSIPATION = 5.0
"""Hunt-Crossley dissipation of table and obstacles [s/m]."""

POINT_STIFFNESS = 1e12
"""Of the table [N/m], so that a foot on it is as stiff as the foot."""

TABLE_COLOR = (0.82, 0.79, 0.74, 1.0)
SEEN_BOARD = {"paper": (0.97, 0.97, 0.95, 1.0), "markers": (0.06, 0.06, 0.06, 1.0)}
"""Colours for simulated cameras, as printed."""
SHOWN_BOARD = SEEN_BOARD | {"markers": (0.8, 0.8, 0.78, 1.0)}
"""Colours for people: pale, so that what stands on the board and is drawn there stands out."""
OBSTACLE_COLOR = (0.55, 0.58, 0.62, 1.0)
PAPER = 1e-4
"""Thickness of the sheet [m], as of usual paper. Its face, on which objects stand, lies in the
table's plane of contact; so that it shows, table and obstacles are drawn smaller on all sides."""


@dataclass(frozen=True, eq=False)
class FixedBox:
    """A box of the station that does not move.

    Attributes:
        X_WB: (4, 4) pose of its centre in the world.
        size: extents [m].
        friction: Coulomb coefficient.
        color: red, green, blue, opacity in [0, 1].
    """

    X_WB: Array
    size: Vector3
    friction: float
    color: tuple[float, float, float, float]


def table_box(station: Station) -> FixedBox:
    """The table; its top face lies in the plane z = 0 of the world."""
    table = station.document.table
    X_WB = make_pose(p_AB=(*table.center, -table.size[2] / 2))
    return FixedBox(X_WB, table.size, table.friction, TABLE_COLOR)


def obstacle_boxes(station: Station) -> dict[str, FixedBox]:
    """The station's obstacles by name; they have the table's friction."""
    friction = station.document.table.friction
    return {
        name: FixedBox(box.X_WB.matrix(), box.size, friction, OBSTACLE_COLOR)
        for name, box in station.document.background.items()
    }


def add_table(plant: MultibodyPlant, station: Station) -> RigidBody:
    """Adds the table. At a point it is as stiff as what meets it."""
    return _add_box(plant, "table", table_box(station), POINT_STIFFNESS)


def add_board(plant: MultibodyPlant, board: Board, station: Station, markers: bool) -> None:
    """Adds the printed sheet, to look at only.

    Args:
        plant: to add it to.
        board: the sheet.
        station: where it lies.
        markers: draw them; otherwise, and if they do not fit, it is white.
    """
    size = np.array([*board.size, PAPER])
    instance = plant.AddModelInstance("board")
    body = plant.AddRigidBody("board", instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    if markers:
        for name, mesh in board_meshes(board).items():
            part = GeometryInstance(RigidTransform(), mesh, name)
            part.set_illustration_properties(MakePhongIllustrationProperties(SHOWN_BOARD[name]))
            part.set_perception_properties(_seen_as(SEEN_BOARD[name]))
            plant.RegisterVisualGeometry(body, part)
    else:
        X_SB = RigidTransform(size * [0.5, 0.5, -0.5])
        color = np.array(SHOWN_BOARD["paper"])
        plant.RegisterVisualGeometry(body, X_SB, Box(*size), "paper", color)
    X_WS = RigidTransform(station.document.X_WS.matrix())
    plant.WeldFrames(plant.world_frame(), body.body_frame(), X_WS)


def add_obstacles(plant: MultibodyPlant, station: Station) -> dict[str, RigidBody]:
    """Adds the station's fixed boxes.

    Raises:
        InvalidInputError: a name is taken by the scene or the robot.
    """
    bodies = {}
    for name, box in obstacle_boxes(station).items():
        if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
            raise obstacle_name_error(station, name)
        bodies[name] = _add_box(plant, name, box)
    return bodies


def obstacle_name_error(station: Station, name: str) -> InvalidInputError:
    """The error of an obstacle whose name the scene or the robot has, too."""
    return InvalidInputError(
        f"{station.path}: background.{name}: the scene or the robot has something called"
        " that already; choose another name"
    )


def _add_box(
    plant: MultibodyPlant, name: str, fixed: FixedBox, point_stiffness: float | None = None
) -> RigidBody:
    """A box welded to the world as a body of its own: with collision geometry on the world body
    itself, locking a joint crashes (drake#24773)."""
    size = np.array(fixed.size)
    instance = plant.AddModelInstance(name)
    body = plant.AddRigidBody(name, instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    box, properties = Box(*size), _compliant_box(size, fixed.friction, point_stiffness)
    plant.RegisterCollisionGeometry(body, RigidTransform(), box, "collision", properties)
    drawn = Box(*np.maximum(size - 2 * PAPER, size / 2))  # thin ones, too, remain
    plant.RegisterVisualGeometry(body, RigidTransform(), drawn, "visual", np.array(fixed.color))
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(fixed.X_WB))
    return body


def _seen_as(color: tuple[float, ...]) -> PerceptionProperties:
    properties = PerceptionProperties()
    properties.AddProperty("phong", "diffuse", Rgba(*color))
    return properties


def _compliant_box(
    size: Array, friction: float, point_stiffness: float | None
) -> ProximityProperties:
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(float(np.max(size)), TABLE_MODULUS, properties)
    AddContactMaterial(
        dissipation=DISSIPATION,
        point_stiffness=point_stiffness,
        friction=CoulombFriction(friction, friction),
        properties=properties,
    )
    return properties
