"""Colours for categories, and the conversion between image levels and linear light.

The first seven colours are those of Okabe and Ito, "Color Universal Design" (2008), which
colour-blind people can tell apart.

Lenses, pixels and motion mix light, not levels: a blurred edge has the shape of its blur only in
linear light. In levels it is shifted towards black by a tenth of a pixel and more.
"""

from __future__ import annotations

import colorsys
from typing import Any

import numpy as np
from numpy.typing import NDArray

Rgb = tuple[float, float, float]
Rgba = tuple[float, float, float, float]

CATEGORY_COLORS: tuple[Rgba, ...] = (
    (0.0, 0.45, 0.70, 1.0),
    (0.90, 0.62, 0.0, 1.0),
    (0.0, 0.62, 0.45, 1.0),
    (0.80, 0.47, 0.65, 1.0),
    (0.34, 0.71, 0.91, 1.0),
    (0.84, 0.37, 0.0, 1.0),
    (0.94, 0.89, 0.26, 1.0),
)
"""Colours for unordered names, the most frequent first. More hues are hard to distinguish."""


def distinct_colors(count: int) -> list[Rgb]:
    """Any number of distinct colours (red, green, blue in [0, 1])."""
    # Hues differ by the golden angle, so that each new one falls into the largest gap. Lightness
    # and saturation alternate, as few hues can be distinguished.
    tones = ((0.56, 0.60), (0.42, 0.62), (0.68, 0.55), (0.50, 0.42))
    return [
        colorsys.hls_to_rgb((0.56 + i * 0.381966) % 1.0, *tones[i % len(tones)])
        for i in range(count)
    ]


def _decode_srgb_levels() -> NDArray[np.float32]:
    """Linear light of each 8-bit level, 1 at full scale, by the curve of sRGB (IEC 61966-2-1)."""
    level = np.arange(256) / 255.0
    light = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


_LINEAR_LIGHT = _decode_srgb_levels()
"""Linear light (0 to 1) of each 8-bit level."""


def srgb_to_linear(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear light (...) [0 to 1] of levels (...), assuming sRGB encoding.

    The true encoding of cameras differs, which shifts all edges alike towards black or white;
    callers that fit edges must allow for that.
    """
    return np.asarray(_LINEAR_LIGHT.take(image))


def linear_to_srgb(light: NDArray[np.floating[Any]]) -> NDArray[np.uint8]:
    """sRGB levels (...) of linear light (...) [0 to 1]; the inverse of `srgb_to_linear`."""
    bright = 1.055 * np.maximum(light, 0.0031308) ** (1.0 / 2.4) - 0.055
    level = np.where(light <= 0.0031308, 12.92 * light, bright)
    return np.asarray(np.rint(255.0 * np.clip(level, 0.0, 1.0)), dtype=np.uint8)


def linear_levels(light: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Levels (H, W) in proportion to the light, the brightest 255, for decoding markers: in a
    photo's sRGB levels blurred edges are shifted towards black, so that small black cells get
    lost."""
    return np.asarray(
        np.rint(light * (255.0 / max(float(light.max()), 1.0 / 255.0))), dtype=np.uint8
    )
