"""Colours of the height map: an object's own hue, and a brightness that tells the height alone.

Brightness is luma as cameras and OpenCV compute grey (ITU-R BT.601), so that a print in grey and a
camera's picture tell the same heights whatever the hue.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array
from burg_drake.core.terminal import Rgb

LUMA = np.array([0.299, 0.587, 0.114])
"""Weights of red, green and blue (ITU-R BT.601)."""
DARKEST = 0.70
"""Luma where an object touches the sheet. Black cells are 0: a detector still finds the middle
between black and white far from any tint."""
LIGHTEST = 0.94
"""Luma from `FULL_HEIGHT` on; paper is 1."""
FULL_HEIGHT = 0.10
"""Height [m] above which tints no longer change."""

HUES = (
    (0.14, 0.49, 0.70),
    (0.50, 0.25, 0.00),
    (0.35, 0.70, 0.00),
    (0.85, 0.34, 0.47),
    (0.25, 0.17, 0.85),
    (0.44, 0.50, 0.00),
    (0.00, 0.85, 0.74),
    (0.32, 0.85, 0.00),
)
"""Of free objects in turn. At the same luma any two differ by 11 in CIELAB or more (Euclidean, at a
luma of 0.75), also as seen without red, green or blue cones; found by search."""
FIXED_HUE = (0.35, 0.35, 0.35)
"""Of fixed objects."""


def hue(index: int) -> Rgb:
    """Hue of the free object with this number."""
    return HUES[index % len(HUES)]


def luma_at(height: ArrayLike) -> Array:
    """Luma at heights [m] above the sheet: dark on it, and steepest there, as a person sees best
    what is near to the paper."""
    share = np.clip(np.asarray(height, dtype=float) / FULL_HEIGHT, 0.0, 1.0)
    return DARKEST + (LIGHTEST - DARKEST) * np.sqrt(share)


def height_at(luma: ArrayLike) -> Array:
    """Height [m] that has a luma; the inverse of `luma_at`."""
    share = (np.asarray(luma, dtype=float) - DARKEST) / (LIGHTEST - DARKEST)
    return FULL_HEIGHT * share**2


def tint(hue: Rgb, luma: ArrayLike) -> Array:
    """(..., 3) colours of a hue, red, green, blue in [0, 1], that have exactly these lumas (...).

    A hue is mixed with white where it has to be brighter, and with black where darker.
    """
    color, goal = np.asarray(hue), np.asarray(luma, dtype=float)[..., None]
    own = color @ LUMA
    lighter = 1.0 - (1.0 - color) * (1.0 - goal) / (1.0 - own)
    tinted: Array = np.where(goal >= own, lighter, color * goal / own)
    return tinted
