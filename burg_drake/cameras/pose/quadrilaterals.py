"""Dark quadrilaterals in an image, and what lies in their cells.

As OpenCV's ArUco detector finds them: an adaptive threshold, contours, polygons with four corners.
Cells of all quadrilaterals are read at once, which takes a small part of the time that reading one
after the other does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

CROOKED = 0.03
"""Most that the sides of a quadrilateral may be off a contour, as a share of its length: OpenCV's
value."""
SHORTEST_SIDE = 0.05
"""Least distance of two corners, as a share of the contour's length: OpenCV's value."""
MARGIN = 3
"""Distance that corners keep from the image's border [pixels]: OpenCV's value."""
IN_CELL = (-0.2, 0.2)
"""Where cells are read along both axes, from the middle of a cell [cells]."""
LEAST_CONTRAST = 10.0
"""Between the black and the white cells of a marker [8-bit levels]; less is noise."""


def dark_quadrilaterals(
    grey: NDArray[np.uint8], window: int, constant: float, perimeter: float
) -> Array:
    """(N, 4, 2) corners of what is darker than its surroundings and has four sides, clockwise in
    the image [pixels].

    Args:
        grey: (H, W) image.
        window: of the surroundings, odd [pixels].
        constant: by which it is darker than their mean [8-bit levels].
        perimeter: least length of a contour [pixels].
    """
    import cv2

    dark = cv2.adaptiveThreshold(
        grey, 255.0, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, window, constant
    )
    contours, _ = cv2.findContours(dark, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
    found, lengths = [], []
    for contour in contours:
        if len(contour) < 4:  # specks, most of all contours
            continue
        length = cv2.arcLength(contour, True)
        if length >= perimeter:
            polygon = cv2.approxPolyDP(contour, CROOKED * length, True)
            if len(polygon) == 4:
                found.append(polygon)
                lengths.append(length)
    if not found:
        return np.empty((0, 4, 2))
    corners = np.asarray(found, dtype=float).reshape(-1, 4, 2)
    side = np.roll(corners, -1, axis=1) - corners
    turn = side[..., 0] * np.roll(side[..., 1], -1, 1) - side[..., 1] * np.roll(side[..., 0], -1, 1)
    convex = (turn > 0.0).all(axis=1) | (turn < 0.0).all(axis=1)
    shortest = np.sqrt((side**2).sum(axis=2)).min(axis=1)
    limit = np.array([grey.shape[1], grey.shape[0]]) - 1 - MARGIN
    inside = ((corners >= MARGIN) & (corners <= limit)).all(axis=(1, 2))
    corners[turn[:, 0] < 0.0] = corners[turn[:, 0] < 0.0, ::-1]
    chosen: Array = corners[convex & inside & (shortest >= SHORTEST_SIDE * np.array(lengths))]
    return chosen


def read_cells(
    grey: NDArray[np.uint8], corners: Array, cells: int
) -> tuple[NDArray[np.bool_], Array]:
    """Which cells of quadrilaterals are black, in rows from the first corner toward the second.

    Args:
        grey: (H, W) image.
        corners: (N, 4, 2), see `dark_quadrilaterals`.
        cells: along a side.

    Returns:
        (N, cells, cells), and contrasts (N,) of black and white [8-bit levels].
    """
    import cv2

    at = (np.arange(cells)[:, None] + 0.5 + IN_CELL).ravel() / cells
    x, y = np.meshgrid(at, at)
    u, v = _from_unit_square(corners, x.ravel(), y.ravel())
    values = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    n = len(IN_CELL)
    shaped = values.astype(float).reshape(len(corners), cells, n, cells, n)
    means = sum(shaped[:, :, i, :, j] for i in range(n) for j in range(n)) / n**2
    return _otsu_split(means.reshape(len(corners), -1), means.shape)


def _from_unit_square(
    corners: Array, x: Array, y: Array
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(N, M) columns and rows of points of the unit square under the homographies that take its
    corners to those of quadrilaterals (Heckbert, Fundamentals of Texture Mapping, 1989, section
    2.2)."""
    a, b, c, d = corners.transpose(1, 0, 2)
    (bx, by), (dx, dy), (sx, sy) = (b - c).T, (d - c).T, (a - b + c - d).T
    det = bx * dy - dx * by
    g, h = (sx * dy - dx * sy) / det, (bx * sy - sx * by) / det
    along_x, along_y = b - a + g[:, None] * b, d - a + h[:, None] * d
    u = along_x[:, :1] * x + along_y[:, :1] * y + a[:, :1]
    v = along_x[:, 1:] * x + along_y[:, 1:] * y + a[:, 1:]
    w = g[:, None] * x + h[:, None] * y + 1.0
    return (u / w).astype(np.float32), (v / w).astype(np.float32)


def _otsu_split(means: Array, shape: tuple[int, ...]) -> tuple[NDArray[np.bool_], Array]:
    """Splits each row of brightnesses where the variance between both parts is largest (Otsu, A
    Threshold Selection Method from Gray-Level Histograms, 1979)."""
    ordered = np.sort(means, axis=1)
    count = np.arange(1, means.shape[1])
    total = np.cumsum(ordered, axis=1)
    lower = total[:, :-1] / count
    upper = (total[:, -1:] - total[:, :-1]) / (means.shape[1] - count)
    best = (count * (means.shape[1] - count) * (upper - lower) ** 2).argmax(axis=1)[:, None]
    limit = np.take_along_axis(ordered, best, axis=1)
    contrast = np.take_along_axis(upper - lower, best, axis=1)[:, 0]
    return (means <= limit).reshape(shape), contrast
