"""The light that made the levels of an image.

Lenses, pixels and motion mix light, not levels: an edge that is blurred has the shape that the
blur gives it only in linear light. In levels it is moved towards black, by a tenth of a pixel and
more.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def _decoded() -> NDArray[np.float32]:
    """Linear light of each 8-bit level, 1 at full scale, by the curve of sRGB (IEC 61966-2-1)."""
    level = np.arange(256) / 255.0
    light = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


LIGHT = _decoded()
"""Linear light [0 to 1] of each 8-bit level."""


def photo_light(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(...) linear light [0 to 1] of levels (...), as if their camera encoded them as sRGB.

    That cameras encode otherwise moves all edges alike towards black or white, which whoever fits
    edges must allow for.
    """
    return np.asarray(LIGHT.take(image))


def levels_of_light(light: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """(...) levels of linear light (...) [0 to 1] in sRGB, the inverse of `photo_light`."""
    bright = 1.055 * np.maximum(light, 0.0031308) ** (1.0 / 2.4) - 0.055
    level = np.where(light <= 0.0031308, 12.92 * light, bright)
    return np.asarray(np.rint(255.0 * np.clip(level, 0.0, 1.0)), dtype=np.uint8)


def even_levels(light: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(H, W) levels that rise with the light, the brightest 255, for what reads the cells of
    markers: in the levels of a photo a blurred edge is moved towards black, so that small black
    cells get lost."""
    return np.asarray(
        np.rint(light * (255.0 / max(float(light.max()), 1.0 / 255.0))), dtype=np.uint8
    )
