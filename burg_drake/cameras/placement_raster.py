"""Depth buffers of placed meshes, in numpy: which pixels an object covers, and what hides what."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.frames import Array

NEAR = 1e-3
"""Triangles that reach nearer to the camera's plane are left out [m]."""


@dataclass(frozen=True)
class Window:
    """A part of an image, seen by a finer or coarser raster; pixel centres at integers.

    Attributes:
        left, top: first column and row of the image.
        width, height: columns and rows of the image.
        scale: raster pixels per pixel of the image, each way.
    """

    left: int
    top: int
    width: int
    height: int
    scale: float = 1.0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        return round(self.height * self.scale), round(self.width * self.scale)

    def raster(self, pixels: Array) -> Array:
        """(..., 2) raster coordinates of image points."""
        return (pixels - (self.left - 0.5, self.top - 0.5)) * self.scale - 0.5

    def image(self, raster: Array) -> Array:
        """(..., 2) image points of raster coordinates."""
        return (raster + 0.5) / self.scale + (self.left - 0.5, self.top - 0.5)


def window_around(pixels: Array, margin: float, size: tuple[int, int], scale: float) -> Window:
    """The window of an image around some of its points; empty if all are outside.

    Args:
        pixels: (N, 2).
        margin: around them [pixels].
        size: width and height of the image.
        scale: of the window's raster.
    """
    low = np.floor(pixels.min(axis=0) - margin).astype(int)
    high = np.ceil(pixels.max(axis=0) + margin).astype(int) + 1
    low, high = np.clip(low, 0, size), np.clip(high, 0, size)
    width, height = np.maximum(high - low, 0)
    return Window(int(low[0]), int(low[1]), int(width), int(height), scale)


def depth_buffer(p_CV: Array, pixels: Array, faces: NDArray, window: Window) -> Array:
    """Depth of the nearest surface at the middle of each pixel of a raster.

    Args:
        p_CV: (V, 3) vertices in the camera frame [m].
        pixels: (V, 2) where the image has them.
        faces: (F, 3).
        window: of the image.

    Returns:
        (H, W) distance along the optical axis [m]; infinity where there is nothing.
    """
    height, width = window.shape
    inverse = np.zeros(height * width)
    if inverse.size:
        faces = faces[(p_CV[faces, 2] > NEAR).all(axis=1)]
        cell, value = _fragments(window.raster(pixels)[faces], 1.0 / p_CV[faces, 2], height, width)
        np.maximum.at(inverse, cell, value)
    with np.errstate(divide="ignore"):
        return (1.0 / inverse).reshape(height, width)


def _fragments(
    corners: Array, inverse: Array, height: int, width: int
) -> tuple[NDArray[np.int64], Array]:
    """Pixels that triangles cover, with the inverse depth there, which is affine in the raster.

    Args:
        corners: (F, 3, 2) raster coordinates.
        inverse: (F, 3) inverse depths.
    """
    first = np.maximum(np.ceil(corners[..., 1].min(axis=1)), 0).astype(int)
    last = np.minimum(np.floor(corners[..., 1].max(axis=1)), height - 1).astype(int)
    face, row = _ranges(first, last)
    left, right = _spans(corners[face], row)
    start = np.maximum(np.ceil(left - 1e-9), 0)
    stop = np.minimum(np.floor(right + 1e-9), width - 1)
    filled = start <= stop
    face, row = face[filled], row[filled]
    span, column = _ranges(start[filled].astype(int), stop[filled].astype(int))
    face, row = face[span], row[span]
    slope = _gradients(corners, inverse)
    at = inverse[:, 0][face] + slope[face, 0] * (column - corners[face, 0, 0])
    at += slope[face, 1] * (row - corners[face, 0, 1])
    low, high = inverse.min(axis=1), inverse.max(axis=1)
    return row * width + column, np.clip(at, low[face], high[face])


def _ranges(first: NDArray, last: NDArray) -> tuple[NDArray, NDArray]:
    """All (index, number) with first[index] <= number <= last[index]."""
    count = np.maximum(last - first + 1, 0)
    index = np.repeat(np.arange(len(count)), count)
    begin = np.cumsum(count) - count
    return index, np.arange(len(index)) - begin[index] + first[index]


def _spans(corners: Array, row: NDArray) -> tuple[Array, Array]:
    """Where a row enters and leaves each triangle; an empty interval where it does not meet it."""
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        (xa, ya), (xb, yb) = corners[:, i].T, corners[:, j].T
        crosses = (np.minimum(ya, yb) <= row) & (row <= np.maximum(ya, yb)) & (ya != yb)
        with np.errstate(divide="ignore", invalid="ignore"):
            x = xa + (row - ya) * (xb - xa) / (yb - ya)
        left = np.where(crosses, np.minimum(left, x), left)
        right = np.where(crosses, np.maximum(right, x), right)
    return left, right


def _gradients(corners: Array, inverse: Array) -> Array:
    """(F, 2) of the inverse depth per raster pixel."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    da, db = inverse[:, 1] - inverse[:, 0], inverse[:, 2] - inverse[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    area = np.where(np.abs(area) < 1e-12, np.inf, area)
    return (
        np.stack([da * b[:, 1] - db * a[:, 1], db * a[:, 0] - da * b[:, 0]], axis=1) / area[:, None]
    )
