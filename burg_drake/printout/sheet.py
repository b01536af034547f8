"""The sheet as PDF: objects, markers, names, alignment marks, edge and origin of the board."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.pdfgen.canvas import FILL_EVEN_ODD, FILL_NON_ZERO, Canvas

from burg_drake.core import Array, Rgb
from burg_drake.printout.object_drawings import (
    ObjectDrawing,
    OutOfBoundsArrow,
    SheetGrid,
    SheetLayer,
    cell_outlines,
)
from burg_drake.printout.page_tiling import BLEED, Tile, Tiling
from burg_drake.scene import MarkerLayout

METRES_PER_POINT = 0.0254 / 72
"""Metres per point, the unit of PDF."""
BLACK_RGB: Rgb = (0.0, 0.0, 0.0)
TEXT_RGB: Rgb = (0.16, 0.18, 0.22)
"""Colour of text and rulers."""
FAINT_LINE_RGB: Rgb = (0.52, 0.55, 0.60)
"""Colour of inconspicuous lines."""
WHITE_RGB: Rgb = (1.0, 1.0, 1.0)
REGULAR_FONT, BOLD_FONT = "Helvetica", "Helvetica-Bold"


def to_printable(text: str) -> str:
    """A text with `?` for characters that a PDF's built-in fonts lack."""
    return text.encode("cp1252", "replace").decode("cp1252")


def text_width(text: str, size: float, font: str = REGULAR_FONT) -> float:
    """Length of a line of text [m]; `size` in points."""
    return float(stringWidth(to_printable(text), font, size) * METRES_PER_POINT)


class Pen:
    """Draws on a canvas with lengths and line widths in metres, text sizes in points."""

    def __init__(self, canvas: Canvas) -> None:
        self.canvas = canvas

    def line(
        self,
        *points: Sequence[float] | Array,
        width: float = 0.15e-3,
        color: Rgb = TEXT_RGB,
        dash: float = 0.0,
    ) -> None:
        """Draws a line through points."""
        self._stroke(width, color, dash)
        self.canvas.drawPath(self._path([np.array(points)], closed=False), stroke=1, fill=0)

    def outline(
        self, polygons: Sequence[Array], width: float, color: Rgb, dash: float = 0.0
    ) -> None:
        """Draws the outlines of areas."""
        if polygons:
            self._stroke(width, color, dash)
            self.canvas.drawPath(self._path(polygons), stroke=1, fill=0)

    def area(self, polygons: Sequence[Array], color: Rgb, *, holes: bool = True) -> None:
        """Fills areas, all as one shape.

        Args:
            polygons: corners (N, 2) of each polygon [m].
            color: colour of the area.
            holes: polygons inside others are holes; otherwise polygons in the opposite direction
                are holes.
        """
        if polygons:
            self.canvas.setFillColorRGB(*color)
            rule = FILL_EVEN_ODD if holes else FILL_NON_ZERO
            self.canvas.drawPath(self._path(polygons), stroke=0, fill=1, fillMode=rule)

    def clip(self, polygons: Sequence[Array]) -> None:
        """Clips drawing to areas until the canvas' state is restored."""
        path = self._path(polygons)
        self.canvas.clipPath(path, stroke=0, fill=0, fillMode=FILL_EVEN_ODD)

    def circle(self, x: float, y: float, radius: float, color: Rgb, width: float) -> None:
        """Draws a circle."""
        self._stroke(width, color)
        self.canvas.circle(
            x / METRES_PER_POINT, y / METRES_PER_POINT, radius / METRES_PER_POINT, stroke=1, fill=0
        )

    def text(
        self,
        x: float,
        y: float,
        text: str,
        size: float,
        *,
        font: str = REGULAR_FONT,
        color: Rgb = TEXT_RGB,
        align: float = 0.0,
        turned: bool = False,
    ) -> None:
        """Writes a line of text.

        Args:
            x, y: start of the baseline [m]; its middle with `align` 0.5, its end with 1.
            text: the line.
            size: text size [points].
            font: one of a PDF's built-in fonts.
            color: colour of the text.
            align: share of the line's length before x.
            turned: the text reads upwards.
        """
        canvas = self.canvas
        canvas.saveState()
        canvas.translate(x / METRES_PER_POINT, y / METRES_PER_POINT)
        if turned:
            canvas.rotate(90)
        canvas.setFillColorRGB(*color)
        canvas.setFont(font, size)
        shown = text if font == "ZapfDingbats" else to_printable(text)
        canvas.drawString(-align * stringWidth(shown, font, size), 0.0, shown)
        canvas.restoreState()

    def _stroke(self, width: float, color: Rgb, dash: float = 0.0) -> None:
        self.canvas.setStrokeColorRGB(*color)
        self.canvas.setLineWidth(width / METRES_PER_POINT)
        self.canvas.setLineJoin(1)
        self.canvas.setDash([dash / METRES_PER_POINT, dash / METRES_PER_POINT] if dash else [])

    def _path(self, polygons: Iterable[Array], *, closed: bool = True) -> Any:
        path = self.canvas.beginPath()
        for polygon in polygons:
            points = (np.asarray(polygon, dtype=float) / METRES_PER_POINT).tolist()
            path.moveTo(*points[0])
            for point in points[1:]:
                path.lineTo(*point)
            if closed:
                path.close()
        return path


def rectangle(lower: Sequence[float] | Array, upper: Sequence[float] | Array) -> Array:
    """(4, 2) corners of a rectangle, counter-clockwise from the lower left."""
    (x0, y0), (x1, y1) = lower, upper
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def draw_arrow(
    pen: Pen,
    start: tuple[float, float],
    tip: tuple[float, float],
    color: Rgb,
    *,
    head: float,
    width: float,
) -> None:
    """Draws a straight arrow with a head of length and width `head` [m]."""
    begin, end = np.array(start), np.array(tip)
    along = (end - begin) / np.linalg.norm(end - begin)
    across = np.array([-along[1], along[0]])
    neck = end - head * along
    pen.line(start, neck, width=width, color=color)
    pen.area([np.array([end, neck + head / 2 * across, neck - head / 2 * across])], color)


EDGE_LABEL_SIZE = 6.5  # Points.
EDGE_LABEL_HEIGHT = 0.72 * EDGE_LABEL_SIZE * METRES_PER_POINT
"""Metres, of a capital letter."""
EDGE_LABEL_OFFSET = 1.0e-3
"""Metres between the label and the edge."""
ORIGIN_CORNER_SIZE = 14e-3
"""Metres, side of the corner with the axes and label of the origin."""


def draw_board_edge(pen: Pen, tile: Tile, size: tuple[float, float]) -> None:
    """Draws the board's edge, with a label, as far as it is on a page.

    Args:
        pen: draws in the scene frame.
        tile: part of the board on the page.
        size: extents of the board [m].
    """
    label = "edge of the board"  # Text along the edge.
    # Metres needed outside the edge; otherwise the label is inside.
    label_room = EDGE_LABEL_OFFSET + EDGE_LABEL_HEIGHT + 1.0e-3
    pen.outline([rectangle((0.0, 0.0), size)], 0.2e-3, FAINT_LINE_RGB)
    for axis in (0, 1):  # perpendicular to the edge
        along = 1 - axis
        start = max(tile.lower[along], 0.0) + ORIGIN_CORNER_SIZE + 4e-3
        end = min(tile.upper[along], size[along])
        if end - start < text_width(label, EDGE_LABEL_SIZE):
            continue
        for edge, outward, room in (
            (0.0, -1.0, -tile.lower[axis]),
            (size[axis], 1.0, tile.upper[axis] - size[axis]),
        ):
            if not tile.lower[axis] + 1e-3 < edge < tile.upper[axis] - 1e-3:
                continue
            side = outward if room >= label_room else -outward
            # the baseline is below the letters, or right of them if the text reads upwards
            above = 1.0 if axis == 1 else -1.0
            base = edge + side * (
                EDGE_LABEL_OFFSET if side == above else EDGE_LABEL_OFFSET + EDGE_LABEL_HEIGHT
            )
            at = (base, start) if axis == 0 else (start, base)
            pen.text(*at, label, EDGE_LABEL_SIZE, turned=axis == 0)


def draw_origin(pen: Pen, tile: Tile, clear: float) -> bool:
    """Draws the scene frame's axes in the board's corner if the corner is on a page.

    Args:
        pen: draws in the scene frame.
        tile: part of the board on the page.
        clear: larger of the distances of the markers from the corner along x and y [m].

    Returns:
        Whether it was drawn: the corner may be in the margin, or too close to a marker.
    """
    axis_length = 10e-3  # Metres.
    if max(tile.lower) > 0.0 or min(tile.upper) < ORIGIN_CORNER_SIZE or clear < ORIGIN_CORNER_SIZE:
        return False
    for axis in (0, 1):
        along = np.eye(2)[axis]
        across = np.eye(2)[1 - axis]
        tip, neck = axis_length * along, (axis_length - 2.5e-3) * along
        pen.line((0.0, 0.0), neck, width=0.4e-3)
        pen.area([np.array([tip, neck + 0.9e-3 * across, neck - 0.9e-3 * across])], TEXT_RGB)
    pen.text(axis_length + 0.8e-3, 0.6e-3, "x", 8)
    pen.text(0.8e-3, axis_length + 0.6e-3, "y", 8)
    pen.text(1.5e-3, 1.7e-3, "origin", EDGE_LABEL_SIZE)
    return True


LABEL_CELL_SIZE = 0.5e-3
"""Metres, side of a cell of the map of occupied areas."""


class FreeSpace:
    """Map of the sheet's occupied cells.

    Attributes:
        grid: cells of the sheet.
        occupied: (H, W) occupied cells.
    """

    def __init__(self, size: tuple[float, float]) -> None:
        """An empty sheet.

        Args:
            size: extents of the sheet [m].
        """
        self.grid = SheetGrid(size, LABEL_CELL_SIZE)
        self.occupied: NDArray[np.bool_] = np.zeros(self.grid.shape, dtype=bool)

    def occupy(self, lower: Iterable[float], upper: Iterable[float], clear: float = 0.0) -> None:
        """Occupies a rectangle, given by its corners, and a margin `clear` around it [m]."""
        rows, columns = self._cells(np.array([*lower]) - clear, np.array([*upper]) + clear)
        self.occupied[rows, columns] = True

    def occupy_outside(self, lower: Iterable[float], upper: Iterable[float]) -> None:
        """Occupies everything outside a rectangle."""
        self.occupied |= ~self.rectangle_mask(lower, upper)

    def occupy_layer(self, layer: SheetLayer, clear: float) -> NDArray[np.bool_]:
        """Occupies the area of an instance and a margin `clear` around it [m].

        Returns:
            (H, W) mask of the cells that the instance covers.
        """
        points = layer.points()
        covered = np.zeros_like(self.occupied)
        cells = np.rint(self.grid.pixels(points)).astype(int)
        columns, rows = np.clip(cells, 0, np.array(covered.shape[::-1]) - 1).T
        covered[rows, columns] = True
        reach = 2 * round(clear / LABEL_CELL_SIZE) + 1
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
        self.occupied |= cv2.dilate(covered.astype(np.uint8), disc) > 0
        return covered

    def cell_index(self, point: Array) -> tuple[int, int]:
        """Row and column of the cell at a point (2,) [m]."""
        column, row = np.rint(self.grid.pixels(point)).astype(int)
        return int(row), int(column)

    def cell_mask(self, point: Iterable[float]) -> NDArray[np.bool_]:
        """(H, W) mask of only the cell at a point."""
        at = np.zeros_like(self.occupied)
        at[self.cell_index(np.array([*point]))] = True
        return at

    def rectangle_mask(self, lower: Iterable[float], upper: Iterable[float]) -> NDArray[np.bool_]:
        """(H, W) mask of the cells that a rectangle touches."""
        inside = np.zeros_like(self.occupied)
        rows, columns = self._cells(np.array([*lower]), np.array([*upper]))
        inside[rows, columns] = True
        return inside

    def place(
        self,
        extent: tuple[float, float],
        beside: NDArray[np.bool_],
        within: NDArray[np.bool_] | None = None,
    ) -> Array | None:
        """Places a box on free cells as close as possible to other cells, and occupies its place.

        Args:
            extent: extents of the box along x and y [m].
            beside: (H, W) cells to be close to; not empty.
            within: (H, W) cells that the box may occupy; all if None.

        Returns:
            (2,) lower left corner of the box [m]; None if there is no room within 5 cm.
        """
        max_distance = 0.05  # Metres between a label and its object.
        columns, rows = (max(1, int(np.ceil(e / LABEL_CELL_SIZE))) for e in extent)
        window = _mask_window(beside, max(rows, columns) + round(max_distance / LABEL_CELL_SIZE))
        taken, beside = self.occupied[window], beside[window]
        blocked = taken if within is None else taken | ~within[window]
        if rows > taken.shape[0] or columns > taken.shape[1]:
            return None
        sums = cv2.integral(blocked.astype(np.uint8))
        blocked_count = sums[rows:, columns:] - sums[:-rows, columns:]
        blocked_count += sums[:-rows, :-columns] - sums[rows:, :-columns]
        # The distance of the box's nearest cell counts first, then that of its middle.
        distance = cv2.distanceTransform((~beside).astype(np.uint8), cv2.DIST_L2, 5)
        box_distance = cv2.erode(distance, np.ones((rows, columns), np.uint8), anchor=(0, 0))
        box_distance = box_distance[: blocked_count.shape[0], : blocked_count.shape[1]]
        centre = np.argwhere(beside).mean(axis=0)
        r, c = np.indices(blocked_count.shape)
        middle = np.hypot(r + rows / 2 - centre[0], c + columns / 2 - centre[1])
        cost = np.where(blocked_count == 0, box_distance + 0.2 * middle, np.inf)
        row, column = np.unravel_index(np.argmin(cost), cost.shape)
        if not np.isfinite(cost[row, column]):
            return None
        taken[row : row + rows, column : column + columns] = True
        corner = [window[1].start + column - 0.5, window[0].start + row + rows - 0.5]
        return self.grid.points(np.array(corner))

    def _cells(self, lower: Array, upper: Array) -> tuple[slice, slice]:
        """Rows and columns that a rectangle touches."""
        (height, width), y = self.occupied.shape, self.grid.size[1]
        left, right = np.floor(lower[0] / LABEL_CELL_SIZE), np.ceil(upper[0] / LABEL_CELL_SIZE)
        top, bottom = (
            np.floor((y - upper[1]) / LABEL_CELL_SIZE),
            np.ceil((y - lower[1]) / LABEL_CELL_SIZE),
        )
        rows = slice(*np.clip([top, bottom], 0, height).astype(int).tolist())
        return rows, slice(*np.clip([left, right], 0, width).astype(int).tolist())


def _mask_window(mask: NDArray[np.bool_], reach: int) -> tuple[slice, slice]:
    """Slices of the rows and columns of a mask's cells, extended by `reach` cells on all sides."""
    rows, columns = (np.flatnonzero(mask.any(axis=1 - axis)) for axis in (0, 1))
    return (
        slice(max(rows[0] - reach, 0), rows[-1] + reach + 1),
        slice(max(columns[0] - reach, 0), columns[-1] + reach + 1),
    )


NAME_SIZE = 8.5
"""Points."""
NAME_CLEARANCE = 1e-3
"""Metres between a name and objects."""
OUT_OF_BOUNDS_COLOR: Rgb = (0.80, 0.10, 0.10)
"""Colour of arrows and names of objects out of bounds."""
ALIGNMENT_MARK_RADIUS = 2e-3
"""Metres."""


@dataclass(frozen=True)
class ObjectName:
    """A text on the board.

    Attributes:
        words: the text.
        position: start of its baseline [m].
        color: colour of the text.
    """

    words: str
    position: tuple[float, float]
    color: Rgb


@dataclass(frozen=True, eq=False)
class Sheet:
    """Everything drawn on a board.

    Attributes:
        size: extents [m].
        layout: the markers.
        drawings: the objects.
        arrows: arrows to objects out of bounds.
        marks: (N, 2) centres of alignment marks, on the cuts [m].
        names: texts beside objects and arrows.
    """

    size: tuple[float, float]
    layout: MarkerLayout
    drawings: list[ObjectDrawing]
    arrows: list[OutOfBoundsArrow]
    marks: Array
    names: tuple[ObjectName, ...] = ()


def alignment_marks(layout: MarkerLayout, tiling: Tiling) -> Array:
    """(N, 2) centres of the alignment marks, on the cuts midway between markers [m]."""
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
    """Finds places for the names of objects and arrows, clear of margins, markers and objects, on
    every page that shows a part of an object.

    Returns:
        The sheet with names, and the quoted names without room, with their page.
    """
    min_area = 0.5e-4  # Square metres of an object on a page that repeats its name.
    space = _space_for_names(sheet, tiling)
    masks = {d.name: space.occupy_layer(d.layer, NAME_CLEARANCE) for d in sheet.drawings}
    beyond = {arrow.name for arrow in sheet.arrows}
    wanted = [
        (d.words, d.footprint_color, masks[d.name]) for d in sheet.drawings if d.name not in beyond
    ]
    for arrow in sheet.arrows:
        box = np.sort(np.array([arrow.start, arrow.tip]), axis=0)
        space.occupy(box[0], box[1], 2 * NAME_CLEARANCE)
        wanted.append(
            (arrow.words, OUT_OF_BOUNDS_COLOR, masks.get(arrow.name, space.cell_mask(arrow.start)))
        )
    names: list[ObjectName] = []
    unplaced: list[str] = []
    for words, color, beside in wanted:
        extent = (
            text_width(words, NAME_SIZE, BOLD_FONT) + 2 * NAME_CLEARANCE,
            NAME_SIZE * METRES_PER_POINT,
        )
        corner = space.place(extent, beside)
        if corner is None:
            unplaced.append(repr(words))
            continue
        # a line's letters reach a fifth of its height below the baseline
        shift = np.array([NAME_CLEARANCE, 0.22 * extent[1]])
        corners = [corner]
        for tile in tiling.tiles if len(tiling.tiles) > 1 else ():
            page = space.rectangle_mask(*tile.visible_corners)
            part = beside & page
            stands_here = page[space.cell_index(corner + LABEL_CELL_SIZE)]
            if part.sum() * LABEL_CELL_SIZE**2 < min_area or stands_here:
                continue
            again = space.place(extent, part, page)
            if again is None:
                unplaced.append(f"{words!r} on page {tile.number}")
            else:
                corners.append(again)
        for at in corners:
            x, y = (at + shift).tolist()
            names.append(ObjectName(words, (x, y), color))
    return dataclasses.replace(sheet, names=tuple(names)), unplaced


def _space_for_names(sheet: Sheet, tiling: Tiling) -> FreeSpace:
    """Free space outside margins, markers, cuts, alignment marks and the corner of the origin."""
    space = FreeSpace(sheet.size)
    first, last = tiling.tiles[0], tiling.tiles[-1]
    on_paper = (first.lower[0], last.lower[1]), (last.upper[0], first.upper[1])
    inner = np.array([[0.0, 0.0], sheet.size]) + 2 * NAME_CLEARANCE * np.array([[1.0], [-1.0]])
    space.occupy_outside(np.maximum(on_paper[0], inner[0]), np.minimum(on_paper[1], inner[1]))
    space.occupy((0.0, 0.0), (ORIGIN_CORNER_SIZE, ORIGIN_CORNER_SIZE))
    clear = max(NAME_CLEARANCE, frame_width(sheet.layout))
    for corners in sheet.layout.p_SQ[:, :, :2]:
        space.occupy(corners.min(axis=0), corners.max(axis=0), clear)
    for x in tiling.x_cuts:
        space.occupy((x - BLEED, 0.0), (x + tiling.flap, sheet.size[1]), NAME_CLEARANCE)
    for y in tiling.y_cuts:
        space.occupy((0.0, y - tiling.flap), (sheet.size[0], y + BLEED), NAME_CLEARANCE)
    for mark in sheet.marks:
        space.occupy(mark, mark, ALIGNMENT_MARK_RADIUS + NAME_CLEARANCE)
    return space


def draw_sheet(pen: Pen, sheet: Sheet) -> None:
    """Draws a whole board."""
    for drawing in sheet.drawings:
        _draw_tints(pen, drawing)
    for arrow in sheet.arrows:
        draw_arrow(pen, arrow.start, arrow.tip, OUT_OF_BOUNDS_COLOR, head=4e-3, width=0.8e-3)
    _draw_markers(pen, sheet.layout)
    _draw_outlines(pen, sheet)
    for x, y in sheet.marks.tolist():
        pen.circle(x, y, ALIGNMENT_MARK_RADIUS, FAINT_LINE_RGB, 0.12e-3)
        reach = 1.6 * ALIGNMENT_MARK_RADIUS
        pen.line((x - reach, y), (x + reach, y), width=0.12e-3, color=FAINT_LINE_RGB)
        pen.line((x, y - reach), (x, y + reach), width=0.12e-3, color=FAINT_LINE_RGB)
    for name in sheet.names:
        pen.text(*name.position, name.words, NAME_SIZE, font=BOLD_FONT, color=name.color)


def _draw_tints(pen: Pen, drawing: ObjectDrawing) -> None:
    hatch_spacing = 3e-3  # Metres between the white lines over fixed objects.
    for color, area in drawing.bands:
        pen.area(area, color)
    if drawing.fixed and drawing.outline:
        corners = np.concatenate(drawing.outline)
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        high = upper[1] - lower[1]
        pen.canvas.saveState()
        pen.clip(drawing.outline)
        for x in np.arange(lower[0] - high, upper[0], hatch_spacing).tolist():
            pen.line((x, lower[1]), (x + high, upper[1]), width=0.6e-3, color=WHITE_RGB)
        pen.canvas.restoreState()


def _draw_markers(pen: Pen, layout: MarkerLayout) -> None:
    """Draws white frames, and then all black cells as one shape.

    White lines lead from the corners of a frame outwards. Without them, a tint around the frame has
    a square edge that a detector can take for that of the marker.
    """
    seam_width = 0.8e-3  # Metres; without it detectors take the edge of a frame for a marker.
    gap, frame = _marker_gap(layout), frame_width(layout)
    frames = []
    for corners in layout.p_SQ[:, :, :2]:
        lower, upper = corners.min(axis=0), corners.max(axis=0)
        frames += [rectangle(lower - frame, upper + frame), rectangle(lower, upper)]
        outer = rectangle(lower - 0.9 * frame, upper + 0.9 * frame)
        meeting = rectangle(lower - gap / 2, upper + gap / 2)
        for start, end in zip(outer.tolist(), meeting.tolist(), strict=True):
            pen.line(start, end, width=seam_width, color=WHITE_RGB)
    pen.area(frames, WHITE_RGB)
    pen.area(_black_cell_outlines(layout), BLACK_RGB, holes=False)


def _draw_outlines(pen: Pen, sheet: Sheet) -> None:
    """Draws the objects' lines over everything, dark on white and light on black cells, except at
    the edges of markers, which detectors follow."""
    outline_width = 0.2e-3  # Metres.
    footprint_width = 0.4e-3  # Metres.
    raised_dash = 0.8e-3  # Metres, for outlines above other objects.
    edge_clearance = 1.0e-3  # Metres between objects' lines and the edges of markers.
    layout = sheet.layout
    corners = layout.p_SQ[:, :, :2]
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    board = rectangle((0.0, 0.0), sheet.size)
    cells = _black_cell_outlines(layout)
    clear = min(edge_clearance, 0.4 * _marker_gap(layout), 0.5 * layout.side / layout.cells)
    outer = [rectangle(*c) for c in zip(lower - clear, upper + clear, strict=True)]
    inner = [rectangle(*c) for c in zip(lower + clear, upper - clear, strict=True)]
    for on_black in (False, True):
        pen.canvas.saveState()
        pen.clip([board, *outer, *inner])
        pen.clip(cells if on_black else [board, *cells])
        for d in sheet.drawings:
            color = d.on_black if on_black else d.outline_color
            pen.outline(d.outline, outline_width, color, d.dash)
            dark = d.on_black if on_black else d.footprint_color
            pen.outline(d.raised, outline_width, dark, raised_dash)
            pen.outline(d.footprint, footprint_width, dark)
        pen.canvas.restoreState()


def _black_cell_outlines(layout: MarkerLayout) -> list[Array]:
    """Outlines (N, 2) of the black cells of all markers [m]; holes run in the opposite
    direction."""
    flip = np.array([1.0, -1.0]) * layout.side / layout.cells
    return [
        corners[0] + loop * flip
        for corners, black in zip(layout.p_SQ[:, :, :2], layout.black, strict=True)
        for loop in cell_outlines(black)
    ]


def frame_width(layout: MarkerLayout) -> float:
    """Width of the white frames around the markers, free of tints [m]."""
    max_frame = 3e-3  # Metres, where the gap between markers is wide enough.
    max_gap_share = 0.2  # Share of a gap for one frame, so that objects remain visible.
    return min(max_frame, max_gap_share * _marker_gap(layout))


def _marker_gap(layout: MarkerLayout) -> float:
    """Least distance between neighbouring markers [m]."""
    starts = [np.unique(np.round(layout.p_SQ[:, 0, axis], 9)) for axis in (0, 1)]
    pitches = [float(np.diff(s).min()) for s in starts if len(s) > 1]
    return min(pitches, default=2 * layout.side) - layout.side
