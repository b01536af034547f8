"""A scene on its station in Meshcat: objects with their names, board, table, robot."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat, MeshcatParams, Rgba
from pydrake.systems.framework import Context

from burg_drake.core import Array, InvalidInputError, make_pose, rot_z, transform_points
from burg_drake.scene import Scene, placed_vertices
from burg_drake.station import Robot, Station, StationDiagram, build_station_diagram
from burg_drake.visualization.gltf import draw_label, label_mesh
from burg_drake.visualization.meshcat_drawing import aim_at
from burg_drake.visualization.object_drawing import box_corners


def open_meshcat(port: int | None = None) -> Meshcat:
    """Starts a Meshcat server: light background, no grid, no axes.

    Args:
        port: port on localhost; the first free one from 7000 if None.

    Raises:
        InvalidInputError: the port is taken.
    """
    sky_color = (0.93, 0.95, 0.97)
    floor_color = (0.76, 0.79, 0.82)
    # Intensities: soft light, and one lamp that casts shadows.
    lights = {
        "AmbientLight": 1.3,
        "FillLight": 0.5,
        "PointLightNegativeX": 9.0,
        "PointLightPositiveX": 9.0,
        "SpotLight": 22.0,
    }
    # Settings of three.js, for a sharp shadow without stripes.
    shadow = {"mapSize.width": 2048.0, "mapSize.height": 2048.0, "normalBias": 0.004, "radius": 3.0}
    try:
        meshcat = Meshcat(MeshcatParams(host="localhost", port=port, show_stats_plot=False))
    except RuntimeError as error:
        raise InvalidInputError(f"cannot listen on port {port}: {error}; choose another") from error
    meshcat.SetProperty("/Grid", "visible", False)
    meshcat.SetProperty("/Axes", "visible", False)
    meshcat.SetProperty("/Background/<object>", "top_color", list(sky_color))
    meshcat.SetProperty("/Background/<object>", "bottom_color", list(floor_color))
    for light, intensity in lights.items():
        meshcat.SetProperty(f"/Lights/{light}", "visible", intensity > 0.0)
        meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", intensity)
    lamp = "/Lights/SpotLight/<object>"
    meshcat.SetProperty(lamp, "castShadow", True)
    for key, value in shadow.items():
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
    """Shows a scene at its documented poses, with the robot at home, and aims the camera.

    Args:
        scene: scene on the board.
        station: station of the scene.
        meshcat: Meshcat to draw in.
        robot: robot as for `build_station_diagram`.
        labels: whether to write the instances' names on the board.

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
    color = (0.25, 0.27, 0.30)
    label_height = 0.022  # Metres, of a line of text.
    label_offset = 0.028  # Metres from an object's footprint to the foot of its name.
    label_lift = 1e-3  # Metres above the board, against flicker.
    labels_path = "/drake/labels"
    X_WS = station.document.X_WS.matrix()
    (x, y), z = scene.board.size, label_lift
    corners = transform_points(X_WS, [[0, 0, z], [x, 0, z], [x, y, z], [0, y, z], [0, 0, z]]).T
    meshcat.SetLine("/drake/board", np.asfortranarray(corners), 2.0, Rgba(*color))
    meshcat.Delete(labels_path)
    across = station.document.arm is not None
    for name in scene.instances if labels else ():
        points = placed_vertices(scene, name)
        lower, upper = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        p_SL = np.array([(lower[0] + upper[0]) / 2, lower[1] - label_offset, label_lift])
        if across:
            p_SL[1] = upper[1] + label_offset
        X_SL = make_pose(rot_z(np.pi if across else 0.0), p_SL)
        label = label_mesh((name,), label_height, color=color)
        draw_label(meshcat, f"{labels_path}/{name}", label, X_WS @ X_SL)


def aim_camera(
    scene: Scene,
    station: Station,
    meshcat: Meshcat,
    *,
    robot: Robot = "arm",
    also: Array | None = None,
) -> Array:
    """Aims the camera at the board: towards the arm if there is one, else from the lower edge.

    Args:
        scene: scene on the board, all of which will be in view.
        station: station of the scene.
        meshcat: Meshcat whose camera to set.
        robot: robot as for `build_station_diagram`.
        also: (N, 3) additional points in the world to have in view [m].

    Returns:
        (3, 3) `R_WC`.
    """
    eye_across_arm = (1.05, 1.63, 0.72)  # Direction in S from the board to the eye.
    eye_at_board = (0.3, -0.95, 0.74)  # Direction in S from the board to the eye.
    across = robot == "arm" and station.document.arm is not None
    p_SC = np.array(eye_across_arm if across else eye_at_board)
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


def robot_points(built: StationDiagram, context: Context) -> Array:
    """(N, 3) corners of boxes around the robot's bodies in a context of the diagram [m]."""
    body_radius = 0.09  # Metres, about, of a robot's body around its origin.
    plant_context = built.plant.GetMyContextFromRoot(context)
    origins = [
        built.plant.EvalBodyPoseInWorld(plant_context, built.plant.get_body(body)).translation()
        for body in built.robot_bodies
    ]
    boxes = [box_corners(p - body_radius, p + body_radius) for p in origins]
    return np.vstack(boxes) if boxes else np.empty((0, 3))
