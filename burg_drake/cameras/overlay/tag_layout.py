"""Where tags go in an image: beside the bodies that they name, covering as little as they can."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.overlay.text_tags import DARK, paste
from burg_drake.core import Array, Bytes

GAP = 4
"""Between a tag and what it names, and between tags [pixels]."""
TAG_ROWS = 4
"""Number of distances from the body at which a tag is tried; they are a tag's height apart."""
ROW_COST = 0.05
"""Cost of moving a tag away by its height, as the share of the tag that covers bodies."""
LEADER_DISTANCE = 12.0
"""Distance of a tag from its box beyond which a line connects them [pixels]."""
Corner = tuple[int, int]
Plate = tuple[Bytes, NDArray[np.uint16]]


def write_tags(
    image: Bytes, boxes: Array, plates: Sequence[Plate], bodies: NDArray[np.bool_]
) -> None:
    """Draws tags into an image (H, W, 3), in place; see `lay_out`.

    Tags that had to move away have a line to the middle of what they name.
    """
    sizes = [(colors.shape[1], colors.shape[0]) for colors, _ in plates]
    corners = lay_out(boxes, sizes, bodies)
    for corner, size, box in zip(corners, sizes, boxes, strict=True):
        low, high = np.array(corner), np.array(corner) + size
        apart = np.maximum(np.maximum(box[0] - high, low - box[1]), 0.0)
        if np.hypot(*apart) > LEADER_DISTANCE:
            middle = np.round(box.mean(axis=0)).astype(int)
            start = np.clip(middle, low, high)
            cv2.line(image, start.tolist(), middle.tolist(), DARK, 1, cv2.LINE_AA)
    for plate, corner in zip(plates, corners, strict=True):
        paste(image, plate, corner)


def lay_out(
    boxes: Array, sizes: Sequence[tuple[int, int]], bodies: NDArray[np.bool_]
) -> list[Corner]:
    """Finds a place for each tag.

    Args:
        boxes: (N, 2, 2) corners of what the tags name, least and largest x and y [pixels].
        sizes: width and height of the tags [pixels].
        bodies: (H, W) pixels of the image that show what the tags should not cover.

    Returns:
        Column and row of the tags' upper left corners: the place about the box, on no other tag,
        that covers the least of the bodies and is the closest.
    """
    image = bodies.shape[1], bodies.shape[0]
    covered = cv2.integral(bodies.astype(np.uint8))
    placed: list[tuple[int, int, int, int]] = []
    corners: list[Corner] = [(0, 0)] * len(sizes)

    def cost(corner: Corner, row: int, size: tuple[int, int]) -> float:
        (x, y), (width, height) = corner, size
        right, bottom = min(x + width, image[0]), min(y + height, image[1])
        hidden = covered[bottom, right] - covered[y, right] - covered[bottom, x] + covered[y, x]
        return float(hidden) / (width * height) + ROW_COST * row

    # From the top of the image: tags go above, so that what is higher has its place first.
    for i in np.argsort(boxes[:, 0, 1], kind="stable"):
        options = [(_within(c, sizes[i], image), row) for c, row in _options(boxes[i], *sizes[i])]
        free = [o for o in options if not any(_overlap((*o[0], *sizes[i]), p) for p in placed)]
        corners[i] = min(free or options, key=lambda o: cost(o[0], o[1], sizes[i]))[0]
        placed.append((*corners[i], *sizes[i]))
    return corners


def _options(box: Array, width: int, height: int) -> list[tuple[Corner, int]]:
    """Corners of a tag about a box with their distance in rows; of equal ones the best first."""
    (left, top), (right, bottom) = np.round(box).astype(int).tolist()
    x, y = (left + right - width) // 2, (top + bottom - height) // 2
    options: list[tuple[Corner, int]] = []
    for row in range(TAG_ROWS):
        away = GAP + row * (height + 2)
        for column in (x, left, right - width):
            options += [((column, top - height - away), row), ((column, bottom + away), row)]
        for line in (y, top, bottom - height):
            options += [((right + away, line), row), ((left - width - away, line), row)]
    return [*options, ((x, y), 0)]


def _within(corner: Corner, size: tuple[int, int], image: tuple[int, int]) -> Corner:
    x, y = (min(max(c, 0), max(n - s, 0)) for c, s, n in zip(corner, size, image, strict=True))
    return x, y


def _overlap(a: tuple[int, int, int, int], b: tuple[int, int, int, int]) -> bool:
    return all(a[k] < b[k] + b[k + 2] + 1 and b[k] < a[k] + a[k + 2] + 1 for k in (0, 1))
