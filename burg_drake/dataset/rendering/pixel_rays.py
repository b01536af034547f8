"""Where pixels look, and which of them can show a surface."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from burg_drake.cameras.optics import NEAR, FieldOfView, Intrinsics
from burg_drake.core import Array, Indices, Single

PixelBox = tuple[int, int, int, int]
"""A rectangle: left, top, right, bottom, the last two not within; it may leave the image."""


def flat_directions(intrinsics: Intrinsics) -> tuple[Single, Single]:
    """x / z and y / z of the rays through the pixels' centres: (1, W) and (H, 1) of a camera
    without distortion, else (H, W) each."""
    return _Grid.of(intrinsics).flat


def unit_directions(intrinsics: Intrinsics, pixels: PixelBox) -> Single:
    """(N, 3) unit vectors through the pixels of a rectangle, row by row; it may leave the image of
    a camera without distortion."""
    left, top, right, bottom = pixels
    if not intrinsics.is_pinhole:
        unit = _Grid.of(intrinsics).unit[top:bottom, left:right]
        return np.ascontiguousarray(unit).reshape(-1, 3)
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    x = (np.arange(left, right, dtype=float) - cx) / fx
    y = (np.arange(top, bottom, dtype=float) - cy) / fy
    return _unit(x, y[:, None]).reshape(-1, 3)


def pixels_around(
    p_CQ: Array, faces: Indices, intrinsics: Intrinsics, *, beyond: bool = False
) -> PixelBox | None:
    """A rectangle of pixels that holds all that can show a surface before the camera.

    Args:
        p_CQ: (V, 3) its vertices in the camera's frame [m].
        faces: (F, 3) its triangles.
        intrinsics: of the camera.
        beyond: whether it may leave the image by the image's size at each edge. A model of lens
            distortion does not reach further than the image.

    Returns:
        None if there are none.
    """
    before = p_CQ[:, 2] >= NEAR
    if not before.all():
        p_CQ = _cut_at_near(p_CQ, faces, before)
    if not len(p_CQ):
        return None
    flat = p_CQ[:, :2] / p_CQ[:, 2:]
    lower, upper = flat.min(axis=0), flat.max(axis=0)
    if not intrinsics.is_pinhole:
        return _Grid.of(intrinsics).within(lower, upper)
    size = np.array([intrinsics.width, intrinsics.height])
    reach = size if beyond else 0
    low = np.maximum(-reach, np.floor(lower * intrinsics.focal + intrinsics.center))
    high = np.minimum(size + reach, np.ceil(upper * intrinsics.focal + intrinsics.center) + 1.0)
    if (low >= high).any():
        return None
    return int(low[0]), int(low[1]), int(high[0]), int(high[1])


def _cut_at_near(p_CQ: Array, faces: Indices, before: np.ndarray) -> Array:
    """The points that lie before the camera, and where edges come before it."""
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    a, b = p_CQ[edges[before[edges[:, 0]] != before[edges[:, 1]]].T]
    share = (NEAR - a[:, 2:]) / (b[:, 2:] - a[:, 2:])
    points: Array = np.concatenate([p_CQ[before], a + share * (b - a)])
    return points


def _unit(x: Array, y: Array) -> Single:
    """(H, W, 3) unit vectors along (x, y, 1)."""
    length = np.sqrt(x * x + y * y + 1.0)
    unit = np.empty((*length.shape, 3), np.float32)
    np.divide(x, length, out=unit[..., 0], casting="same_kind")
    np.divide(y, length, out=unit[..., 1], casting="same_kind")
    np.divide(1.0, length, out=unit[..., 2], casting="same_kind")
    return unit


class _Grid:
    """The rays of a camera's pixels; those of lenses with distortion cost much to find."""

    def __init__(self, intrinsics: Intrinsics) -> None:
        flat = FieldOfView(intrinsics).directions[..., :2]
        x, y = flat[..., 0], flat[..., 1]
        if intrinsics.is_pinhole:
            x, y = x[:1], y[:, :1]
        self.flat = x.astype(np.float32), y.astype(np.float32)
        self.unit = _unit(x, y)

    @staticmethod
    def of(intrinsics: Intrinsics) -> _Grid:
        one = intrinsics
        return _grid_of(one.width, one.height, one.focal, one.center, one.distortion)

    def within(self, lower: Array, upper: Array) -> PixelBox | None:
        """The pixels that look between bounds of x / z and y / z."""
        x, y = self.flat
        inside = (x >= lower[0]) & (x <= upper[0]) & (y >= lower[1]) & (y <= upper[1])
        rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
        if not len(rows):
            return None
        return int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1


@lru_cache(maxsize=8)
def _grid_of(
    width: int,
    height: int,
    focal: tuple[float, float],
    center: tuple[float, float],
    distortion: tuple[float, ...],
) -> _Grid:
    return _Grid(
        Intrinsics(width=width, height=height, focal=focal, center=center, distortion=distortion)
    )
