"""Pictures of objects: the best view, parallel projection, shaded outlines, shadows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, rot_z, wrap_to_pi
from burg_drake.objects import UPRIGHT_TOLERANCE, ObjectEntry, ObjectLibrary


def upright_rotation(entry: ObjectEntry) -> Array:
    """(3, 3) `R_WO` of a standing object: its own frame if it is stable, else its first pose."""
    if not entry.stable_poses:
        return np.eye(3)
    R_SO = entry.X_SO(entry.proposed_pose)[:3, :3]
    return np.eye(3) if R_SO[2, 2] >= np.cos(UPRIGHT_TOLERANCE) else R_SO


def best_yaw(points: Array, R_WC: Array) -> float:
    """Rotation of points (N, 3) about z with the largest silhouette for a camera [rad].

    Args:
        points: points in the world, such as the corners of a convex hull.
        R_WC: (3, 3) axes of the camera.
    """
    yaws = np.deg2rad(np.arange(0.0, 360.0, 15.0))  # Radians.
    yaw_cost = 0.03  # Share of the silhouette that a half turn must gain.
    scores = []
    for yaw in yaws:
        seen = (points @ rot_z(yaw).T) @ R_WC[:, :2]
        area = cv2.contourArea(cv2.convexHull(seen.astype(np.float32)))
        turn = abs(wrap_to_pi(yaw)) / np.pi
        scores.append(area * (1.0 - yaw_cost * turn))
    return float(yaws[int(np.argmax(scores))])


def camera_rotation(elevation: float) -> Array:
    """(3, 3) `R_WC` of a camera in front that looks down by `elevation` [rad]."""
    c, s = np.cos(elevation), np.sin(elevation)
    return np.array([[1.0, 0.0, 0.0], [0.0, -s, c], [0.0, -c, -s]])


def fit_camera(points: Array, R_WC: Array, half_view: Array) -> Array:
    """Nearest position (3,) of a camera with points in view, in the middle of the picture.

    Args:
        points: (N, 3) in the world [m].
        R_WC: (3, 3) camera.
        half_view: (2,) tangents of half the angle of view that the points may fill, horizontal
            and vertical.

    Returns:
        `p_WC` [m].
    """
    x, y, z = (np.asarray(points) @ R_WC).T
    distance = -np.inf
    for u, t in ((x, half_view[0]), (y, half_view[1])):
        right, left = (u - t * z).max(), (-u - t * z).max()
        distance = max(distance, (right + left) / (2.0 * t))
    center = np.empty(2)
    for k, u in enumerate((x, y)):
        # where the outermost rays to either side have opposite slopes
        low, high = u.min(), u.max()
        for _ in range(40):
            center[k] = (low + high) / 2.0
            slope = (u - center[k]) / (z + distance)
            low, high = (center[k], high) if slope.max() > -slope.min() else (low, center[k])
    return R_WC @ np.array([*center, -distance])


def box_corners(lower: ArrayLike, upper: ArrayLike) -> Array:
    """(8, 3) corners of the box between two points (3,)."""
    sides = np.stack([np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)], axis=1)
    return np.stack(np.meshgrid(*sides), axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class FlatView:
    """A camera without perspective, whose picture is measured in SVG units.

    Attributes:
        R_WC: (3, 3) the camera's axes: x to the right, y down, z into the picture.
        scale: SVG units a metre.
        corner: (2,) position of the picture's upper left corner along the camera's x and y [m].
        size: width and height [SVG units].
    """

    R_WC: Array
    scale: float
    corner: Array
    size: tuple[float, float]

    def project(self, p_WQ: Array) -> Array:
        """Projects points (..., 3) in the world [m] into the picture (..., 2) [SVG units]."""
        return (np.asarray(p_WQ) @ self.R_WC[:, :2] - self.corner) * self.scale

    def depths(self, p_WQ: Array) -> Array:
        """Depth (...) of points (..., 3) in the world [m] behind the picture [m]."""
        return np.asarray(p_WQ) @ self.R_WC[:, 2]


def fit_view(
    p_WQ: Array, R_WC: Array, width: float, height: float | None = None, margin: float = 6.0
) -> FlatView:
    """The largest view that shows all points in its middle.

    Args:
        p_WQ: (N, 3) points in the world [m]; at least one.
        R_WC: (3, 3) the camera's axes.
        width, height: of the picture [SVG units]; the height follows from the points if None.
        margin: free margin on every side [SVG units].
    """
    seen = np.asarray(p_WQ) @ R_WC[:, :2]
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = np.maximum(high - low, 1e-6)
    scale = (width - 2 * margin) / extent[0]
    if height is None:
        height = float(np.ceil(scale * extent[1] + 2 * margin))
    else:
        scale = min(scale, (height - 2 * margin) / extent[1])
    corner = (low + high) / 2.0 - np.array([width, height]) / (2.0 * scale)
    return FlatView(R_WC, float(scale), corner, (width, height))


def path_data(points: Array, *, closed: bool = True, decimals: int = 1) -> str:
    """A polygon or line through points (N, 2) as the `d` of an SVG path."""
    corners = "L".join(
        f"{_decimal_text(x, decimals)} {_decimal_text(y, decimals)}" for x, y in points
    )
    return f"M{corners}{'Z' if closed else ''}"


def _decimal_text(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text == "-0" else text


TONE_COUNT = 6
"""Number of even tones in a shaded drawing."""
PIXELS_PER_UNIT = 3
"""Pixels per SVG unit of the raster in which contours are traced."""


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """A triangle mesh in the world.

    Attributes:
        vertices: (N, 3) [m].
        faces: (M, 3) indices of vertices.
    """

    vertices: Array
    faces: NDArray[np.int64]


def shaded_outline(solids: Sequence[SolidMesh], view: FlatView) -> list[str]:
    """Draws solids, the nearer ones before the others.

    Returns:
        The `d` of a path for each tone, darkest first, to be drawn one over the other with the fill
        rule `evenodd`; the first is the outline of everything. Empty where there is no such tone.
    """
    levels = _tone_raster(solids, view)
    return [_trace_contours(_smooth_mask(levels > tone)) for tone in range(TONE_COUNT)]


def object_surface(library: ObjectLibrary, name: str) -> SolidMesh:
    """The surface of an object in its own frame; cached per process until its files change.

    Raises:
        UnknownNameError: no such object, or its mesh file is missing.
        MeshError: the mesh file is damaged.
    """
    max_surfaces = 64  # Number of cached surfaces.
    key = str(library.root.resolve()), name, library.content[name]
    if key not in _SURFACE_CACHE:
        while len(_SURFACE_CACHE) >= max_surfaces:
            del _SURFACE_CACHE[next(iter(_SURFACE_CACHE))]
        mesh = library.surface(name)
        faces = np.asarray(mesh.faces, dtype=np.int64)
        _SURFACE_CACHE[key] = SolidMesh(np.asarray(mesh.vertices), faces)
    return _SURFACE_CACHE[key]


_SURFACE_CACHE: dict[tuple[str, str, str], SolidMesh] = {}


def footprint(solid: SolidMesh, view: FlatView) -> str:
    """SVG path data `d` of a solid's vertical projection onto the plane that it stands on."""
    hull = cv2.convexHull(view.project(project_to_ground(solid)).astype(np.float32))
    return path_data(hull[:, 0, :])


def project_to_ground(solid: SolidMesh) -> Array:
    """(N, 3) vertices of a solid, projected vertically onto the plane that it stands on [m]."""
    ground = solid.vertices.copy()
    ground[:, 2] = solid.vertices[:, 2].min()
    return ground


def _tone_raster(solids: Sequence[SolidMesh], view: FlatView) -> NDArray[np.uint8]:
    """(H, W) tones of the pixels, from 1 for the darkest; 0 for the background."""
    subpixel_bits = 4  # Fractional bits of OpenCV's coordinates.
    width, height = (int(np.ceil(side * PIXELS_PER_UNIT)) for side in view.size)
    image = np.zeros((height, width), dtype=np.uint8)
    corners = [s.vertices[s.faces] for s in solids if len(s.faces)]
    if not corners:
        return image
    triangles = np.concatenate(corners)
    depth = view.depths(triangles).mean(axis=1)
    tones = _triangle_tones(triangles, view)
    pixels = np.round(view.project(triangles) * PIXELS_PER_UNIT * 2**subpixel_bits).astype(np.int32)
    for k in np.argsort(-depth, kind="stable").tolist():
        cv2.fillConvexPoly(image, pixels[k], int(tones[k]) + 1, shift=subpixel_bits)
    return image


def _smooth_mask(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Majority filter of a mask; counting neighbours is faster than `medianBlur`."""
    filter_width = 9  # Pixels, odd.
    size = filter_width, filter_width
    count = cv2.boxFilter(
        mask.astype(np.uint8), -1, size, normalize=False, borderType=cv2.BORDER_REPLICATE
    )
    return np.asarray(count > filter_width**2 // 2)


def _triangle_tones(triangles: Array, view: FlatView) -> NDArray[np.int64]:
    """Tone (M,) of triangles (M, 3, 3); whichever side faces the camera is lit."""
    # Towards the light, in the camera frame: above, left, in front.
    light_direction = np.array([-0.45, -0.75, -0.48])
    edges = triangles[:, 1:] - triangles[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1]) @ view.R_WC
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    normals *= -np.sign(normals[:, 2:] + 1e-12)
    light = normals @ (light_direction / np.linalg.norm(light_direction))
    share = np.clip(0.5 + 0.5 * light, 0.0, 1.0)
    return np.minimum((share * TONE_COUNT).astype(np.int64), TONE_COUNT - 1)


def _trace_contours(mask: NDArray[np.bool_]) -> str:
    tolerance = 0.9  # Pixels.
    min_area = 24.0  # Pixels.
    found, _ = cv2.findContours(
        mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE, offset=(0, 0)
    )
    paths = []
    for contour in found:
        if cv2.contourArea(contour) >= min_area:
            corners = cv2.approxPolyDP(contour, tolerance, True)[:, 0, :]
            paths.append(path_data((corners + 0.5) / PIXELS_PER_UNIT))
    return "".join(paths)


def painted_shadow(
    hulls: Sequence[Array], X_WC: Array, focal: float, size: NDArray[np.int64]
) -> Array:
    """Painted shadow of convex pieces on the ground z = 0, as a factor (H, W) in [0, 1].

    Args:
        hulls: (N, 3) corners of each in the world [m].
        X_WC: (4, 4) camera.
        focal: focal length [pixel].
        size: (2,) width and height [pixel].
    """
    # Direction of the light that casts the painted shadow.
    sun_direction = np.array([0.30, 0.25, -1.0])
    shadow_strength = 0.22
    contact_strength = 0.30
    shadow_blur = 0.022  # Share of the picture's height.
    contact_blur = 0.010  # Share of the picture's height.
    fade_width = 0.10  # Share of the picture's height.
    light = np.ones((size[1], size[0]), dtype=np.float32)
    for direction, strength, blur in (
        (sun_direction, shadow_strength, shadow_blur),
        (np.array([0.0, 0.0, -1.0]), contact_strength, contact_blur),
    ):
        dark = np.zeros_like(light)
        for hull in hulls:
            ground = hull + direction * hull[:, 2:]
            x, y, z = ((ground - X_WC[:3, 3]) @ X_WC[:3, :3]).T
            corners = np.stack([x, y], axis=1) / z[:, None] * focal + size / 2.0
            cv2.fillConvexPoly(dark, cv2.convexHull(np.round(corners).astype(np.int32)), strength)
        light *= 1.0 - cv2.GaussianBlur(dark, (0, 0), blur * float(size[1]))
    edge = fade_width * float(size[1])
    columns, rows = (np.minimum(np.arange(n) + 0.5, n - np.arange(n) - 0.5) for n in size)
    fade = np.clip(np.minimum(columns[None, :], rows[:, None]) / edge, 0.0, 1.0)
    return 1.0 - (1.0 - light) * fade
