"""Drawing in Meshcat: the camera's aim, flat triangles, and frames as three arrows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba, Sphere
from pydrake.math import RigidTransform

from burg_drake.core import Array, make_pose
from burg_drake.visualization import colors
from burg_drake.visualization.colors import linear_light
from burg_drake.visualization.object_drawing import fit_camera

VIEW_ASPECT = 1.2
"""Width over height of the narrowest supported view: a window of 1280 x 800 less a panel."""


def aim_at(
    meshcat: Meshcat,
    p_WQ: ArrayLike,
    forward: ArrayLike,
    *,
    field_of_view_deg: float = 45.0,
) -> Array:
    """Aims the camera from the nearest place with all points in view; it orbits their middle.

    Args:
        meshcat: Meshcat whose camera is set.
        p_WQ: (N, 3) points [m].
        forward: (3,) viewing direction in the world; not vertical.
        field_of_view_deg: vertical angle of view.

    Returns:
        (3, 3) `R_WC` of the camera: x to the right, y down, z forward.
    """
    filled_share = 0.94  # Share of the view that the points fill.
    points = np.asarray(p_WQ, dtype=float).reshape(-1, 3)
    R_WC = camera_rotation_along(forward)
    vertical = np.tan(np.deg2rad(field_of_view_deg) / 2.0)
    p_WC = fit_camera(points, R_WC, filled_share * vertical * np.array([VIEW_ASPECT, 1.0]))
    along = (points - p_WC) @ R_WC[:, 2]
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", field_of_view_deg)
    meshcat.SetCameraPose(p_WC, p_WC + R_WC[:, 2] * (along.min() + along.max()) / 2.0)
    return R_WC


def camera_rotation_along(forward: ArrayLike) -> Array:
    """(3, 3) `R_WC` of an upright camera that looks in a direction (3,), which is not vertical."""
    z = np.asarray(forward, dtype=float)
    z = z / np.linalg.norm(z)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def draw_flat_triangles(
    meshcat: Meshcat, path: str, vertices: Array, faces: NDArray[np.int32], rgba: colors.Rgba
) -> None:
    """Draws triangles in one colour, without shading and shadow.

    The material is black and emissive, and three.js' tone mapping, which would brighten it, is
    off: the pixels have exactly the given colour.

    Args:
        meshcat: Meshcat to draw in.
        path: path in its tree.
        vertices: (3, V) [m].
        faces: (3, F) triangles, seen from both sides.
        rgba: colour (sRGB) and opacity.
    """
    meshcat.SetTriangleMesh(path, vertices, faces, Rgba(0.0, 0.0, 0.0, rgba[3]))
    object_path = f"{path}/<object>"
    for channel, value in zip("rgb", linear_light(rgba[:3]).tolist(), strict=True):
        meshcat.SetProperty(object_path, f"material.emissive.{channel}", value)
        meshcat.SetProperty(object_path, f"material.specular.{channel}", 0.0)
    meshcat.SetProperty(object_path, "material.toneMapped", False)
    meshcat.SetProperty(object_path, "castShadow", False)


AXIS_COLORS = (Rgba(0.84, 0.15, 0.12), Rgba(0.13, 0.60, 0.20), Rgba(0.12, 0.32, 0.80))
"""Colours of the x, y and z axes."""
R_FA = (
    np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    np.eye(3),
)
"""Rotations (3, 3) of frames A whose z axis is x, y and z of F."""


@dataclass(frozen=True)
class TriadStyle:
    """How a frame is drawn.

    Attributes:
        length: length of an axis, with its head [m].
        radius: radius of an axis [m].
        head: length of its arrow head [m].
    """

    length: float
    radius: float
    head: float


def draw_triad(meshcat: Meshcat, path: str, X_WF: Array, style: TriadStyle) -> None:
    """Draws a frame.

    Args:
        meshcat: Meshcat to draw in.
        path: path that gets the frame's pose; below it are `origin`, and `x`, `y`, `z`, each with
            `shaft` and `head`, whose own frame is at the tip.
        X_WF: (4, 4) the frame.
        style: sizes.
    """
    origin_color = Rgba(0.2, 0.2, 0.2)
    head_scale = 2.4  # Radius relative to that of an axis.
    origin_scale = 1.6  # Radius relative to that of an axis.
    shaft = style.length - style.head
    radius = head_scale * style.radius
    X_AH = make_pose(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, style.length))
    meshcat.SetTransform(path, RigidTransform(X_WF))
    for name, R, color in zip("xyz", R_FA, AXIS_COLORS, strict=True):
        axis = f"{path}/{name}"
        meshcat.SetTransform(axis, RigidTransform(make_pose(R)))
        meshcat.SetObject(f"{axis}/shaft", Cylinder(style.radius, shaft), color)
        meshcat.SetTransform(f"{axis}/shaft", RigidTransform([0.0, 0.0, shaft / 2.0]))
        meshcat.SetObject(f"{axis}/head", MeshcatCone(style.head, radius, radius), color)
        meshcat.SetTransform(f"{axis}/head", RigidTransform(X_AH))
    meshcat.SetObject(f"{path}/origin", Sphere(origin_scale * style.radius), origin_color)
