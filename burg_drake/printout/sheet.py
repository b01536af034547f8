"""Draws a board: tints and outlines of its objects, markers, names, alignment marks.

All in the scene frame, so that pages that show parts of it fit together when they are assembled.
Markers come last, each in a white frame: tints stay below their black cells, and clear of the edges
that detectors look for.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array
from burg_drake.core.terminal import Rgb
from burg_drake.printout.board_edge import ORIGIN
from burg_drake.printout.drawings import Arrow, Drawing
from burg_drake.printout.labels import STEP, FreeSpace
from burg_drake.printout.outlines import cell_outlines
from burg_drake.printout.pen import (
    BLACK,
    BOLD,
    FAINT,
    POINT,
    WHITE,
    Pen,
    rectangle,
    text_width,
)
from burg_drake.printout.tiling import BLEED, Tiling
from burg_drake.scene.document import MarkerLayout

FRAME = 3e-3
"""Width of a marker's white frame [m], where the gap between markers is wide enough."""
FRAME_SHARE = 0.2
"""Most of a gap that one frame takes, so that objects are seen between markers."""
SEAM = 0.8e-3
"""Width of the white lines between the frames of neighbours [m]. Without them a detector took the
outer edge of a frame of 2 mm, with tint all around, for the edge of the marker."""
NAME_SIZE = 8.5
"""Of names of objects [points]."""
NAME_CLEAR = 1e-3
"""Least distance of a name from objects [m]; from markers it is at least the width of a frame."""
LEAST_PART = 0.5e-4
"""Of an object on another page that has its name, too [m^2]."""
OUTLINE_WIDTH, FOOTPRINT_WIDTH = 0.2e-3, 0.4e-3
RAISED_DASH = 0.8e-3
"""Of outlines of what lies above other objects [m]."""
EDGE_CLEAR = 1.0e-3
"""Distance of the objects' lines from the edges of markers [m], where gaps and cells are wide
enough."""
HATCHING = 3e-3
"""Distance between the white lines over fixed objects [m]."""
ALARM: Rgb = (0.80, 0.10, 0.10)
"""Of what is out of bounds."""
MARK_RADIUS = 2e-3
"""Of alignment marks [m]."""


@dataclass(frozen=True)
class Name:
    """Words on the board.

    Attributes:
        words: what they say.
        position: where their baseline begins [m].
        color: of the words.
    """

    words: str
    position: tuple[float, float]
    color: Rgb


@dataclass(frozen=True, eq=False)
class Sheet:
    """Everything on a board.

    Attributes:
        size: extents [m].
        layout: the markers.
        drawings: the objects.
        arrows: to what is out of bounds.
        marks: (N, 2) middles of alignment marks, on the cuts [m].
        names: words beside objects and arrows.
    """

    size: tuple[float, float]
    layout: MarkerLayout
    drawings: list[Drawing]
    arrows: list[Arrow]
    marks: Array
    names: tuple[Name, ...] = ()


def alignment_marks(layout: MarkerLayout, tiling: Tiling) -> Array:
    """(N, 2) points on the cuts, midway between markers, where pages have to meet [m]."""
    marks: list[tuple[float, float]] = []
    middles = []
    for axis in (0, 1):
        low = np.unique(np.round(layout.p_SQ[:, :, axis].min(axis=1), 9))
        high = low + layout.side
        half = (low[1] - high[0]) / 2 if len(low) > 1 else 5e-3
        middles.append([low[0] - half, *((high[:-1] + low[1:]) / 2), high[-1] + half])
    for x in tiling.x_cuts:
        marks += [(x, y) for y in (*middles[1], *tiling.y_cuts)]
    for y in tiling.y_cuts:
        marks += [(x, y) for x in middles[0]]
    return np.unique(np.round(np.array(marks).reshape(-1, 2), 6), axis=0)


def place_names(sheet: Sheet, tiling: Tiling) -> tuple[Sheet, list[str]]:
    """Finds places for the names of objects and arrows: on paper, on no marker, on no object, and
    on every page that shows a part of an object.

    Returns:
        The sheet with names, and those words for which there was no room, quoted, with the page.
    """
    space, masks = FreeSpace(sheet.size), {}
    first, last = tiling.tiles[0], tiling.tiles[-1]
    on_paper = (first.lower[0], last.lower[1]), (last.upper[0], first.upper[1])
    inner = np.array([[0.0, 0.0], sheet.size]) + 2 * NAME_CLEAR * np.array([[1.0], [-1.0]])
    space.take_beyond(np.maximum(on_paper[0], inner[0]), np.minimum(on_paper[1], inner[1]))
    space.take((0.0, 0.0), (ORIGIN, ORIGIN))
    clear = max(NAME_CLEAR, frame_width(sheet.layout))
    for corners in sheet.layout.p_SQ[:, :, :2]:
        space.take(corners.min(axis=0), corners.max(axis=0), clear)
    for x in tiling.x_cuts:
        space.take((x - BLEED, 0.0), (x + tiling.flap, sheet.size[1]), NAME_CLEAR)
    for y in tiling.y_cuts:
        space.take((0.0, y - tiling.flap), (sheet.size[0], y + BLEED), NAME_CLEAR)
    for mark in sheet.marks:
        space.take(mark, mark, MARK_RADIUS + NAME_CLEAR)
    for drawing in sheet.drawings:
        masks[drawing.name] = space.take_layer(drawing.layer, NAME_CLEAR)
    beyond = {arrow.name for arrow in sheet.arrows}
    wanted = [
        (d.words, d.footprint_color, masks[d.name]) for d in sheet.drawings if d.name not in beyond
    ]
    for arrow in sheet.arrows:
        box = np.sort(np.array([arrow.start, arrow.tip]), axis=0)
        space.take(box[0], box[1], 2 * NAME_CLEAR)
        wanted.append((arrow.words, ALARM, masks.get(arrow.name, space.cell(arrow.start))))
    names: list[Name] = []
    homeless: list[str] = []
    for words, color, beside in wanted:
        extent = text_width(words, NAME_SIZE, BOLD) + 2 * NAME_CLEAR, NAME_SIZE * POINT
        corner = space.place(extent, beside)
        if corner is None:
            homeless.append(repr(words))
            continue
        # a line's letters reach a fifth of its height below the baseline
        shift = np.array([NAME_CLEAR, 0.22 * extent[1]])
        corners = [corner]
        for tile in tiling.tiles if len(tiling.tiles) > 1 else ():
            page = space.within(*tile.core)
            part = beside & page
            if part.sum() * STEP**2 < LEAST_PART or page[_cell_at(space, corner)]:
                continue
            again = space.place(extent, part, page)
            if again is None:
                homeless.append(f"{words!r} on page {tile.number}")
            else:
                corners.append(again)
        for at in corners:
            x, y = (at + shift).tolist()
            names.append(Name(words, (x, y), color))
    return dataclasses.replace(sheet, names=tuple(names)), homeless


def _cell_at(space: FreeSpace, point: Array) -> tuple[int, int]:
    """Row and column of the cell at a point."""
    column, row = np.rint(space.grid.pixels(point + STEP)).astype(int)
    return int(row), int(column)


def draw_sheet(pen: Pen, sheet: Sheet) -> None:
    """Draws all of a board."""
    for drawing in sheet.drawings:
        _draw_tints(pen, drawing)
    for arrow in sheet.arrows:
        _draw_arrow(pen, arrow)
    _draw_markers(pen, sheet.layout)
    _draw_outlines(pen, sheet)
    for x, y in sheet.marks.tolist():
        pen.circle(x, y, MARK_RADIUS, FAINT, 0.12e-3)
        reach = 1.6 * MARK_RADIUS
        pen.line((x - reach, y), (x + reach, y), width=0.12e-3, color=FAINT)
        pen.line((x, y - reach), (x, y + reach), width=0.12e-3, color=FAINT)
    for name in sheet.names:
        pen.text(*name.position, name.words, NAME_SIZE, font=BOLD, color=name.color)


def _draw_tints(pen: Pen, drawing: Drawing) -> None:
    for color, area in drawing.bands:
        pen.area(area, color)
    if drawing.fixed and drawing.outline:
        corners = np.concatenate(drawing.outline)
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        high = upper[1] - lower[1]
        pen.canvas.saveState()
        pen.clip(drawing.outline)
        for x in np.arange(lower[0] - high, upper[0], HATCHING).tolist():
            pen.line((x, lower[1]), (x + high, upper[1]), width=0.6e-3, color=WHITE)
        pen.canvas.restoreState()


def _draw_arrow(pen: Pen, arrow: Arrow) -> None:
    start, tip = np.array(arrow.start), np.array(arrow.tip)
    along = (tip - start) / np.linalg.norm(tip - start)
    across = np.array([-along[1], along[0]])
    neck = tip - 4e-3 * along
    pen.line(arrow.start, (neck[0], neck[1]), width=0.8e-3, color=ALARM)
    pen.area([np.array([tip, neck + 2e-3 * across, neck - 2e-3 * across])], ALARM)


def _draw_markers(pen: Pen, layout: MarkerLayout) -> None:
    """White frames, then all black cells as one shape.

    White lines lead from the corners of a frame outwards: a tint all around it would else have a
    square edge, which a detector can take for that of the marker.
    """
    gap, frame = _gap(layout), frame_width(layout)
    frames = []
    for corners in layout.p_SQ[:, :, :2]:
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        frames += [rectangle(lower - frame, upper + frame), rectangle(lower, upper)]
        outer = rectangle(lower - 0.9 * frame, upper + 0.9 * frame)
        meeting = rectangle(lower - gap / 2, upper + gap / 2)
        for start, end in zip(outer.tolist(), meeting.tolist(), strict=True):
            pen.line(start, end, width=SEAM, color=WHITE)
    pen.area(frames, WHITE)
    pen.area(_black_cells(layout), BLACK, holes=False)


def _draw_outlines(pen: Pen, sheet: Sheet) -> None:
    """The objects' lines across everything, dark on white and light on black cells, but along the
    edges of markers, which detectors follow all around."""
    layout = sheet.layout
    corners = layout.p_SQ[:, :, :2]
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    board = rectangle((0.0, 0.0), sheet.size)
    cells = _black_cells(layout)
    clear = min(EDGE_CLEAR, 0.4 * _gap(layout), 0.5 * layout.side / layout.cells)
    outer = [rectangle(*c) for c in zip(lower - clear, upper + clear, strict=True)]
    inner = [rectangle(*c) for c in zip(lower + clear, upper - clear, strict=True)]
    for on_black in (False, True):
        pen.canvas.saveState()
        pen.clip([board, *outer, *inner])
        pen.clip(cells if on_black else [board, *cells])
        for d in sheet.drawings:
            color = d.on_black if on_black else d.outline_color
            pen.outline(d.outline, OUTLINE_WIDTH, color, d.dash)
            dark = d.on_black if on_black else d.footprint_color
            pen.outline(d.raised, OUTLINE_WIDTH, dark, RAISED_DASH)
            pen.outline(d.footprint, FOOTPRINT_WIDTH, dark)
        pen.canvas.restoreState()


def _black_cells(layout: MarkerLayout) -> list[Array]:
    """Outlines of the black cells of all markers (N, 2) [m]; holes run the other way round."""
    flip = np.array([1.0, -1.0]) * layout.side / layout.cells
    return [
        corners[0] + loop * flip
        for corners, black in zip(layout.p_SQ[:, :, :2], layout.black, strict=True)
        for loop in cell_outlines(black)
    ]


def frame_width(layout: MarkerLayout) -> float:
    """Width of the white frames around the markers, which tints keep clear of [m]."""
    return min(FRAME, FRAME_SHARE * _gap(layout))


def _gap(layout: MarkerLayout) -> float:
    """Least distance between neighbouring markers [m]."""
    starts = [np.unique(np.round(layout.p_SQ[:, 0, axis], 9)) for axis in (0, 1)]
    pitches = [float(np.diff(s).min()) for s in starts if len(s) > 1]
    return min(pitches, default=2 * layout.side) - layout.side
