"""Surfaces projected along z onto the grid of a sheet: at each pixel the lowest point of them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

CHUNK = 2_000_000
"""Pixels that are painted at a time; bounds the memory."""
EDGE_TOLERANCE = 1e-7
"""Pixel centres this close to an edge lie in the triangle [px], so that neighbours leave no gap."""


@dataclass(frozen=True)
class Grid:
    """Pixels of a sheet: row 0 lies along its upper edge, column 0 along its left one.

    Attributes:
        size: extents of the sheet along x and y [m].
        resolution: side of a pixel [m].
    """

    size: tuple[float, float]
    resolution: float

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns; the last ones may reach over the edge."""
        x, y = (int(np.ceil(s / self.resolution - 1e-6)) for s in self.size)
        return y, x

    def pixels(self, p_SQ: Array) -> Array:
        """(..., 2) column and row of points (..., 2 or 3) of the scene frame; centres of pixels
        are at whole numbers."""
        u = p_SQ[..., 0] / self.resolution - 0.5
        v = (self.size[1] - p_SQ[..., 1]) / self.resolution - 0.5
        return np.stack([u, v], axis=-1)

    def points(self, pixels: Array) -> Array:
        """(..., 2) points of the sheet [m] at (..., 2) columns and rows."""
        x = (pixels[..., 0] + 0.5) * self.resolution
        y = self.size[1] - (pixels[..., 1] + 0.5) * self.resolution
        return np.stack([x, y], axis=-1)


@dataclass(frozen=True, eq=False)
class Layer:
    """What one instance shows of itself on a part of the grid.

    Attributes:
        grid: pixels of the whole sheet.
        row, column: of the part's upper left pixel.
        height: (H, W) lowest point over each pixel's centre [m]; infinite where there is nothing.
        lowest: its lowest point anywhere [m].
    """

    grid: Grid
    row: int
    column: int
    height: NDArray[np.float32]
    lowest: float

    @property
    def covered(self) -> NDArray[np.bool_]:
        """(H, W) where the instance is."""
        return np.isfinite(self.height)

    def points(self) -> Array:
        """(N, 2) centres of the pixels that it covers, in the scene frame [m]."""
        rows, columns = np.nonzero(self.covered)
        return self.grid.points(np.stack([columns + self.column, rows + self.row], axis=-1))

    @property
    def window(self) -> tuple[slice, slice]:
        """Its place in the whole grid."""
        rows, columns = self.height.shape
        return slice(self.row, self.row + rows), slice(self.column, self.column + columns)


def lowest_surface(grid: Grid, p_SV: Array, faces: NDArray[np.int64]) -> Layer:
    """Projects a surface.

    Args:
        grid: of the sheet; what lies beside it is left out.
        p_SV: (V, 3) vertices [m].
        faces: (F, 3) triangles; which way round does not matter.
    """
    uv = grid.pixels(p_SV)
    lower = np.clip(np.floor(uv.min(axis=0)), 0, None).astype(int)
    upper = np.minimum(np.ceil(uv.max(axis=0)), np.array(grid.shape[::-1]) - 1).astype(int)
    columns, rows = np.maximum(upper - lower + 1, 0)
    height = np.full(rows * columns, np.inf, dtype=np.float32)
    if height.size:
        corners = np.concatenate([uv - lower, p_SV[:, 2:]], axis=1)[faces]
        _paint(height, corners, (int(rows), int(columns)))
    lowest = float(p_SV[:, 2].min())
    return Layer(grid, int(lower[1]), int(lower[0]), height.reshape(rows, columns), lowest)


def lowest_of(layers: list[Layer]) -> list[Layer]:
    """The layers, each without what lies above another one."""
    return [_seen_below(layer, [o for o in layers if o is not layer]) for layer in layers]


def area_above(layer: Layer, other: Layer) -> int:
    """Pixels in which a layer lies above another one."""
    mine, its = _shared(layer, other)
    return int((other.height[its] < layer.height[mine]).sum())


def _seen_below(layer: Layer, others: list[Layer]) -> Layer:
    height = layer.height.copy()
    for other in others:
        mine, its = _shared(layer, other)
        height[mine][other.height[its] < layer.height[mine]] = np.inf
    return dataclasses.replace(layer, height=height)


def _shared(layer: Layer, other: Layer) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """The part of the grid that two layers share, in the pixels of the one and of the other."""
    top, left = max(layer.row, other.row), max(layer.column, other.column)
    bottom = max(top, min(layer.window[0].stop, other.window[0].stop))
    right = max(left, min(layer.window[1].stop, other.window[1].stop))

    def window(one: Layer) -> tuple[slice, slice]:
        return (
            slice(top - one.row, bottom - one.row),
            slice(left - one.column, right - one.column),
        )

    return window(layer), window(other)


def _paint(height: NDArray[np.float32], corners: Array, shape: tuple[int, int]) -> None:
    """Lowers `height` (flat) to the triangles, row by row.

    Args:
        height: (rows * columns,) changed in place.
        corners: (F, 3, 3) column, row, height [m] of each corner.
        shape: rows and columns.
    """
    triangle, row, left, right = _spans(corners, shape)
    first = np.clip(np.ceil(left - EDGE_TOLERANCE), 0, None).astype(np.int64)
    last = np.minimum(np.floor(right + EDGE_TOLERANCE), shape[1] - 1).astype(np.int64)
    slopes = _slopes(corners)
    lowest, highest = corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1)
    count = np.maximum(last - first + 1, 0)
    chunk = (np.cumsum(count) - 1) // CHUNK
    for k in range(int(chunk[-1]) + 1 if len(chunk) else 0):
        part = (chunk == k) & (count > 0)
        n = count[part]
        t, r = np.repeat(triangle[part], n), np.repeat(row[part], n)
        c = np.arange(n.sum()) + np.repeat(first[part] - (np.cumsum(n) - n), n)
        z = corners[t, 0, 2]
        z += slopes[t, 0] * (c - corners[t, 0, 0]) + slopes[t, 1] * (r - corners[t, 0, 1])
        z = np.clip(z, lowest[t], highest[t]).astype(np.float32)
        np.minimum.at(height, r * shape[1] + c, z)


def _spans(
    corners: Array, shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array, Array]:
    """Triangle, row, left and right end [px] of each row of pixels of each triangle."""
    v = corners[:, :, 1]
    top = np.clip(np.ceil(v.min(axis=1)), 0, None).astype(np.int64)
    bottom = np.minimum(np.floor(v.max(axis=1)), shape[0] - 1).astype(np.int64)
    n = np.maximum(bottom - top + 1, 0)
    triangle = np.repeat(np.arange(len(corners)), n)
    row = np.arange(n.sum()) + np.repeat(top - (np.cumsum(n) - n), n)
    left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = corners[triangle, i], corners[triangle, j]
        rise = b[:, 1] - a[:, 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (row - a[:, 1]) / rise
        crossed = (share >= 0.0) & (
            share <= 1.0
        )  # never of a level edge: its ends are others', too
        u = a[:, 0] + np.where(crossed, share, 0.0) * (b[:, 0] - a[:, 0])
        left = np.where(crossed, np.minimum(left, u), left)
        right = np.where(crossed, np.maximum(right, u), right)
    hit = left <= right
    return triangle[hit], row[hit], left[hit], right[hit]


def _slopes(corners: Array) -> Array:
    """(F, 2) rise of each triangle's plane a column and a row [m]; 0 of one that stands upright."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(a, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        slopes = -normal[:, :2] / normal[:, 2:]
    return np.where(np.isfinite(slopes), slopes, 0.0)
