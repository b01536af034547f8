"""Point clouds from depth images, and points on the true surfaces of objects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, Bytes, InvalidInputError, Single, transform_points
from burg_drake.dataset.camera_rays import camera_rays
from burg_drake.dataset.sample import instance_numbers
from burg_drake.scene import SceneLike, as_scene


@dataclass(frozen=True, eq=False)
class DepthCloud:
    """Point cloud of a depth image, row by row.

    Attributes:
        points: (N, 3) points in the camera's optical frame [m].
        color: (N, 3) red, green, blue; None without a colour image.
        labels: (N,) numbers of the instances; None without a label image.
    """

    points: Single
    color: Bytes | None = None
    labels: NDArray[np.uint16] | None = None

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class SurfaceCloud:
    """Points on the surfaces of a scene's objects, visible or not, instance by instance.

    Attributes:
        points: (N, 3) points in the scene frame [m].
        normals: (N, 3) outward unit normals of the faces.
        number: (N,) instance numbers, as in label images.
    """

    points: Array
    normals: Array
    number: NDArray[np.uint16]

    def __len__(self) -> int:
        return len(self.points)


def depth_cloud(
    depth: ArrayLike,
    intrinsics: Intrinsics,
    *,
    color: Bytes | None = None,
    labels: NDArray[np.uint16] | None = None,
) -> DepthCloud:
    """Back-projects a depth image to points.

    Args:
        depth: (H, W) distance along the optical axis [m]; pixels that are not finite or not
            positive are skipped.
        intrinsics: intrinsics of the camera; lens distortion is corrected.
        color: (H, W, 3) colours of the same pixels.
        labels: (H, W) labels of the same pixels.

    Raises:
        InvalidInputError: an image has another size than the intrinsics, or the depth has integers.
    """
    metres = checked_depth(depth, intrinsics, "the depth image")
    for name, image in (("color", color), ("labels", labels)):
        if image is not None:
            require_image(image, intrinsics, f"the {name} image")
    measured = np.flatnonzero((metres > 0.0) & (metres < np.inf))
    points = (
        camera_rays(intrinsics).single.reshape(-1, 3)[measured] * metres.reshape(-1, 1)[measured]
    )
    return DepthCloud(
        points,
        None if color is None else np.asarray(color).reshape(-1, 3)[measured],
        None if labels is None else np.asarray(labels).reshape(-1)[measured],
    )


def surface_cloud(
    scene: SceneLike,
    rng: np.random.Generator,
    *,
    per_object: int | None = None,
    density: float | None = None,
) -> SurfaceCloud:
    """Draws points on the surfaces of all instances, background included.

    Args:
        scene: scene with the placed instances.
        rng: random numbers.
        per_object: number of points on each instance.
        density: points per square metre, instead of `per_object`; rounded for each instance.

    Raises:
        InvalidInputError: not exactly one of the two is given, or it is not positive.
        UnknownNameError: a mesh file is missing.
        MeshError: a mesh file is damaged.
    """
    from burg_drake.geometry import Surface

    if (per_object is None) == (density is None):
        raise InvalidInputError("give either per_object or density for a surface cloud")
    for name, value in (("per_object", per_object), ("density", density)):
        if value is not None and not 0 < value < np.inf:
            raise InvalidInputError(f"{name} of a surface cloud is {value:g}; give more than 0")
    scene = as_scene(scene)
    points, normals, numbers = [np.empty((0, 3))], [np.empty((0, 3))], []
    for name, number in instance_numbers(scene).items():
        mesh = scene.library.surface(scene.instance(name).object)
        surface, X_SO = Surface.of(mesh), scene.X_SO(name)
        count = per_object or round((density or 0.0) * float(mesh.area))
        p_OQ, face = surface.draw(count, rng)
        points.append(transform_points(X_SO, p_OQ))
        normals.append(surface.normals[face] @ X_SO[:3, :3].T)
        numbers.append(np.full(count, number))
    number_of = np.concatenate([np.empty(0, int), *numbers]).astype(np.uint16)
    return SurfaceCloud(np.concatenate(points), np.concatenate(normals), number_of)


def checked_depth(
    depth: ArrayLike, intrinsics: Intrinsics, name: str = "the depth image"
) -> Single:
    """Checks a depth image (H, W) and converts it to single precision.

    Raises:
        InvalidInputError: the image has another size than the intrinsics, or integers, which are
            millimetres by convention.
    """
    values = np.asarray(depth)
    if values.dtype.kind != "f":
        raise InvalidInputError(f"{name} has type {values.dtype}; expected floats in metres")
    if values.ndim != 2:
        raise InvalidInputError(f"{name} has shape {values.shape}; expected (H, W)")
    require_image(values, intrinsics, name)
    return values.astype(np.float32, copy=False)


def require_image(image: ArrayLike, intrinsics: Intrinsics, name: str) -> None:
    """Refuses an image (H, W, ...) of another size.

    Raises:
        InvalidInputError: it is of another size, or no image.
    """
    shape = np.shape(image)
    if len(shape) < 2:
        raise InvalidInputError(f"{name} has shape {shape}; expected (H, W, ...)")
    intrinsics.require_size(shape[1], shape[0], name)
