"""What stands around the board on a page: rulers, cut lines, and words about how to print it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
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
CUT_SIZE = 7.5
"""Of words at cuts [points]."""
MARK_CLEAR = 4.5e-3
"""Least distance of these words from the middle of an alignment mark, and from the board's edge
[m]."""


@dataclass(frozen=True, kw_only=True)
class Caption:
    """Words at the foot of every page.

    Attributes:
        title: the scene's name.
        board: its size and content.
        facts: which markers there are and where, for those who look into it; small.
        how: how to print, for everybody.
    """

    title: str
    board: str
    facts: str
    how: str


def draw_page_frame(
    pen: Pen,
    tile: Tile,
    tiling: Tiling,
    size: tuple[float, float],
    caption: Caption,
    *,
    marks: Array,
    tints: bool,
) -> None:
    """Draws what stands around the board on a page, with the page's origin lower left.

    Args:
        pen: draws in metres of the page.
        tile: the page.
        tiling: all pages.
        size: extents of the board [m].
        caption: words at the foot.
        marks: (N, 2) middles of alignment marks in the scene frame [m], which words keep clear of.
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
    above = paper.lower[1] + RULER + 8e-3
    if tints and above + LEGEND_WIDTH < paper.upper[1]:
        _draw_legend(pen, (paper.lower[0] - 2.1e-3, above), turned=True)
    elif tints and right - left > 0.105:
        right -= LEGEND_WIDTH
        _draw_legend(pen, (right, base + 5.8e-3), turned=False)
        right -= 6e-3
    _draw_caption(pen, caption, tile, len(tiling.tiles), (left, right), base)
    _draw_cuts(pen, tile, tiling, size, marks)


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
        off = 2.6e-3 if turned else 4.3e-3  # baselines are on the other side of the letters
        pen.text(*at(millimetre * 1e-3, off), words, 6, align=0.5, turned=turned)


def _draw_caption(
    pen: Pen, caption: Caption, tile: Tile, pages: int, span: tuple[float, float], base: float
) -> None:
    left, right = span
    page = f"page {tile.number} of {pages}"
    pen.text(right, base + 10.0e-3, page, 10, align=1.0)
    room = right - left - text_width(page, 10) - 3e-3
    pen.text(
        left, base + 10.0e-3, caption.title, _fitting(caption.title, room, 10, BOLD), font=BOLD
    )
    pen.text(left, base + 6.8e-3, caption.board, _fitting(caption.board, right - left, 6.5))
    start = left - RULER - 8e-3  # below the ruler, too
    pen.text(start, base + 4.2e-3, caption.facts, _fitting(caption.facts, right - start, 6.5))
    pen.text(start, base + 0.75e-3, caption.how, _fitting(caption.how, right - start, 10))


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


def _draw_legend(pen: Pen, start: tuple[float, float], *, turned: bool) -> None:
    """What the tints tell, in grey: from `start` [m] to the right, or turned upwards."""
    along = np.array([0.0, 1.0] if turned else [1.0, 0.0])
    up = np.array([-1.0, 0.0] if turned else [0.0, 1.0])

    def at(length: float, off: float) -> tuple[float, float]:
        x, y = (start + length * along + off * up).tolist()
        return x, y

    steps = 60
    edges = LEGEND_WIDTH * np.arange(steps + 1) / steps
    for k in range(steps):
        luma = luma_at(FULL_HEIGHT * (k + 0.5) / steps)
        r, g, b = tint(FIXED_HUE, luma).tolist()
        end = min(edges[k + 1] + 0.1e-3, edges[-1])  # over the next one, against hairs of white
        corners = at(edges[k], 0.0), at(end, 0.0), at(end, 2.0e-3), at(edges[k], 2.0e-3)
        pen.area([np.array(corners)], (r, g, b))
    pen.text(*at(0.0, 2.8e-3), "height above the sheet", 6, turned=turned)
    for k, millimetre in enumerate((0, 50, 100)):
        words = f"{millimetre} mm" if millimetre == 100 else str(millimetre)
        pen.text(*at(k * LEGEND_WIDTH / 2, -2.0e-3), words, 6, align=k / 2, turned=turned)


def _draw_cuts(
    pen: Pen, tile: Tile, tiling: Tiling, size: tuple[float, float], marks: Array
) -> None:
    """Dashed lines: to cut along on the left and above, to glue the next page up to on the right
    and below."""
    (x0, y0), (x1, y1) = tiling.paper.lower, tiling.paper.upper
    columns = len(tiling.x_cuts) + 1
    for cut, trimmed in ((tile.cut_left, True), (tile.cut_right, False)):
        if cut is not None:
            x = tile.p_PS[0] + cut
            pen.line((x, y0), (x, y1), width=HAIR, color=FAINT, dash=1.2e-3)
            crossed = tile.p_PS[1] + np.array([0.0, size[1], *_on_cut(marks, 0, cut)])
            words = _cut_words(trimmed, tile.number + 1, tiling.flap)
            _label_cut(pen, (x, y1), words, trimmed, crossed, turned=True)
    for cut, trimmed in ((tile.cut_top, True), (tile.cut_bottom, False)):
        if cut is not None:
            y = tile.p_PS[1] + cut
            pen.line((x0, y), (x1, y), width=HAIR, color=FAINT, dash=1.2e-3)
            crossed = tile.p_PS[0] + np.array([0.0, size[0], *_on_cut(marks, 1, cut)])
            words = _cut_words(trimmed, tile.number + columns, tiling.flap)
            _label_cut(pen, (x1, y), words, trimmed, crossed, turned=False)


def _on_cut(marks: Array, axis: int, cut: float) -> list[float]:
    """Where on a cut across `axis` alignment marks lie."""
    here = np.abs(marks[:, axis] - cut) < 1e-5
    return [float(p) for p in marks[here, 1 - axis]]


def _cut_words(trimmed: bool, neighbour: int, flap: float) -> str:
    if trimmed:
        return "CUT"
    return f"page {neighbour} " + ("is glued here" if flap else "joins here")


def _label_cut(
    pen: Pen,
    end: tuple[float, float],
    words: str,
    trimmed: bool,
    crossed: Array,
    *,
    turned: bool,
) -> None:
    """Says at the end of a cut line what to do there.

    Args:
        pen: draws in metres of the page.
        end: the line runs towards it [m].
        words: to write.
        trimmed: words stand on the side that is cut off, or else on the strip that stays.
        crossed: (N,) where along the line something is that words keep clear of [m].
        turned: the line runs upwards.
    """
    length = text_width(words, CUT_SIZE, BOLD)
    along = end[1 if turned else 0] - 1e-3
    for there in np.sort(crossed)[::-1]:
        if along - length - MARK_CLEAR < there < along + MARK_CLEAR:
            along = there - MARK_CLEAR
    off = BLEED + 1.0e-3 if trimmed else -(BLEED + 1.0e-3 + 0.72 * CUT_SIZE * POINT)
    at = (end[0] - off, along) if turned else (along, end[1] + off)
    pen.text(*at, words, CUT_SIZE, font=BOLD, align=1.0, turned=turned)
