"""A sample in 3D: its scene, what its camera saw of it as points, the camera, and the grasps."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.perception import BaseField, Fields, PointCloud

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, Bytes, InvalidInputError, Single, rot_z, transform_points
from burg_drake.core.grasps import Outcome
from burg_drake.dataset.labels import LabelledGrasps, depth_cloud
from burg_drake.dataset.samples import Sample
from burg_drake.scene.document import Scene
from burg_drake.station.diagram import StationDiagram
from burg_drake.station.document import Station
from burg_drake.visualization.grasps import (
    GRASPS_PATH,
    by_outcome,
    draw_grasps,
    group_entries,
)
from burg_drake.visualization.meshcat import aim_at, picture_mesh
from burg_drake.visualization.scenes import scene_points, show_scene
from burg_drake.visualization.style import LegendEntry, hex_color, linear_light

MODELS_PATH, NAMES_PATH = "/drake/visualizer", "/drake/labels"
CLOUD_PATH, SENSOR_PATH, CAMERA_PATH = "/drake/cloud", "/drake/sensor", "/drake/camera"
MOST_POINTS = 80_000
"""Of a cloud, 3 MB of a page: a larger image is shown by every second pixel of its rows and
columns, or fewer."""
SPREAD = 3.5
"""Side of a point, as a share of the distance between far neighbours: three.js draws points 2.4
times too small for the eye's angle of view, and on slanted surfaces they are farther apart."""
NEAR_POINT_SHARE = 0.9
"""Share of points that are nearer than far ones."""
LIFT = 2e-3
"""By which points are drawn nearer to the camera [m]."""
PICTURE_DEPTH = 0.15
"""At which the camera's image is drawn [m]."""
CAMERA_COLOR, MODELS_COLOR = "#b3471d", "#9aa3ad"
_EXACT = "depth", (0.19, 0.41, 0.56), 0.0
_SENSOR = "depth of the sensor", (0.84, 0.14, 0.62), 0.4
"""Names of clouds, their colours, and the share of these in the picture's."""
ASIDE_DEG, DOWN = 50.0, 0.45
"""Where the eye looks from: turned about the vertical against the camera, and downward by such a
slope."""


def show_sample(
    sample: Sample, scene: Scene, station: Station, meshcat: Meshcat
) -> list[LegendEntry]:
    """Shows a sample in Meshcat: models where the labels say they are, the points that the depth
    image has, in the colours of the image, those of the sensor, the camera with its picture, and
    the grasps by outcome. Distractors are among the points alone. The picture is drawn as that of a
    camera without lens distortion.

    Args:
        sample: with those of its images that are to be seen.
        scene: of the sample.
        station: that it stands on; its arm is shown where the view has it.
        meshcat: where to show it.

    Returns:
        A legend that switches what is shown.

    Raises:
        InvalidInputError: the view's posture is of another arm.
    """
    view = sample.view
    X_WC = sample.X_WS @ view.X_SC
    built = show_scene(scene, station, meshcat, robot="none" if view.posture is None else "arm")
    if view.posture is not None:
        _publish(built, view.posture)
    legend = [LegendEntry("models", MODELS_COLOR, (MODELS_PATH, NAMES_PATH))]
    for path in (CLOUD_PATH, SENSOR_PATH, CAMERA_PATH, GRASPS_PATH):
        meshcat.Delete(path)  # of a sample that was shown before
    for depth, path in ((sample.images.depth, CLOUD_PATH), (sample.sensor_depth, SENSOR_PATH)):
        if depth is not None:
            legend.append(_draw_depth(meshcat, path, depth, sample, X_WC))
    corners = picture_corners(view.intrinsics, PICTURE_DEPTH)
    _draw_camera(meshcat, corners, sample.images.color, X_WC)
    legend.append(LegendEntry("camera with its image", CAMERA_COLOR, (CAMERA_PATH,)))
    if sample.grasps is not None:
        legend += _draw_grasps(meshcat, sample.grasps, X_WC)
    seen = [scene_points(scene, station), transform_points(X_WC, corners), X_WC[None, :3, 3]]
    aim_at(meshcat, np.vstack(seen), _forward(X_WC))
    return legend


def picture_corners(intrinsics: Intrinsics, depth: float) -> Array:
    """(4, 3) corners of a pinhole camera's image at a depth [m], in the optical frame: around it
    from its upper left."""
    right, bottom = intrinsics.width - 0.5, intrinsics.height - 0.5
    corners = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    rays = (corners - intrinsics.center) / intrinsics.focal
    return depth * np.column_stack([rays, np.ones(4)])


def _publish(built: StationDiagram, posture: tuple[float, ...]) -> None:
    """Shows the arm in a posture."""
    if len(posture) != len(built.arm_joints):
        raise InvalidInputError(
            f"the view has joint positions of {len(posture)} joints; the arm of the station has"
            f" {len(built.arm_joints)}"
        )
    context = built.diagram.CreateDefaultContext()
    plant_context = built.plant.GetMyMutableContextFromRoot(context)
    for joint, position in zip(built.arm_joints, posture, strict=True):
        joint.set_angle(plant_context, position)
    built.diagram.ForcedPublish(context)


def _draw_depth(
    meshcat: Meshcat, path: str, depth: Single, sample: Sample, X_WC: Array
) -> LegendEntry:
    """Points of a depth image, in the colours of the picture; the sensor's, which are hidden at
    first, are tinted."""
    there = np.count_nonzero(depth)
    step = max(1, int(np.ceil(np.sqrt(there / MOST_POINTS))))
    shown = np.zeros_like(depth)
    shown[::step, ::step] = depth[::step, ::step]
    intrinsics = sample.view.intrinsics
    cloud = depth_cloud(shown, intrinsics, color=sample.images.color)
    exact = path == CLOUD_PATH
    name, rgb, tint = _EXACT if exact else _SENSOR
    colors = np.tile(rgb, (len(cloud), 1))
    if cloud.color is not None:
        colors = (1.0 - tint) * cloud.color / 255.0 + tint * colors
    if len(cloud):
        side = (
            SPREAD
            * step
            * float(np.quantile(cloud.points[:, 2], NEAR_POINT_SHARE))
            / intrinsics.focal[0]
        )
        _draw_points(meshcat, path, cloud.points, colors, side)
        meshcat.SetTransform(path, RigidTransform(X_WC))
        meshcat.SetProperty(path, "visible", exact)
    return LegendEntry(f"{name} ({there:,} points)", hex_color(rgb), (path,), shown=exact)


def _draw_points(meshcat: Meshcat, path: str, points: Single, colors: Array, side: float) -> None:
    """Draws points (N, 3) with colours (N, 3), sRGB in [0, 1], as squares of a side [m]. They are
    nearer to the camera than they should be by as much as lets them be seen on a model's surface.
    """
    cloud = PointCloud(len(points), Fields(int(BaseField.kXYZs) | int(BaseField.kRGBs)))
    nearer = 1.0 - LIFT / np.linalg.norm(points, axis=1, keepdims=True)
    cloud.mutable_xyzs()[:] = (nearer * points).T
    cloud.mutable_rgbs()[:] = np.rint(255.0 * linear_light(colors)).T
    meshcat.SetObject(path, cloud, side)
    meshcat.SetProperty(f"{path}/<object>", "material.toneMapped", False)


def _draw_camera(meshcat: Meshcat, corners: Array, color: Bytes | None, X_WC: Array) -> None:
    """The pyramid over the image, with the picture on it."""
    rgba = Rgba(*(int(CAMERA_COLOR[k : k + 2], 16) / 255.0 for k in (1, 3, 5)))
    outline = np.asfortranarray(np.vstack([corners, corners[:1]]).T)
    meshcat.SetLine(f"{CAMERA_PATH}/image", outline, 2.0, rgba)
    rays = np.zeros((3, 4), order="F"), np.asfortranarray(corners.T)
    meshcat.SetLineSegments(f"{CAMERA_PATH}/rays", *rays, 2.0, rgba)
    if color is not None:
        meshcat.SetObject(f"{CAMERA_PATH}/picture", picture_mesh(color, corners))
    meshcat.SetTransform(CAMERA_PATH, RigidTransform(X_WC))


def _draw_grasps(meshcat: Meshcat, grasps: LabelledGrasps, X_WC: Array) -> list[LegendEntry]:
    """Grasps by outcome; of those whose width is not known, as wide as the widest."""
    groups = by_outcome([Outcome(text) if text else None for text in grasps.outcome.tolist()])
    known = np.isfinite(grasps.width)
    widest = float(grasps.width[known].max()) if known.any() else 0.08
    draw_grasps(meshcat, X_WC @ grasps.X_CG, np.where(known, grasps.width, widest), groups)
    return group_entries(groups)


def _forward(X_WC: Array) -> Array:
    """(3,) where the eye looks: from the camera's side, which is somewhere if it looks down."""
    ahead = X_WC[:3, 2] * (1.0, 1.0, 0.0)
    if np.linalg.norm(ahead) < 1e-3:
        ahead = -X_WC[:3, 1] * (1.0, 1.0, 0.0)
    level = rot_z(np.deg2rad(ASIDE_DEG)) @ (ahead / np.linalg.norm(ahead))
    forward: Array = level - np.array([0.0, 0.0, DOWN])
    return forward
