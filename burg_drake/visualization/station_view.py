"""A station in Meshcat: its cameras and their images, obstacles, and the arm's reachability map."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Meshcat, Rgba
from pydrake.math import RigidTransform

from burg_drake.core import Array, count_with_noun, make_pose, transform_points
from burg_drake.motion import ArmSpan, ReachabilityMap
from burg_drake.scene import Scene
from burg_drake.station import Camera, Robot, Station, SurroundingsProperties, frustum
from burg_drake.visualization.colors import hex_color, map_colors, rgb_from_hex
from burg_drake.visualization.gltf import draw_label, label_mesh
from burg_drake.visualization.legend import ColorBar, LegendEntry
from burg_drake.visualization.scene_view import aim_camera, robot_points, show_scene

CAMERAS_PATH = "/drake/cameras"
MAP_PATH = "/drake/reachability"

REACHABILITY_BINS = 10  # Colours of a reachability map.
MAP_TILE_LIFT = 2e-3
"""Height of the lowest tiles above the board, in metres, against flicker."""


def show_station(
    scene: Scene,
    station: Station,
    meshcat: Meshcat,
    *,
    reachability: ReachabilityMap | None = None,
    span: ArmSpan | None = None,
    camera: str | None = None,
) -> list[LegendEntry | ColorBar]:
    """Shows a station with a scene on it.

    Args:
        scene: scene on the board.
        station: the station.
        meshcat: Meshcat to draw in.
        reachability: map to draw as coloured tiles, if given.
        span: span of the arm, drawn as its circle on the table top, if given.
        camera: camera to look through; across the board if None.

    Returns:
        A legend that shows and hides the parts.

    Raises:
        UnknownNameError: the station has no such camera.
    """
    through = None if camera is None else station.camera(camera)
    robot: Robot = "arm" if station.document.arm is not None else "none"
    built = show_scene(scene, station, meshcat, robot=robot)
    seen = [robot_points(built, built.diagram.CreateDefaultContext())]
    legend: list[LegendEntry | ColorBar] = []
    if reachability is not None:
        legend += draw_reachability(reachability, station, meshcat, board_condition(scene))
    if span is not None:
        legend.append(draw_span(span, meshcat))
        seen.append(span_circle(span))
    if station.document.cameras:
        R_WC = aim_camera(scene, station, meshcat, robot=robot)
        entry, points = draw_cameras(station, meshcat, R_WC @ np.diag([1.0, -1.0, -1.0]))
        legend.append(entry)
        seen.append(points)
    if station.document.background:
        legend.append(draw_obstacles(station, meshcat))
    aim_camera(scene, station, meshcat, robot=robot, also=np.vstack(seen))
    if through is not None:
        look_through(through, meshcat)
        meshcat.SetProperty(f"{CAMERAS_PATH}/{camera}", "visible", False)
    return legend


def draw_obstacles(station: Station, meshcat: Meshcat) -> LegendEntry:
    """Draws the station's obstacles transparently, in place of the obstacles of a diagram."""
    obstacles_path = "/drake/obstacles"
    opacity = 0.35  # Things behind an obstacle stay visible.
    r, g, b, _ = SurroundingsProperties.obstacle_color
    for name, box in station.document.background.items():
        meshcat.SetProperty(f"/drake/visualizer/{name}", "visible", False)
        meshcat.SetObject(f"{obstacles_path}/{name}", Box(*box.size), Rgba(r, g, b, opacity))
        meshcat.SetTransform(f"{obstacles_path}/{name}", RigidTransform(box.X_WB.matrix()))
    return LegendEntry("obstacles", hex_color((r, g, b)), (obstacles_path,))


def board_condition(scene: Scene) -> str:
    """Condition of a reachability map, in words: the objects on the board."""
    count = len(scene.instances) + len(scene.background)
    if count == 0:
        return "board empty"
    return f"with the {count_with_noun(count, 'object')} of {scene.name} in the way"


def draw_cameras(station: Station, meshcat: Meshcat, R_WT: Array) -> tuple[LegendEntry, Array]:
    """Draws each camera as the pyramid over its image, upper edge bold, with its name.

    Args:
        station: station with at least one camera.
        meshcat: Meshcat to draw in.
        R_WT: (3, 3) orientation of the names: x along the text, y up.

    Returns:
        A legend switch for the cameras, and points (N, 3) around the drawings [m].
    """
    camera_color = "#b3471d"
    image_depth = 0.16  # Metres.
    name_height = 0.036  # Metres, of a line of text.
    drawn = []
    for name, camera in station.document.cameras.items():
        path = f"{CAMERAS_PATH}/{name}"
        p_WC = np.array(camera.X_WC.translation)
        corners = frustum(camera, image_depth)
        color = Rgba(*rgb_from_hex(camera_color))
        outline = np.vstack([corners, corners[:1]]).T
        meshcat.SetLine(f"{path}/image", np.asfortranarray(outline), 2.0, color)
        meshcat.SetLine(f"{path}/up", np.asfortranarray(corners[:2].T), 6.0, color)
        ends = np.repeat(p_WC[:, None], 4, axis=1)
        rays = np.asfortranarray(ends), np.asfortranarray(corners.T)
        meshcat.SetLineSegments(f"{path}/rays", *rays, 2.0, color)
        label = label_mesh((name,), name_height, color=rgb_from_hex(camera_color))
        X_WT = make_pose(R_WT, p_WC + 0.3 * name_height * R_WT[:, 1])
        draw_label(meshcat, f"{path}/name", label, X_WT)
        half = 0.5 * label[1] * R_WT[:, 0]
        drawn += [corners, p_WC + np.array([-half, half, name_height * R_WT[:, 1]])]
    entry = LegendEntry("cameras, upper edge bold", camera_color, (CAMERAS_PATH,))
    return entry, np.vstack(drawn)


def draw_span(span: ArmSpan, meshcat: Meshcat) -> LegendEntry:
    """Draws the circle on the table top of the ball that bounds the grasp frame's positions."""
    span_path = "/drake/span"
    span_color = "#3b6ea5"
    circle = np.asfortranarray(span_circle(span).T)
    meshcat.SetLine(span_path, circle, 3.0, Rgba(*rgb_from_hex(span_color)))
    text = f"longest reach on the table, {_span_radius(span):.2f} m"
    return LegendEntry(text, span_color, (span_path,))


def span_circle(span: ArmSpan) -> Array:
    """(N, 3) points on the circle of `draw_span` [m]."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    p = _span_radius(span) * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    return p + np.array([span.p_WJ[0], span.p_WJ[1], MAP_TILE_LIFT])


def _span_radius(span: ArmSpan) -> float:
    return float(np.sqrt(max(0.0, span.radius**2 - span.p_WJ[2] ** 2)))


def draw_reachability(
    reachability: ReachabilityMap, station: Station, meshcat: Meshcat, condition: str
) -> list[LegendEntry | ColorBar]:
    """Draws a map as tiles: large tiles on the board for the lowest height, small tiles at the
    heights above.

    Args:
        reachability: the map.
        station: station of the board.
        meshcat: Meshcat to draw in.
        condition: condition of the map, for the legend.
    """
    tile_shares = (
        0.94,
        0.45,
    )  # Side of a tile over a cell's: on the board, and above it.
    tile_opacity = 0.85
    meshcat.Delete(MAP_PATH)
    X_WS = RigidTransform(station.document.X_WS.matrix())
    bins = np.minimum((reachability.share * REACHABILITY_BINS).astype(int), REACHABILITY_BINS - 1)
    colors = map_colors((np.arange(REACHABILITY_BINS) + 0.5) / REACHABILITY_BINS)
    for k, height in enumerate(reachability.heights):
        z = MAP_TILE_LIFT if k == 0 else height
        for b in range(REACHABILITY_BINS):
            rows, columns = np.nonzero(bins[k] == b)
            if not len(rows):
                continue
            middle = np.stack([reachability.x[columns], reachability.y[rows]], axis=1)
            size = tile_shares[min(k, 1)] * np.array(reachability.cell)
            vertices, faces = tile_triangles(middle, size, z)
            path = f"{MAP_PATH}/{b}/{k}"
            meshcat.SetTriangleMesh(path, vertices, faces, Rgba(*colors[b], tile_opacity))
            meshcat.SetTransform(path, X_WS)
    bar = ColorBar(
        title=f"share of {len(reachability.tilt)} hand orientations that the arm reaches,"
        f" {condition}",
        colors=tuple(hex_color(color) for color in colors),
        counts=tuple(np.bincount(bins.ravel(), minlength=REACHABILITY_BINS).tolist()),
        ticks=tuple((share, f"{share:g}") for share in (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)),
        paths=tuple(f"{MAP_PATH}/{b}" for b in range(REACHABILITY_BINS)),
    )
    return [bar, *_height_entries(reachability)]


def tile_triangles(middle: Array, size: Array, z: float) -> tuple[Array, NDArray[np.int32]]:
    """Equal rectangles at one height, visible from above.

    Args:
        middle: (N, 2) centres of the rectangles [m].
        size: (2,) extents [m].
        z: height [m].

    Returns:
        Vertices (3, 4 N) [m] and triangles (3, 2 N).
    """
    corner = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size
    p = np.full((len(middle), 4, 3), z)
    p[..., :2] = middle[:, None] + corner
    first = 4 * np.arange(len(middle), dtype=np.int32)
    faces = np.stack([[first, first + 1, first + 2], [first, first + 2, first + 3]], axis=-1)
    return np.asfortranarray(p.reshape(-1, 3).T), np.asfortranarray(faces.reshape(3, -1))


def look_through(camera: Camera, meshcat: Meshcat) -> None:
    """Moves Meshcat's eye to a camera, with its vertical field of view, but without its roll."""
    X_WC = camera.X_WC.matrix()
    ahead = transform_points(X_WC, [[0.0, 0.0, 1.0]])[0]
    vertical = 2.0 * np.arctan(0.5 * camera.height / camera.focal[1])
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", float(np.rad2deg(vertical)))
    meshcat.SetCameraPose(X_WC[:3, 3], ahead)


def _height_entries(reachability: ReachabilityMap) -> Sequence[LegendEntry]:
    """Legend switches for the heights."""
    key_color = "#9aa3ad"  # Not a colour of the map.
    entries = []
    for k, height in enumerate(reachability.heights):
        where = "tiles on the board" if k == 0 else "small tiles"
        share = 100.0 * reachability.covered[k]
        label = f"{where}: {100 * height:g} cm above it, {share:.0f} % reached"
        paths = tuple(f"{MAP_PATH}/{b}/{k}" for b in range(REACHABILITY_BINS))
        entries.append(LegendEntry(label, key_color, paths))
    return entries
