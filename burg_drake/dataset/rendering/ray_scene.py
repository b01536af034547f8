"""What rays through the pixels' centres meet: exact depth, labels, normals and silhouettes.

They are the same whatever renderer makes the colours, and where there is none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import NEAR, FieldOfView, Intrinsics
from burg_drake.core import Array, Indices, Single, inverse, transform_points
from burg_drake.dataset.rendering.images import SURROUNDINGS, Images
from burg_drake.dataset.views import View
from burg_drake.geometry import RayCaster

NONE = -1
"""Face of a ray that meets nothing."""


@dataclass(frozen=True, eq=False)
class Silhouette:
    """All that a camera would see of an object if it were alone.

    Attributes:
        left, top: column and row of the image where `mask` begins; they may lie outside [pixels].
        mask: (h, w) the smallest rectangle that holds it; empty if there is none.
    """

    left: int
    top: int
    mask: NDArray[np.bool_]

    def within(self, width: int, height: int) -> NDArray[np.bool_]:
        """(height, width) the part that lies in an image of that size."""
        image = np.zeros((height, width), bool)
        rows, columns = self.mask.shape
        x, y = max(self.left, 0), max(self.top, 0)
        right, bottom = min(self.left + columns, width), min(self.top + rows, height)
        if x < right and y < bottom:
            part = self.mask[y - self.top : bottom - self.top, x - self.left : right - self.left]
            image[y:bottom, x:right] = part
        return image


class RayScene:
    """Surfaces at their places in S, and rays at them.

    Args:
        vertices: (V, 3) of all surfaces in S [m].
        faces: (F, 3).
        labels: (F,) label of each face.
    """

    def __init__(self, vertices: Array, faces: Indices, labels: Indices) -> None:
        self._vertices, self._faces = vertices, faces
        # One more for rays that meet nothing, at index -1.
        self._labels = np.append(labels, SURROUNDINGS).astype(np.uint16)
        self._alone: dict[int, tuple[Array, RayCaster]] = {}

    @classmethod
    def joined(cls, parts: Sequence[tuple[int, Array, Indices]]) -> RayScene:
        """From surfaces: label, vertices (V, 3) in S [m] and faces (F, 3) of each."""
        starts = np.cumsum([0, *(len(vertices) for _, vertices, _ in parts)])
        return cls(
            np.concatenate([np.empty((0, 3)), *(vertices for _, vertices, _ in parts)]),
            np.concatenate(
                [np.empty((0, 3), np.int64)]
                + [faces + start for (_, _, faces), start in zip(parts, starts, strict=False)]
            ),
            np.repeat([label for label, _, _ in parts], [len(faces) for _, _, faces in parts]),
        )

    def images(self, view: View, *, normals: bool = False) -> Images:
        """Depth and labels of a view; its normals as well if asked for."""
        pixels = _pixel_rays(view.intrinsics)
        shape = view.intrinsics.height, view.intrinsics.width
        rotation = view.X_SC[:3, :3].astype(np.float32)
        face, distance = self._rays.seen_from(view.X_SC[:3, 3], _rotated(pixels.unit, rotation))
        depth = distance * pixels.unit[:, 2]
        near, far = view.depth_range
        depth[(face == NONE) | (depth < near) | (depth > far)] = 0.0
        return Images(
            depth=depth.reshape(shape),
            labels=self._labels[face].reshape(shape),
            normals=self._normals_seen(face, pixels.unit, rotation, shape) if normals else None,
        )

    def silhouette(self, number: int, view: View) -> Silhouette:
        """The silhouette of an object.

        Args:
            number: its label.
            view: the camera. Without lens distortion up to one image size beyond each edge of the
                image counts, with it the image alone: the model of a lens does not reach further.
        """
        if number not in self._alone:
            self._alone[number] = self._surface_of(number)
        vertices, rays = self._alone[number]
        box = _pixels_around(vertices, view)
        if box is None:
            return Silhouette(0, 0, np.zeros((0, 0), bool))
        left, top, right, bottom = box
        unit = _directions(view.intrinsics, left, top, right, bottom)
        rotation = view.X_SC[:3, :3].astype(np.float32)
        face, _ = rays.seen_from(view.X_SC[:3, 3], _rotated(unit, rotation))
        mask = (face != NONE).reshape(bottom - top, right - left)
        rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
        if not len(rows):
            return Silhouette(0, 0, np.zeros((0, 0), bool))
        cut = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        return Silhouette(left + int(columns[0]), top + int(rows[0]), cut)

    @cached_property
    def _rays(self) -> RayCaster:
        return RayCaster(self._vertices, self._faces)

    @cached_property
    def _normals(self) -> Single:
        """(F + 1, 3) unit normals in S, zeros for a face without area and for no face."""
        a, b, c = self._vertices[self._faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0)
        normals_or_none: Single = np.append(unit, np.zeros((1, 3)), axis=0).astype(np.float32)
        return normals_or_none

    def _normals_seen(
        self, face: NDArray[np.int32], unit: Single, rotation: Single, shape: tuple[int, int]
    ) -> Single:
        normals = (self._normals @ rotation)[face]
        away = np.einsum("ij,ij->i", normals, unit) > 0.0
        normals[away] *= -1.0
        seen: Single = normals.reshape(*shape, 3)
        return seen

    def _surface_of(self, number: int) -> tuple[Array, RayCaster]:
        faces = self._faces[self._labels[:-1] == number]
        used, mine = np.unique(faces, return_inverse=True)
        vertices = self._vertices[used]
        return vertices, RayCaster(vertices, mine.reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class _PixelRays:
    unit: Single


def _pixel_rays(intrinsics: Intrinsics) -> _PixelRays:
    return _pixel_rays_of(
        (intrinsics.width, intrinsics.height),
        intrinsics.focal,
        intrinsics.center,
        intrinsics.distortion,
    )


@lru_cache(maxsize=8)
def _pixel_rays_of(
    size: tuple[int, int],
    focal: tuple[float, float],
    center: tuple[float, float],
    distortion: tuple[float, ...],
) -> _PixelRays:
    width, height = size
    intrinsics = Intrinsics(
        width=width, height=height, focal=focal, center=center, distortion=distortion
    )
    return _PixelRays(_unit(FieldOfView(intrinsics).directions))


def _directions(intrinsics: Intrinsics, left: int, top: int, right: int, bottom: int) -> Single:
    """Unit vectors through pixels of a rectangle, row by row; it may leave a pinhole's image."""
    if not intrinsics.is_pinhole:
        shape = (intrinsics.height, intrinsics.width, 3)
        return _pixel_rays(intrinsics).unit.reshape(shape)[top:bottom, left:right].reshape(-1, 3)
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    x = (np.arange(left, right) - cx) / fx
    y = (np.arange(top, bottom) - cy) / fy
    flat = np.stack(np.meshgrid(x, y), axis=-1)
    return _unit(np.concatenate([flat, np.ones((*flat.shape[:2], 1))], axis=-1))


def _unit(directions: Array) -> Single:
    """(N, 3) unit vectors in the order of the pixels."""
    length = np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.ascontiguousarray((directions / length).reshape(-1, 3), np.float32)


def _rotated(unit: Single, rotation: Single) -> Single:
    """(N, 3) vectors turned; a matrix product of such a shape starts threads, and takes longer."""
    import cv2

    if not len(unit):
        return unit
    return np.asarray(cv2.transform(unit[:, None], rotation), np.float32).reshape(-1, 3)


def _pixels_around(vertices: Array, view: View) -> tuple[int, int, int, int] | None:
    """Rectangle of pixels that may show points (N, 3) in S: left, top, right, bottom, the last two
    not within; None if there are none."""
    intrinsics = view.intrinsics
    width, height = intrinsics.width, intrinsics.height
    low, high = np.array([0, 0]), np.array([width, height])
    if intrinsics.is_pinhole:
        low, high = -high, 2 * high
    p_CQ = transform_points(inverse(view.X_SC), vertices)
    if (p_CQ[:, 2] < NEAR).all():
        return None
    if (p_CQ[:, 2] >= NEAR).all() and intrinsics.is_pinhole:
        pixels = intrinsics.project(p_CQ)
        low = np.maximum(low, np.floor(pixels.min(axis=0)).astype(int))
        high = np.minimum(high, np.ceil(pixels.max(axis=0)).astype(int) + 1)
    if (low >= high).any():
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def label_numbers(names: Sequence[str]) -> Mapping[str, int]:
    """Labels of instances, in the scene's order."""
    return {name: number for number, name in enumerate(names, SURROUNDINGS + 1)}
