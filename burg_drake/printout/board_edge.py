"""The board's own edge on a page, and the scene's origin in its corner."""

from __future__ import annotations

import numpy as np

from burg_drake.printout.pen import FAINT, INK, POINT, Pen, rectangle, text_width
from burg_drake.printout.tiling import Tile

WORDS, WORDS_SIZE = "edge of the board", 6.5
"""What is written along the edge; size in points."""
CAPITAL = 0.72 * WORDS_SIZE * POINT
"""Height of its letters [m]."""
OFF = 1.0e-3
"""Distance of the words from the edge [m]."""
OUTSIDE = OFF + CAPITAL + 1.0e-3
"""What they need on its outer side [m]; else they are on the inner one."""
ORIGIN = 14e-3
"""Side of the corner that the origin's axes and words take [m]."""
AXIS = 10e-3
"""Length of the axes [m]."""


def draw_edge(pen: Pen, tile: Tile, size: tuple[float, float]) -> None:
    """Draws the board's edge as far as it is on a page, and says what it is.

    Args:
        pen: draws in the scene frame.
        tile: of the page.
        size: extents of the board [m].
    """
    pen.outline([rectangle((0.0, 0.0), size)], 0.2e-3, FAINT)
    for axis in (0, 1):  # that runs across the edge
        along = 1 - axis
        start = max(tile.lower[along], 0.0) + ORIGIN + 4e-3
        end = min(tile.upper[along], size[along])
        if end - start < text_width(WORDS, WORDS_SIZE):
            continue
        for edge, outward, room in (
            (0.0, -1.0, -tile.lower[axis]),
            (size[axis], 1.0, tile.upper[axis] - size[axis]),
        ):
            if not tile.lower[axis] + 1e-3 < edge < tile.upper[axis] - 1e-3:
                continue
            side = outward if room >= OUTSIDE else -outward
            # a baseline is below its letters; of words that read upwards it is on their right
            above = 1.0 if axis == 1 else -1.0
            base = edge + side * (OFF if side == above else OFF + CAPITAL)
            at = (base, start) if axis == 0 else (start, base)
            pen.text(*at, WORDS, WORDS_SIZE, turned=axis == 0)


def draw_origin(pen: Pen, tile: Tile, clear: float) -> bool:
    """Draws the scene frame's axes in the board's corner if that is on a page.

    Args:
        pen: draws in the scene frame.
        tile: of the page.
        clear: distance of the markers from the corner, along x or y, whichever is more [m].

    Returns:
        Whether it was drawn: the corner may be in the margin, or too close to a marker.
    """
    if max(tile.lower) > 0.0 or min(tile.upper) < ORIGIN or clear < ORIGIN:
        return False
    for axis in (0, 1):
        along = np.eye(2)[axis]
        across = np.eye(2)[1 - axis]
        tip, neck = AXIS * along, (AXIS - 2.5e-3) * along
        pen.line((0.0, 0.0), (float(neck[0]), float(neck[1])), width=0.4e-3)
        pen.area([np.array([tip, neck + 0.9e-3 * across, neck - 0.9e-3 * across])], INK)
    pen.text(AXIS + 0.8e-3, 0.6e-3, "x", 8)
    pen.text(0.8e-3, AXIS + 0.6e-3, "y", 8)
    pen.text(1.5e-3, 1.7e-3, "origin", WORDS_SIZE)
    return True
