"""What stands around the board on a page: rulers, cut lines, and words about how to print it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core.frames import Array
from burg_drake.printout.paper import BOTTOM_STRIP, Paper
from burg_drake.printout.pen import (
    BOLD,
    FAINT,
    INK,
    POINT,
    WHITE,
    Pen,
    rectangle,
    text_width,
)
from burg_drake.printout.tiling import BLEED, Tile, Tiling
from burg_drake.printout.tints import FIXED_HUE, FULL_HEIGHT, luma_at, tint

RULER = 0.100
"""Length of the rulers [m]."""
HAIR = 0.12e-3
"""Width of thin lines [m]."""
MAP_SIZE = (0.026, 0.011)
"""Room for the map of the pages [m]."""
LEGEND_WIDTH = 0.030


@dataclass(frozen=True, kw_only=True)
class Caption:
    """Words at the foot of every page.

    Attributes:
        title: the scene's name.
        lines: what the board is, and how to print it.
    """

    title: str
    lines: tuple[str, ...]


def draw_page_frame(
    pen: Pen,
    tile: Tile,
    tiling: Tiling,
    size: tuple[float, float],
    caption: Caption,
    *,
    tints: bool,
) -> None:
    """Draws what stands around the board on a page, with the page's origin lower left.

    Args:
        pen: draws in metres of the page.
        tile: the page.
        tiling: all pages.
        size: extents of the board [m].
        caption: words at the foot.
        tints: explain the tints of the height map.
    """
    paper = tiling.paper
    draw_rulers(pen, paper)
    right = paper.width - paper.margin
    base = paper.margin
    if len(tiling.tiles) > 1:
        right -= MAP_SIZE[0]
        _draw_map(pen, tile, tiling, size, (right, base))
        right -= 4e-3
    left = paper.lower[0] + RULER + 8e-3
    if tints and right - left > 0.105:
        right -= LEGEND_WIDTH
        _draw_legend(pen, right, base + 3.4e-3)
        right -= 6e-3
    _draw_caption(pen, caption, tile, len(tiling.tiles), (left, right), base)
    _draw_cuts(pen, tile, tiling)


def draw_rulers(pen: Pen, paper: Paper) -> None:
    """One along x and one along y: printers scale both differently."""
    x, y = paper.lower[0], paper.margin + BOTTOM_STRIP - 3e-3
    _draw_ruler(pen, np.array([x, y]), turned=False)
    _draw_ruler(pen, np.array([x - 3e-3, paper.lower[1]]), turned=True)


def _draw_ruler(pen: Pen, start: Array, *, turned: bool) -> None:
    """Draws a ruler from `start` [m] to the right, or turned upwards; ticks point down or, turned,
    to the left."""
    along = np.array([0.0, 1.0] if turned else [1.0, 0.0])
    aside = np.array([-1.0, 0.0] if turned else [0.0, -1.0])

    def at(length: float, off: float) -> tuple[float, float]:
        x, y = (start + length * along + off * aside).tolist()
        return x, y

    pen.line(at(0.0, 0.0), at(RULER, 0.0), width=HAIR)
    for millimetre in range(101):
        tick = 2.4e-3 if millimetre % 50 == 0 else 1.7e-3 if millimetre % 10 == 0 else 0.9e-3
        width = 2 * HAIR if millimetre in (0, 100) else HAIR
        pen.line(at(millimetre * 1e-3, 0.0), at(millimetre * 1e-3, tick), width=width)
    for millimetre in (50, 100) if turned else (0, 50, 100):
        words = f"{millimetre} mm" if millimetre == 100 else str(millimetre)
        off = 2.6e-3 if turned else 4.9e-3  # baselines are on the other side of the letters
        pen.text(*at(millimetre * 1e-3, off), words, 6, align=0.5, turned=turned)


def _draw_caption(
    pen: Pen, caption: Caption, tile: Tile, pages: int, span: tuple[float, float], base: float
) -> None:
    left, right = span
    page = f"page {tile.number} of {pages}"
    pen.text(right, base + 9.0e-3, page, 8, align=1.0)
    room = right - left - text_width(page, 8) - 3e-3
    pen.text(
        left, base + 9.0e-3, caption.title, _fitting(caption.title, room, 9.5, BOLD), font=BOLD
    )
    for k, line in enumerate(caption.lines):
        size = _fitting(line, right - left, 6.5)
        pen.text(left, base + 5.9e-3 - 2.75e-3 * k, line, size)


def _fitting(text: str, room: float, size: float, font: str = "Helvetica") -> float:
    """The size [points], at most `size`, at which a line fits into the room [m]."""
    return size * min(1.0, room / max(text_width(text, size, font), 1e-9))


def _draw_map(
    pen: Pen, tile: Tile, tiling: Tiling, size: tuple[float, float], corner: tuple[float, float]
) -> None:
    """The board with its cuts, and this page filled."""
    scale = min(MAP_SIZE[0] / size[0], MAP_SIZE[1] / size[1])
    left, bottom = corner[0] + MAP_SIZE[0] - scale * size[0], corner[1] + 0.5e-3
    xs = [0.0, *tiling.x_cuts, size[0]]
    ys = [size[1], *tiling.y_cuts, 0.0]
    for other in tiling.tiles:
        lower = (left + scale * xs[other.column], bottom + scale * ys[other.row + 1])
        upper = (left + scale * xs[other.column + 1], bottom + scale * ys[other.row])
        here = other.number == tile.number
        if here:
            pen.area([rectangle(lower, upper)], INK)
        pen.outline([rectangle(lower, upper)], HAIR, INK)
        text = min(6.0, 0.6 * (upper[1] - lower[1]) / POINT)
        middle = (lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2 - 0.35 * text * POINT
        pen.text(*middle, str(other.number), text, align=0.5, color=WHITE if here else INK)


def _draw_legend(pen: Pen, left: float, base: float) -> None:
    """What the tints tell, in grey."""
    steps = 60
    edges = left + LEGEND_WIDTH * np.arange(steps + 1) / steps
    for k in range(steps):
        luma = luma_at(FULL_HEIGHT * (k + 0.5) / steps)
        r, g, b = tint(FIXED_HUE, luma).tolist()
        end = min(edges[k + 1] + 0.1e-3, edges[-1])  # over the next one, against hairs of white
        pen.area([rectangle((edges[k], base), (end, base + 2.4e-3))], (r, g, b))
    pen.text(left, base + 3.4e-3, "height above the sheet", 6)
    for k, millimetre in enumerate((0, 50, 100)):
        words = f"{millimetre} mm" if millimetre == 100 else str(millimetre)
        pen.text(left + k * LEGEND_WIDTH / 2, base - 2.4e-3, words, 6, align=k / 2)


def _draw_cuts(pen: Pen, tile: Tile, tiling: Tiling) -> None:
    """Dashed lines: to cut along on the left and above, to glue the next page up to on the right
    and below."""
    (x0, y0), (x1, y1) = tiling.paper.lower, tiling.paper.upper
    columns = len(tiling.x_cuts) + 1
    for cut, trimmed in ((tile.cut_left, True), (tile.cut_right, False)):
        if cut is not None:
            x = tile.p_PS[0] + cut
            pen.line((x, y0), (x, y1), width=HAIR, color=FAINT, dash=1.2e-3)
            _label_cut(pen, (x, y1), trimmed, tile.number + 1, tiling.flap, turned=True)
    for cut, trimmed in ((tile.cut_top, True), (tile.cut_bottom, False)):
        if cut is not None:
            y = tile.p_PS[1] + cut
            end = x1 if tile.cut_right is None else tile.p_PS[0] + tile.cut_right - 5e-3
            pen.line((x0, y), (x1, y), width=HAIR, color=FAINT, dash=1.2e-3)
            _label_cut(pen, (end, y), trimmed, tile.number + columns, tiling.flap, turned=False)


def _label_cut(
    pen: Pen, end: tuple[float, float], trimmed: bool, neighbour: int, flap: float, *, turned: bool
) -> None:
    """Says at the end of a cut line what to do there; the line runs towards `end`."""
    x, y = end
    aside = BLEED + 1.0e-3
    words = (
        "cut" if trimmed else f"page {neighbour}" + (" is glued here" if flap else " joins here")
    )
    if turned:
        at = (x - aside, y - 1e-3) if trimmed else (x + aside + 1.6e-3, y - 1e-3)
    else:
        at = (x - 1e-3, y + aside) if trimmed else (x - 1e-3, y - aside - 1.6e-3)
    pen.text(*at, words, 5.5, align=1.0, turned=turned, color=FAINT)
