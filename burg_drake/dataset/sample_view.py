"""Shows a sample in Meshcat: its scene, its depth as points, the camera and the grasps."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat, Rgba
from pydrake.math import RigidTransform
from pydrake.perception import BaseField, Fields, PointCloud

from burg_drake.cameras import Intrinsics
from burg_drake.core import (
    Array,
    Bytes,
    Outcome,
    Single,
    rot_z,
    transform_points,
)
from burg_drake.dataset.point_clouds import depth_cloud
from burg_drake.dataset.sample import LabelledGrasps, Sample
from burg_drake.dataset.views import set_posture
from burg_drake.scene import Scene
from burg_drake.station import Station
from burg_drake.visualization import (
    GRASPS_PATH,
    LegendEntry,
    aim_at,
    draw_grasps,
    grasp_group_entries,
    group_by_outcome,
    hex_color,
    linear_light,
    picture_mesh,
    scene_points,
    show_scene,
)


class SamplePaths:
    """Meshcat paths of a sample."""

    cloud = "/drake/cloud"  # The exact depth.
    sensor = "/drake/sensor"  # The sensor's depth.
    camera = "/drake/camera"  # The camera and its image.


VIEW_CAMERA_COLOR = "#b3471d"  # Colour of the camera's pyramid, in hexadecimal sRGB.


def show_sample(
    sample: Sample, scene: Scene, station: Station, meshcat: Meshcat
) -> list[LegendEntry]:
    """Shows a sample in Meshcat: object models at their labelled poses, coloured point clouds of
    the exact and the sensor's depth, the camera with its image, and grasps by outcome. Distractors
    appear only in the point clouds. The image is drawn as that of a camera without lens distortion.

    Args:
        sample: sample with the images to show.
        scene: scene of the sample.
        station: station of the scene; its arm is shown in the view's posture.
        meshcat: Meshcat to show the sample in.

    Returns:
        Entries of a legend that switches the parts of the sample on and off.

    Raises:
        InvalidInputError: the view's posture is of another arm.
    """
    view = sample.view
    X_WC = sample.X_WS @ view.X_SC
    built = show_scene(scene, station, meshcat, robot="none" if view.posture is None else "arm")
    if view.posture is not None:
        context = built.diagram.CreateDefaultContext()
        set_posture(
            built.arm_joints, built.plant.GetMyMutableContextFromRoot(context), view.posture
        )
        built.diagram.ForcedPublish(context)
    legend = [LegendEntry("models", "#9aa3ad", ("/drake/visualizer", "/drake/labels"))]
    for path in (SamplePaths.cloud, SamplePaths.sensor, SamplePaths.camera, GRASPS_PATH):
        meshcat.Delete(path)  # from a sample shown before
    for depth, path in (
        (sample.images.depth, SamplePaths.cloud),
        (sample.sensor_depth, SamplePaths.sensor),
    ):
        if depth is not None:
            legend.append(_draw_depth(meshcat, path, depth, sample, X_WC))
    corners = picture_corners(view.intrinsics, depth=0.15)
    _draw_camera(meshcat, corners, sample.images.color, X_WC)
    legend.append(LegendEntry("camera with its image", VIEW_CAMERA_COLOR, (SamplePaths.camera,)))
    if sample.grasps is not None:
        legend += _draw_grasps(meshcat, sample.grasps, X_WC)
    seen = [scene_points(scene, station), transform_points(X_WC, corners), X_WC[None, :3, 3]]
    aim_at(meshcat, np.vstack(seen), _viewing_direction(X_WC))
    return legend


def picture_corners(intrinsics: Intrinsics, depth: float) -> Array:
    """(4, 3) corners of a pinhole camera's image at a depth [m], in the optical frame, in order
    around the image from its upper left."""
    right, bottom = intrinsics.width - 0.5, intrinsics.height - 0.5
    corners = np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    rays = (corners - intrinsics.center) / intrinsics.focal
    return depth * np.column_stack([rays, np.ones(4)])


def _draw_depth(
    meshcat: Meshcat, path: str, depth: Single, sample: Sample, X_WC: Array
) -> LegendEntry:
    """Draws a depth image as points in the colours of the image. Points of the sensor are tinted,
    and hidden at first."""
    max_points = 80_000  # Per cloud (3 MB of a page); larger images are thinned out.
    # Point size by spacing of far points; three.js draws them 2.4 times too small.
    size_factor = 3.5
    point_count = np.count_nonzero(depth)
    step = max(1, int(np.ceil(np.sqrt(point_count / max_points))))
    shown = np.zeros_like(depth)
    shown[::step, ::step] = depth[::step, ::step]
    intrinsics = sample.view.intrinsics
    cloud = depth_cloud(shown, intrinsics, color=sample.images.color)
    exact = path == SamplePaths.cloud
    # name and colour of the cloud, and the share of this colour in its points
    name, rgb, tint = "depth of the sensor", (0.84, 0.14, 0.62), 0.4
    if exact:
        name, rgb, tint = "depth", (0.19, 0.41, 0.56), 0.0
    colors = np.tile(rgb, (len(cloud), 1))
    if cloud.color is not None:
        colors = (1.0 - tint) * cloud.color / 255.0 + tint * colors
    if len(cloud):
        far = float(np.quantile(cloud.points[:, 2], 0.9))
        side = size_factor * step * far / intrinsics.focal[0]
        _draw_points(meshcat, path, cloud.points, colors, side)
        meshcat.SetTransform(path, RigidTransform(X_WC))
        meshcat.SetProperty(path, "visible", exact)
    return LegendEntry(f"{name} ({point_count:,} points)", hex_color(rgb), (path,), shown=exact)


def _draw_points(meshcat: Meshcat, path: str, points: Single, colors: Array, side: float) -> None:
    """Draws points (N, 3) with colours (N, 3), sRGB in [0, 1], as squares of side `side` [m].
    Moves them slightly towards the camera, so that they show on a model's surface.
    """
    lift = 2e-3  # Metres towards the camera, so that points show on a model's surface.
    cloud = PointCloud(len(points), Fields(int(BaseField.kXYZs) | int(BaseField.kRGBs)))
    nearer = 1.0 - lift / np.linalg.norm(points, axis=1, keepdims=True)
    cloud.mutable_xyzs()[:] = (nearer * points).T
    cloud.mutable_rgbs()[:] = np.rint(255.0 * linear_light(colors)).T
    meshcat.SetObject(path, cloud, side)
    meshcat.SetProperty(f"{path}/<object>", "material.toneMapped", False)


def _draw_camera(meshcat: Meshcat, corners: Array, color: Bytes | None, X_WC: Array) -> None:
    """Draws a camera as the pyramid over its image, with the colours on it."""
    rgba = Rgba(*(int(VIEW_CAMERA_COLOR[k : k + 2], 16) / 255.0 for k in (1, 3, 5)))
    outline = np.asfortranarray(np.vstack([corners, corners[:1]]).T)
    meshcat.SetLine(f"{SamplePaths.camera}/image", outline, 2.0, rgba)
    rays = np.zeros((3, 4), order="F"), np.asfortranarray(corners.T)
    meshcat.SetLineSegments(f"{SamplePaths.camera}/rays", *rays, 2.0, rgba)
    if color is not None:
        meshcat.SetObject(f"{SamplePaths.camera}/picture", picture_mesh(color, corners))
    meshcat.SetTransform(SamplePaths.camera, RigidTransform(X_WC))


def _draw_grasps(meshcat: Meshcat, grasps: LabelledGrasps, X_WC: Array) -> list[LegendEntry]:
    """Draws grasps by outcome. Grasps of unknown width get the largest known width."""
    groups = group_by_outcome([Outcome(text) if text else None for text in grasps.outcome.tolist()])
    known = np.isfinite(grasps.width)
    widest = float(grasps.width[known].max()) if known.any() else 0.08
    draw_grasps(meshcat, X_WC @ grasps.X_CG, np.where(known, grasps.width, widest), groups)
    return grasp_group_entries(groups)


def _viewing_direction(X_WC: Array) -> Array:
    """Viewing direction (3,) from the camera's side; from below its image if it looks down."""
    ahead = X_WC[:3, 2] * (1.0, 1.0, 0.0)
    if np.linalg.norm(ahead) < 1e-3:
        ahead = -X_WC[:3, 1] * (1.0, 1.0, 0.0)
    level = rot_z(np.deg2rad(50.0)) @ (ahead / np.linalg.norm(ahead))
    return np.asarray(level - np.array([0.0, 0.0, 0.45]))
