"""A scene on its station in Meshcat: objects with their names, board, table, robot."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.geometry import Meshcat, MeshcatParams, Rgba
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, transform_points
from burg_drake.scene.document import Scene, placed_vertices
from burg_drake.station.diagram import StationDiagram, build_station_diagram
from burg_drake.station.document import Station
from burg_drake.station.world import Robot
from burg_drake.visualization.meshcat import aim_at, text_triangles

SKY_COLOR = (0.93, 0.95, 0.97)
FLOOR_COLOR = (0.76, 0.79, 0.82)
LIGHTS = {
    "AmbientLight": 1.3,
    "FillLight": 0.5,
    "PointLightNegativeX": 9.0,
    "PointLightPositiveX": 9.0,
    "SpotLight": 22.0,
}
"""Intensities of Meshcat's lights: soft, and one that casts shadows."""
SHADOW = {"mapSize.width": 2048.0, "mapSize.height": 2048.0, "normalBias": 0.004, "radius": 3.0}
"""Settings of the shadow, in three.js' terms, so that it is sharp without stripes."""
INK = Rgba(0.25, 0.27, 0.30, 1.0)
LABEL_HEIGHT = 0.011
"""Capital letters of the names on the board [m]."""
LABEL_GAP = 0.012
"""Between an object's footprint and its name [m]."""
LABEL_LIFT = 1e-3
"""Height of names and outline above the board, against flicker [m]."""
BODY_RADIUS = 0.09
"""Of the robot's bodies around their origins, about, for what has to be in view [m]."""
ACROSS = (1.05, 1.63, 0.72)
ALONE = (0.3, -0.95, 0.74)
"""Directions in S from the board to the eye: across from the arm, and at the board alone."""

LABELS_PATH = "/drake/labels"


def open_meshcat(port: int | None = None) -> Meshcat:
    """A Meshcat server with a quiet page: light background, no grid, no axes.

    Args:
        port: where to listen on localhost; the first free one from 7000 if None.

    Raises:
        InvalidInputError: the port is taken.
    """
    try:
        meshcat = Meshcat(MeshcatParams(host="localhost", port=port, show_stats_plot=False))
    except RuntimeError as error:
        raise InvalidInputError(f"cannot listen on port {port}: {error}; choose another") from error
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", list(SKY_COLOR))
    meshcat.SetProperty("/Background/<object>", "bottom_color", list(FLOOR_COLOR))
    for light, intensity in LIGHTS.items():
        meshcat.SetProperty(f"/Lights/{light}", "visible", intensity > 0.0)
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", intensity)
    lamp = "/Lights/SpotLight/<object>"
    meshcat.SetProperty(lamp, "castShadow", True)
    for key, value in SHADOW.items():
        meshcat.SetProperty(lamp, f"shadow.{key}", value)
    return meshcat


def show_scene(
    scene: Scene,
    station: Station,
    meshcat: Meshcat,
    *,
    robot: Robot = "arm",
    labels: bool = True,
) -> StationDiagram:
    """Shows a scene as its document places it, the robot at home, and aims the camera.

    Args:
        scene: what stands on the board.
        station: where.
        meshcat: where to show it.
        robot: as for `build_station_diagram`.
        labels: write the instances' names on the board.

    Returns:
        The diagram that was shown.
    """
    station_diagram = build_station_diagram(scene, station, robot=robot, meshcat=meshcat)
    context = station_diagram.diagram.CreateDefaultContext()
    station_diagram.diagram.ForcedPublish(context)
    draw_board(scene, station, meshcat, labels=labels)
    shown = robot_points(station_diagram, context)
    aim_camera(scene, station, meshcat, robot=robot, also=shown)
    return station_diagram


def draw_board(scene: Scene, station: Station, meshcat: Meshcat, *, labels: bool = True) -> None:
    """Draws the outline of the board and, beside each object, the name of the instance.

    With an arm the names read from the side across from it, where the camera is; without one
    they read from the board's lower edge.
    """
    X_WS = station.document.X_WS.matrix()
    (x, y), z = scene.board.size, LABEL_LIFT
    corners = transform_points(X_WS, [[0, 0, z], [x, 0, z], [x, y, z], [0, y, z], [0, 0, z]]).T
    meshcat.SetLine("/drake/board", np.asfortranarray(corners), 2.0, INK)
    meshcat.Delete(LABELS_PATH)
    across = station.document.arm is not None
    for name in scene.instances if labels else ():
        points = placed_vertices(scene, name)
        lower, upper = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        below = LABEL_GAP + LABEL_HEIGHT
        p_SL = np.array([(lower[0] + upper[0]) / 2, lower[1] - below, LABEL_LIFT])
        if across:
            p_SL[1] = upper[1] + below
        X_SL = RigidTransform(RotationMatrix.MakeZRotation(np.pi if across else 0.0), p_SL)
        vertices, faces = text_triangles(name, LABEL_HEIGHT)
        path = f"{LABELS_PATH}/{name}"
        meshcat.SetTriangleMesh(path, vertices, faces, INK)
        meshcat.SetTransform(path, RigidTransform(X_WS) @ X_SL)


def aim_camera(
    scene: Scene,
    station: Station,
    meshcat: Meshcat,
    *,
    robot: Robot = "arm",
    also: Array | None = None,
) -> Array:
    """Looks at the board: across it towards the arm if there is one, else from its lower edge.

    Args:
        scene: what stands on the board; all of it will be in view.
        station: where.
        meshcat: whose camera to set.
        robot: as for `build_station_diagram`.
        also: (N, 3) points in the world that will be in view, too [m].

    Returns:
        (3, 3) `R_WC`.
    """
    across = robot == "arm" and station.document.arm is not None
    p_SC = np.array(ACROSS if across else ALONE)
    if not across and station.document.arm is not None:  # the names read from the other side
        p_SC[:2] *= -1.0
    forward = -station.document.X_WS.matrix()[:3, :3] @ p_SC
    points = [scene_points(scene, station)] + ([] if also is None else [also])
    return aim_at(meshcat, np.vstack(points), forward)


def scene_points(scene: Scene, station: Station) -> Array:
    """(N, 3) corners of the board and of boxes around all free objects, in the world [m]."""
    x, y = scene.board.size
    points = [np.array([[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]], dtype=float)]
    for name in scene.instances:
        vertices = placed_vertices(scene, name)
        points.append(box_corners(vertices.min(axis=0), vertices.max(axis=0)))
    return transform_points(station.document.X_WS.matrix(), np.vstack(points))


def box_corners(lower: ArrayLike, upper: ArrayLike) -> Array:
    """(8, 3) corners of the box between two points (3,)."""
    sides = np.stack([np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)], axis=1)
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 3)


def robot_points(built: StationDiagram, context: Context) -> Array:
    """(N, 3) corners of boxes around the robot's bodies in a context of the diagram [m]."""
    plant_context = built.plant.GetMyContextFromRoot(context)
    origins = [
        built.plant.EvalBodyPoseInWorld(plant_context, built.plant.get_body(body)).translation()
        for body in built.robot_bodies
    ]
    boxes = [box_corners(p - BODY_RADIUS, p + BODY_RADIUS) for p in origins]
    return np.vstack(boxes) if boxes else np.empty((0, 3))
