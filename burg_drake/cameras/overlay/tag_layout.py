"""Where texts go in an image: beside what they belong to, and not over each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from burg_drake.core import Array

GAP = 4
"""Between a tag and what it names, and between tags [pixels]."""
Corner = tuple[int, int]


def lay_out(boxes: Array, sizes: Sequence[tuple[int, int]], image: tuple[int, int]) -> list[Corner]:
    """Finds a place for each tag.

    Args:
        boxes: (N, 2, 2) corners of what the tags name, least and largest x and y [pixels].
        sizes: width and height of the tags [pixels].
        image: width and height of the image [pixels].

    Returns:
        Column and row of the tags' upper left corners. Above what they name, or else below, at its
        side, or on it; where all these places are taken, as near above as there is room.
    """
    placed: list[tuple[int, int, int, int]] = []
    corners: list[Corner] = [(0, 0)] * len(sizes)
    # From the top of the image: tags go above, so that what is higher has its place first.
    for i in np.argsort(boxes[:, 0, 1], kind="stable"):
        width, height = sizes[i]
        options = [_within(c, sizes[i], image) for c in _options(boxes[i], width, height)]
        free = [c for c in options if not any(_overlap((*c, width, height), p) for p in placed)]
        corners[i] = free[0] if free else options[0]
        placed.append((*corners[i], width, height))
    return corners


def _options(box: Array, width: int, height: int) -> list[Corner]:
    """Corners of a tag about a box, the best first."""
    (left, top), (right, bottom) = np.round(box).astype(int).tolist()
    x, y = (left + right - width) // 2, (top + bottom - height) // 2
    above, below = top - height - GAP, bottom + GAP
    beside = [(right + GAP, y), (left - width - GAP, y)]
    stacked = [(x, above - k * (height + 2)) for k in (1, 2, 3)]
    return [(x, above), (x, below), *beside, (x, y), *stacked]


def _within(corner: Corner, size: tuple[int, int], image: tuple[int, int]) -> Corner:
    x, y = (min(max(c, 0), max(n - s, 0)) for c, s, n in zip(corner, size, image, strict=True))
    return x, y


def _overlap(a: tuple[int, int, int, int], b: tuple[int, int, int, int]) -> bool:
    return all(a[k] < b[k] + b[k + 2] + 1 and b[k] < a[k] + a[k + 2] + 1 for k in (0, 1))
