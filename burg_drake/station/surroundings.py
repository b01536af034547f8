"""Table, printed board and obstacles as bodies of a plant, and the board's meshes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    GeometryInstance,
    InMemoryMesh,
    MakePhongIllustrationProperties,
    Mesh,
    PerceptionProperties,
    ProximityProperties,
    Rgba,
)
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from burg_drake.core import Array, InvalidInputError, Vector3, make_pose
from burg_drake.scene import Board
from burg_drake.station.robot import ROBOT_MODELS
from burg_drake.station.station_document import Station

LINE_TOLERANCE = 1e-7
"""Metres between edges of cells that are one line."""


@lru_cache(maxsize=16)
def board_meshes(board: Board) -> dict[str, Mesh]:
    """Meshes of the sheet, `paper` and `markers`, in the scene frame.

    A board that is too small for its markers has only paper.
    """
    try:
        x, y, black = marker_grid(board)
    except InvalidInputError:
        (x, y), black = ([np.array([0.0, s]) for s in board.size]), np.zeros((1, 1), dtype=bool)
    parts = {"paper": ~black, "markers": black}
    return {name: _squares_as_obj(x, y, cells) for name, cells in parts.items() if cells.any()}


def marker_grid(board: Board) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Grid lines across the whole sheet at all edges of marker cells.

    Meshes of this grid share all vertices, so that there are no visible seams.

    Returns:
        x (X + 1,) and y (Y + 1,) of the lines [m], ascending; which squares (X, Y) between them are
        black.

    Raises:
        InvalidInputError: the markers do not fit.
    """
    layout = board.layout
    steps = np.linspace(0.0, layout.side, layout.cells + 1)
    left, bottom = layout.p_SQ[:, 3, 0], layout.p_SQ[:, 3, 1]
    x, y = (
        _distinct_values(np.append((first[:, None] + steps).ravel(), [0.0, extent]))
        for first, extent in zip((left, bottom), board.size, strict=True)
    )
    black = np.zeros((len(x) - 1, len(y) - 1), dtype=bool)
    columns, rows = (
        np.searchsorted(x, left - LINE_TOLERANCE),
        np.searchsorted(y, bottom - LINE_TOLERANCE),
    )
    for column, row, cells in zip(columns, rows, layout.black, strict=True):
        black[column : column + len(cells), row : row + len(cells)] = cells[::-1].T
    return x, y, black


def _distinct_values(values: Array) -> Array:
    ascending = np.sort(values)
    lines: Array = ascending[np.append(True, np.diff(ascending) > LINE_TOLERANCE)]
    return lines


def _squares_as_obj(x: Array, y: Array, chosen: NDArray[np.bool_]) -> Mesh:
    """Mesh (OBJ) of chosen squares of a grid, facing up."""
    i, j = np.nonzero(chosen)
    around = [i, i + 1, i + 1, i], [j, j, j + 1, j + 1]  # counter-clockwise
    corners = np.ravel_multi_index(around, (len(x), len(y))).T  # (N, 4)
    used, faces = np.unique(corners, return_inverse=True)
    u, v = np.unravel_index(used, (len(x), len(y)))
    lines = [f"v {a:.9g} {b:.9g} 0" for a, b in zip(x[u], y[v], strict=True)]
    lines.append("vn 0 0 1")
    lines += ["f " + " ".join(f"{n}//1" for n in face) for face in faces.reshape(-1, 4) + 1]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines), ".obj", "board")))


PRINTED_BOARD_COLORS = {"paper": (0.97, 0.97, 0.95, 1.0), "markers": (0.06, 0.06, 0.06, 1.0)}
"""RGBA for simulated cameras, as printed."""


class SurroundingsProperties:
    """Contact properties, colours and thickness of table, obstacles and printed board."""

    hydroelastic_modulus = 1e6  # Pascal; at 1e7 contact chatters.
    dissipation = 5.0  # s/m, Hunt-Crossley.
    point_stiffness = 1e12  # N/m; a foot decides the stiffness.
    table_color = (0.82, 0.79, 0.74, 1.0)  # RGBA.
    obstacle_color = (0.55, 0.58, 0.62, 1.0)  # RGBA.
    paper_thickness = 1e-4  # Metres; table and obstacles are drawn smaller by it.


@dataclass(frozen=True, eq=False)
class FixedBox:
    """A fixed box of the station.

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
    return FixedBox(X_WB, table.size, table.friction, SurroundingsProperties.table_color)


def obstacle_boxes(station: Station) -> dict[str, FixedBox]:
    """The station's obstacles by name; they have the table's friction."""
    friction = station.document.table.friction
    return {
        name: FixedBox(box.X_WB.matrix(), box.size, friction, SurroundingsProperties.obstacle_color)
        for name, box in station.document.background.items()
    }


def add_table(plant: MultibodyPlant, station: Station) -> RigidBody:
    """Adds the table. In point contact it is as stiff as the other body."""
    return _add_box(plant, "table", table_box(station), SurroundingsProperties.point_stiffness)


def add_board(plant: MultibodyPlant, board: Board, station: Station, markers: bool) -> None:
    """Adds the printed sheet as a visual mesh.

    Args:
        plant: the plant.
        board: the sheet.
        station: station with the sheet's pose.
        markers: draw the markers; otherwise, and if they do not fit, the sheet is white.
    """
    # In the viewer, objects and drawings stand out on a pale board.
    pale_colors = PRINTED_BOARD_COLORS | {"markers": (0.8, 0.8, 0.78, 1.0)}
    size = np.array([*board.size, SurroundingsProperties.paper_thickness])
    instance = plant.AddModelInstance("board")
    body = plant.AddRigidBody("board", instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    if markers:
        for name, mesh in board_meshes(board).items():
            part = GeometryInstance(RigidTransform(), mesh, name)
            part.set_illustration_properties(MakePhongIllustrationProperties(pale_colors[name]))
            printed = PerceptionProperties()
            printed.AddProperty("phong", "diffuse", Rgba(*PRINTED_BOARD_COLORS[name]))
            part.set_perception_properties(printed)
            plant.RegisterVisualGeometry(body, part)
    else:
        X_SB = RigidTransform(size * [0.5, 0.5, -0.5])
        color = np.array(pale_colors["paper"])
        plant.RegisterVisualGeometry(body, X_SB, Box(*size), "paper", color)
    X_WS = RigidTransform(station.document.X_WS.matrix())
    plant.WeldFrames(plant.world_frame(), body.body_frame(), X_WS)


def add_obstacles(plant: MultibodyPlant, station: Station) -> dict[str, RigidBody]:
    """Adds the station's fixed boxes.

    Raises:
        InvalidInputError: a name is used by the scene or the robot.
    """
    bodies = {}
    for name, box in obstacle_boxes(station).items():
        if plant.HasModelInstanceNamed(name) or name in ROBOT_MODELS:
            raise obstacle_name_error(station, name)
        bodies[name] = _add_box(plant, name, box)
    return bodies


def obstacle_name_error(station: Station, name: str) -> InvalidInputError:
    """The error for an obstacle with a name from the scene or the robot."""
    return InvalidInputError(
        f"{station.path}: background.{name}: the scene or the robot has something called"
        " that already; choose another name"
    )


def _add_box(
    plant: MultibodyPlant, name: str, fixed: FixedBox, point_stiffness: float | None = None
) -> RigidBody:
    """Adds a box as a separate body welded to the world: with collision geometry on the world body
    itself, locking a joint crashes (drake#24773)."""
    size = np.array(fixed.size)
    instance = plant.AddModelInstance(name)
    body = plant.AddRigidBody(name, instance, SpatialInertia.SolidBoxWithMass(1.0, *size))
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(
        float(np.max(size)), SurroundingsProperties.hydroelastic_modulus, properties
    )
    AddContactMaterial(
        dissipation=SurroundingsProperties.dissipation,
        point_stiffness=point_stiffness,
        friction=CoulombFriction(fixed.friction, fixed.friction),
        properties=properties,
    )
    plant.RegisterCollisionGeometry(body, RigidTransform(), Box(*size), "collision", properties)
    # keep thin boxes visible
    drawn = Box(*np.maximum(size - 2 * SurroundingsProperties.paper_thickness, size / 2))
    plant.RegisterVisualGeometry(body, RigidTransform(), drawn, "visual", np.array(fixed.color))
    plant.WeldFrames(plant.world_frame(), body.body_frame(), RigidTransform(fixed.X_WB))
    return body
