"""Lines drawn into an image to fractions of a pixel, by the distance of each pixel from them.

OpenCV's anti-aliased lines round their ends, and darken where bits of a line overlap; here every
pixel takes the one line that is nearest, whatever bits it is made of.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

FINE = 1 << 10
"""Steps of a distance in one pixel."""
FAR = np.iinfo(np.int64).max


@dataclass(frozen=True, eq=False)
class Strokes:
    """Pixels at lines.

    Attributes:
        at: (P,) indices into the flattened image.
        distance: (P,) from the rim of the line, negative within it [pixels].
        line: (P,) which of the lines is nearest.
    """

    at: NDArray[np.int64]
    distance: Array
    line: NDArray[np.int64]

    def cover(self, wider: float = 0.0) -> Array:
        """(P,) share of each pixel that the line covers, or one that is wider on both sides."""
        return np.clip(0.5 + wider - self.distance, 0.0, 1.0)


def strokes(ends: Array, half_width: Array, reach: float, size: tuple[int, int]) -> Strokes:
    """The pixels at lines.

    Args:
        ends: (N, 2, 2) ends of the lines [pixels], short ones.
        half_width: (N,) [pixels].
        reach: distance from a line's rim up to which pixels are wanted [pixels].
        size: width and height of the image [pixels].
    """
    width, height = size
    nearest = np.full(width * height, FAR)
    if len(ends):
        at, distance, line = _near(ends, half_width + reach, size)
        past = distance - half_width[line] + float(half_width.max())  # at least 0
        np.minimum.at(nearest, at, (past * FINE).astype(np.int64) * len(ends) + line)
    at = np.flatnonzero(nearest != FAR)
    steps, line = np.divmod(nearest[at], max(len(ends), 1))
    return Strokes(at, (steps + 0.5) / FINE - half_width.max(initial=0.0), line)


def _near(
    ends: Array, limit: Array, size: tuple[int, int]
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Pixels nearer to each line than its limit: where, how near, and the line's index."""
    width, height = size
    center = np.round(ends.mean(axis=1)).astype(np.int64)
    half = 0.5 * float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max())
    around = int(half + float(limit.max()) + 0.5)
    offset = np.arange(-around, around + 1)
    # About the lines' middles, where single precision is enough.
    (ax, ay), (bx, by) = (ends - center[:, None]).astype(np.float32).transpose(1, 2, 0)
    ex, ey = bx - ax, by - ay
    square = np.maximum(ex * ex + ey * ey, np.float32(1e-12))
    x = offset.astype(np.float32) - ax[:, None]
    y = offset.astype(np.float32) - ay[:, None]
    along = (x * (ex / square)[:, None])[:, None, :] + (y * (ey / square)[:, None])[:, :, None]
    np.clip(along, 0.0, 1.0, out=along)
    dx = x[:, None, :] - along * ex[:, None, None]
    dy = y[:, :, None] - np.multiply(along, ey[:, None, None], out=along)
    square_distance = np.multiply(dx, dx, out=dx)
    square_distance += np.multiply(dy, dy, out=dy)
    close = square_distance < (limit * limit).astype(np.float32)[:, None, None]
    columns, rows = center[:, :1] + offset, center[:, 1:] + offset
    close &= ((columns >= 0) & (columns < width))[:, None, :]
    close &= ((rows >= 0) & (rows < height))[:, :, None]
    found = np.flatnonzero(close)
    line, place = np.divmod(found, len(offset) ** 2)
    shift = (offset[:, None] * width + offset).ravel()
    at = (center[:, 1] * width + center[:, 0])[line] + shift[place]
    return at, np.sqrt(square_distance.ravel()[found]), line
