"""Numbers as colours: one map, the same for people who see colours differently and in grey print.

The map is viridis by Stefan van der Walt and Nathaniel Smith (2015, CC0, as matplotlib has it): its
lightness rises evenly, and it runs along blue to yellow, which all common kinds of colour blindness
leave apart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from burg_drake.core import Array

CONTROL_POINTS = (
    *("#440154", "#481a6c", "#472f7d", "#414487", "#39568c", "#31688e", "#2a788e", "#23888e"),
    *("#1f988b", "#22a884", "#35b779", "#54c568", "#7ad151", "#a5db36", "#d2e21b", "#fde725"),
)
"""Entries 0, 17, 34, ... 255 of viridis (sRGB); linear between them it is met within 0.03."""


def map_colors(share: ArrayLike) -> Array:
    """Colours of numbers.

    Args:
        share: (...,) 0 for the lowest and 1 for the highest colour; what is beyond is cut.

    Returns:
        (..., 3) red, green, blue in [0, 1] (sRGB).
    """
    points = np.array([_rgb(color) for color in CONTROL_POINTS])
    place = np.clip(np.asarray(share, dtype=float), 0.0, 1.0) * (len(points) - 1)
    return np.stack(
        [np.interp(place, np.arange(len(points)), points[:, k]) for k in range(3)], axis=-1
    )


def hex_color(rgb: ArrayLike) -> str:
    """A colour (3,) as HTML has it."""
    return "#" + "".join(f"{round(255.0 * float(c)):02x}" for c in np.asarray(rgb))


def linear_light(color: ArrayLike) -> Array:
    """Linear light of sRGB values (...) in [0, 1] (IEC 61966-2-1)."""
    c = np.asarray(color, dtype=float)
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def contrast(one: str, other: str) -> float:
    """Contrast of two colours as HTML has them, 1 to 21 (WCAG 2: text needs 4.5)."""
    dark, light = sorted(
        float(linear_light(_rgb(color)) @ (0.2126, 0.7152, 0.0722)) for color in (one, other)
    )
    return (light + 0.05) / (dark + 0.05)


def _rgb(color: str) -> tuple[float, float, float]:
    r, g, b = (int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return r, g, b
