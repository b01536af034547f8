"""Flat text as triangles: works live and in saved pages, without fonts or textures."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

FONT = cv2.FONT_HERSHEY_DUPLEX
FONT_SCALE = 1.6
STROKE = 2
MARGIN = 8
"""How the raster is drawn that a line of text is made from; the last two in pixels."""


def text_triangles(text: str, height: float) -> tuple[Array, NDArray[np.int32]]:
    """Text in the plane z = 0, reading along +x, with the baseline's middle at the origin.

    Args:
        text: one line; characters outside ASCII become question marks.
        height: of a capital letter [m].

    Returns:
        Vertices (3, N) [m] and triangles (3, M), seen from +z.
    """
    capital = np.flatnonzero(_raster("H").any(axis=1))
    baseline, pixel = capital[-1] + 1, height / len(capital)
    image = _raster(text)
    rows, starts, ends = _runs(image)
    x0, x1 = (pixel * (edge - image.shape[1] / 2) for edge in (starts, ends))
    y1 = pixel * (baseline - rows)
    y0 = y1 - pixel
    corners = np.stack([np.stack(c) for c in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))], axis=-1)
    vertices = np.zeros((3, corners.shape[1] * 4))
    vertices[:2] = corners.reshape(2, -1)
    first = 4 * np.arange(corners.shape[1], dtype=np.int32)
    faces = np.stack([[first, first + 1, first + 2], [first, first + 2, first + 3]], axis=-1)
    return vertices, faces.reshape(3, -1)


def _raster(text: str) -> NDArray[np.bool_]:
    """The ink of a line of text; the baseline is in the same row whatever the text."""
    (width, _), _ = cv2.getTextSize(text, FONT, FONT_SCALE, STROKE)
    (_, ascent), descent = cv2.getTextSize("Hgy", FONT, FONT_SCALE, STROKE)
    image = np.zeros((ascent + descent + 2 * MARGIN, width + 2 * MARGIN), dtype=np.uint8)
    cv2.putText(image, text, (MARGIN, MARGIN + ascent), FONT, FONT_SCALE, 255, STROKE)
    return image > 127


def _runs(image: NDArray[np.bool_]) -> tuple[NDArray[np.int64], ...]:
    """Row, first column and end column of each horizontal run of set pixels."""
    padded = np.zeros((image.shape[0], image.shape[1] + 2), dtype=np.int8)
    padded[:, 1:-1] = image
    change = np.diff(padded, axis=1)
    rows, starts = np.nonzero(change == 1)
    _, ends = np.nonzero(change == -1)
    return rows, starts, ends
