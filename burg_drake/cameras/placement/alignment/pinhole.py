"""A camera that looks at the board, and what of placed objects it sees."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment.shape import TargetShape
from burg_drake.cameras.placement.alignment.window import Window, window_around
from burg_drake.core import Array, inverse, transform_points

NEAR = 1e-3
"""Depth of what is nearer to the camera's plane, or behind it [m]."""


@dataclass(frozen=True, eq=False)
class PinholeView:
    """A camera without lens distortion.

    Attributes:
        K: (3, 3) camera matrix, pixel centres at integers.
        size: width and height of its image [pixels].
        X_SC: (4, 4) where it is.
        blind: (H, W) pixels that show nothing; None if all do.
    """

    K: Array
    size: tuple[int, int]
    X_SC: Array
    blind: NDArray[np.bool_] | None = None

    @cached_property
    def X_CS(self) -> Array:
        """(4, 4) scene frame in the camera's."""
        return inverse(self.X_SC)

    def project(self, p_SQ: Array) -> tuple[Array, Array]:
        """Points (N, 3) of S in the camera frame, and their pixels (N, 2)."""
        p_CQ = transform_points(self.X_CS, p_SQ)
        depth = np.maximum(p_CQ[:, 2:], NEAR)
        return p_CQ, p_CQ[:, :2] / depth * self.K[[0, 1], [0, 1]] + self.K[:2, 2]

    def jacobian(self, p_SQ: Array) -> Array:
        """(N, 2, 3) by how many pixels points (N, 3) of S move per metre along x, y, z of S."""
        p_CQ, _ = self.project(p_SQ)
        z = np.maximum(p_CQ[:, 2], NEAR)
        fx, fy = self.K[0, 0], self.K[1, 1]
        zero = np.zeros_like(z)
        x = np.stack([fx / z, zero, -fx * p_CQ[:, 0] / z**2], axis=-1)
        y = np.stack([zero, fy / z, -fy * p_CQ[:, 1] / z**2], axis=-1)
        return np.stack([x, y], axis=1) @ self.X_CS[:3, :3]

    def cast(self, shape: TargetShape, q: Array, pixels: Array) -> Array:
        """(...,) depth of a displaced shape at image points; see `hits`."""
        return self.hits(shape, q, pixels)[1]

    def hits(self, shape: TargetShape, q: Array, pixels: Array) -> tuple[NDArray[np.int64], Array]:
        """What of a displaced shape is seen at image points.

        Args:
            shape: the object.
            q: (3,) its displacement.
            pixels: (..., 2).

        Returns:
            (...,) its faces, -1 where the shape is not; and distances along the optical axis [m],
            infinity there.
        """
        at = pixels.reshape(-1, 2)
        rays = np.ones((len(at), 3))
        rays[:, :2] = (at - self.K[:2, 2]) / self.K[[0, 1], [0, 1]]
        length = np.linalg.norm(rays, axis=1)
        X_OC = inverse(shape.displacement(q)) @ self.X_SC
        direction = (rays / length[:, None]) @ X_OC[:3, :3].T
        origins = np.broadcast_to(X_OC[:3, 3], direction.shape)
        face, distance = shape.rays.first_hits(origins, direction)
        at_pixels = pixels.shape[:-1]
        return face.reshape(at_pixels), (distance / length).reshape(at_pixels)

    def points(self, shape: TargetShape, q: Array, pixels: Array, depth: Array) -> Array:
        """(..., 3) points that a displaced shape has at image points (..., 2), with depths (...,),
        as they are before it is displaced [m]."""
        xy = (pixels - self.K[:2, 2]) / self.K[[0, 1], [0, 1]]
        p_CQ = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1) * depth[..., None]
        X_SC = inverse(shape.displacement(q)) @ self.X_SC
        return np.asarray(transform_points(X_SC, p_CQ.reshape(-1, 3)).reshape(p_CQ.shape))

    def buffer(self, shape: TargetShape, q: Array, window: Window) -> Array:
        """Depth of a displaced shape at the pixels of a window's raster; see `cast`."""
        return self.cast(shape, q, window.pixels())

    def window(self, shape: TargetShape, q: Array, margin: float) -> Window:
        """The part of the image around a displaced shape."""
        _, pixels = self.project(transform_points(shape.displacement(q), shape.p_SV))
        return self.window_of(pixels, margin)

    def window_of(self, pixels: Array, margin: float) -> Window:
        """The part of the image around some of its points (N, 2)."""
        return window_around(pixels, margin, self.size, 1.0)

    def depth(self, placed: Iterable[tuple[TargetShape, Array]]) -> Array:
        """(H, W) depth of the nearest of several displaced shapes; infinity where there is none, 0
        where the camera is blind."""
        nearest = np.full(self.size[::-1], np.inf)
        if self.blind is not None:
            nearest[self.blind] = 0.0
        for shape, q in placed:
            window = self.window(shape, q, 1.0)
            part = nearest[window_slices(window)]
            np.minimum(part, self.buffer(shape, q, window), out=part)
        return nearest

    def seen(self, shape: TargetShape, q: Array, others: Array) -> tuple[float, float]:
        """Shares of a displaced shape's silhouette.

        Args:
            shape: the object.
            q: (3,) its displacement.
            others: (H, W) depth of what may stand before it.

        Returns:
            Of the whole silhouette, what is in the image; and what is in the image and not hidden.
        """
        p_CV, pixels = self.project(transform_points(shape.displacement(q), shape.p_SV))
        if (p_CV[:, 2] <= NEAR).any():
            return 0.0, 0.0
        low = np.floor(pixels.min(axis=0)).astype(int) - 1
        extent = np.ceil(pixels.max(axis=0)).astype(int) + 2 - low
        scale = min(1.0, 200.0 / extent.max())
        whole = Window(int(low[0]), int(low[1]), int(extent[0]), int(extent[1]), scale)
        depth = self.buffer(shape, q, whole)
        rows, columns = np.nonzero(np.isfinite(depth))
        at = np.round(whole.image(np.stack([columns, rows], axis=-1))).astype(int)
        inside = ((at >= 0) & (at < self.size)).all(axis=1)
        x, y = at[inside].T
        free = others[y, x] > depth[rows, columns][inside]
        total = max(len(at), 1)
        return float(inside.sum() / total), float(free.sum() / total)


def window_slices(window: Window) -> tuple[slice, slice]:
    """The window's part of an image."""
    rows = slice(window.top, window.top + window.height)
    return rows, slice(window.left, window.left + window.width)


def sample_nearest(values: NDArray[Any], pixels: Array, outside: float) -> Array:
    """Values (H, W) at the pixels nearest to image points (..., 2); `outside` beyond the image."""
    at = np.round(pixels).astype(int)
    height, width = values.shape[:2]
    inside = (at[..., 0] >= 0) & (at[..., 0] < width) & (at[..., 1] >= 0) & (at[..., 1] < height)
    x, y = np.clip(at[..., 0], 0, width - 1), np.clip(at[..., 1], 0, height - 1)
    return np.where(inside, values[y, x], outside)
