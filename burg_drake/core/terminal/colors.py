"""Colours for things that are told apart by colour alone.

The first seven are those of Okabe and Ito, "Color Universal Design" (2008), which stay apart for
colour-blind eyes.
"""

from __future__ import annotations

import colorsys

Rgb = tuple[float, float, float]
Rgba = tuple[float, float, float, float]

CATEGORIES: tuple[Rgba, ...] = (
    (0.0, 0.45, 0.70, 1.0),
    (0.90, 0.62, 0.0, 1.0),
    (0.0, 0.62, 0.45, 1.0),
    (0.80, 0.47, 0.65, 1.0),
    (0.34, 0.71, 0.91, 1.0),
    (0.84, 0.37, 0.0, 1.0),
    (0.94, 0.89, 0.26, 1.0),
)
"""For names without an order, the most frequent first; there are no more hues that stay apart."""

GOLDEN_TURN = 0.381966
"""Golden angle as a share of a turn: further hues fall into the largest gaps between the others."""
FIRST_HUE = 0.56
TONES = ((0.56, 0.60), (0.42, 0.62), (0.68, 0.55), (0.50, 0.42))
"""Lightness and saturation of colours in turn, as there are few hues that eyes tell apart."""


def distinct_colors(count: int) -> list[Rgb]:
    """Any number of colours (red, green, blue in [0, 1]), all different."""
    return [
        colorsys.hls_to_rgb((FIRST_HUE + i * GOLDEN_TURN) % 1.0, *TONES[i % len(TONES)])
        for i in range(count)
    ]
