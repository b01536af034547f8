"""The instructions of a printout: how to print, assemble, light, view and use the board."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from burg_drake.core import Array, Rgb, count_with_noun
from burg_drake.printout.object_drawings import ObjectDrawing
from burg_drake.printout.page_tiling import Paper, Tiling
from burg_drake.printout.print_settings import PrintSettings
from burg_drake.printout.sheet import (
    BOLD_FONT,
    FAINT_LINE_RGB,
    METRES_PER_POINT,
    REGULAR_FONT,
    TEXT_RGB,
    WHITE_RGB,
    Pen,
    Sheet,
    draw_arrow,
    rectangle,
    text_width,
)

SKETCH_SIZE = (0.080, 0.0255)
"""Metres, width and height."""
PLAN_HEIGHT = 0.042
"""Metres, height of the plan of pages."""


GOOD_COLOR = (0.0, 0.50, 0.30)  # Colour of correct results.
BAD_COLOR = (0.75, 0.12, 0.10)  # Colour of mistakes and cuts.
PAPER_COLOR = (0.95, 0.96, 0.97)  # Colour of paper.
SHADE_COLOR = (0.80, 0.83, 0.87)  # Colour of shaded areas.
LABEL_SIZE = 10.0  # Points.
THICK_LINE = 0.5e-3  # Metres.


Spot = tuple[float, float]


def draw_scale(pen: Pen) -> None:
    """Draws the board at its true size, and one fitted to the page."""
    for x, share, words, good in ((4e-3, 1.0, "100 %", True), (44e-3, 0.7, "fit to page", False)):
        _draw_box(pen, (x, 3e-3), (x + 16e-3, 25e-3))
        middle = np.array([x + 8e-3, 14e-3])
        for column in (-1, 0, 1):
            for row in (-1, 0, 1):
                at = middle + share * 5.2e-3 * np.array([column, row])
                half = share * 1.9e-3
                pen.area([rectangle(at - half, at + half)], TEXT_RGB)
        _draw_tick_or_cross(pen, (x + 18.5e-3, 15e-3), good=good)
        color = GOOD_COLOR if good else BAD_COLOR
        _draw_label(pen, x + 17.5e-3, 7e-3, words, bold=True, color=color)


def draw_measuring(pen: Pen) -> None:
    """Draws a steel ruler held to the printed one."""
    left, right, line = 5e-3, 65e-3, 8e-3
    steel = (left - 3e-3, line + 0.6e-3), (right + 9e-3, line + 9e-3)
    _draw_box(pen, *steel, SHADE_COLOR, 0.2e-3)
    pen.line((left, line), (right, line), width=0.3e-3)
    for k in range(11):
        x = left + (right - left) * k / 10
        long = k % 5 == 0
        pen.line((x, line), (x, line - (2.6e-3 if long else 1.5e-3)), width=0.3e-3)
        pen.line((x, line + 0.6e-3), (x, line + (3.2e-3 if long else 2.2e-3)), width=0.2e-3)
    for x, words in ((left, "0"), (right, "100 mm")):
        _draw_label(pen, x, line - 6.6e-3, words, align=0.5)
        _draw_label(pen, x, line + 4.4e-3, words[:3].strip(), align=0.5)
    _draw_label(pen, left, line + 11.5e-3, "both printed rulers: 100 mm each", bold=True)
    _draw_tick_or_cross(pen, (right + 6e-3, line + 13e-3), good=True)


def draw_cutting(pen: Pen) -> None:
    """Draws a page whose left and upper margins are cut off."""
    low, high = np.array([22e-3, 2e-3]), np.array([60e-3, 25e-3])
    cut = np.array([low[0] + 6e-3, high[1] - 6e-3])
    pen.area([rectangle(low, high), rectangle((cut[0], low[1]), (high[0], cut[1]))], SHADE_COLOR)
    pen.outline([rectangle(low, high)], 0.2e-3, TEXT_RGB)
    pen.line((cut[0], low[1]), (cut[0], high[1]), width=THICK_LINE, color=BAD_COLOR, dash=1.5e-3)
    pen.line((low[0], cut[1]), (high[0], cut[1]), width=THICK_LINE, color=BAD_COLOR, dash=1.5e-3)
    x, y = high[0] - 5e-3, low[1] + 5e-3
    for start, end in (((x, low[1]), (x, cut[1])), ((cut[0], y), (high[0], y))):
        pen.line(start, end, width=0.2e-3, color=FAINT_LINE_RGB, dash=1.2e-3)
    left, top = cut.tolist()
    _draw_scissors(pen, (float(high[0]) + 1.5e-3, top))
    _draw_label(pen, left + 7e-3, top + 1.6e-3, "CUT", bold=True, color=BAD_COLOR)
    _draw_label(pen, left + 7e-3, top - 8.5e-3, "stays")


def draw_gluing(pen: Pen, flap: float) -> None:
    """Draws a page that is laid onto the strip of the previous page.

    Args:
        pen: draws in the box.
        flap: width of the strips [m]; 0 if pages are joined edge to edge.
    """
    _draw_box(pen, (8e-3, 4e-3), (38e-3, 23e-3))
    seam = 31e-3 if flap else 38e-3
    if flap:
        for y in np.arange(5e-3, 22.9e-3, 2e-3).tolist():
            pen.line((seam + 0.5e-3, y), (37.5e-3, y + 0.8e-3), width=0.25e-3, color=GOOD_COLOR)
    start = seam + 8e-3
    _draw_box(pen, (start, 6e-3), (start + 30e-3, 25e-3))
    for x, y in ((seam, 13.5e-3), (start, 15.5e-3)):
        pen.circle(x, y, 1.8e-3, TEXT_RGB, 0.25e-3)
        pen.line((x - 2.8e-3, y), (x + 2.8e-3, y), width=0.25e-3)
        pen.line((x, y - 2.8e-3), (x, y + 2.8e-3), width=0.25e-3)
    _draw_sketch_arrow(pen, (start - 1.5e-3, 9.0e-3), (seam + 0.8e-3, 7.0e-3), TEXT_RGB)
    pen.text(19e-3, 12e-3, "1", 16, font=BOLD_FONT, align=0.5)
    pen.text(start + 17e-3, 14e-3, "2", 16, font=BOLD_FONT, align=0.5)
    _draw_label(pen, 8e-3, 0.2e-3, "glue on the strip" if flap else "edge to edge")


def draw_plan(
    pen: Pen, tiling: Tiling, size: tuple[float, float], objects: list[ObjectDrawing]
) -> None:
    """Draws the whole board: its numbered pages, cuts, and the outlines of its objects."""
    scale = min(SKETCH_SIZE[0] / size[0], PLAN_HEIGHT / size[1])
    shift = np.array([(SKETCH_SIZE[0] - scale * size[0]) / 2, 0.0])
    areas = list(zip(tiling.tiles, tiling.visible_areas(size), strict=True))
    for tile, (lower, upper) in areas:
        color = PAPER_COLOR if (tile.row + tile.column) % 2 else WHITE_RGB
        _draw_box(pen, shift + scale * lower, shift + scale * upper, color)
    for drawing in objects:
        loops = [shift + scale * loop for loop in (*drawing.outline, *drawing.raised)]
        pen.outline(loops, 0.3e-3, drawing.outline_color)
    for tile, (lower, upper) in areas:
        points = min(18.0, 0.5 * scale * float(upper[1] - lower[1]) / 0.35e-3)
        x, y = (shift + scale * ((lower + upper) / 2) - [0.0, 0.12e-3 * points]).tolist()
        pen.text(x, y, str(tile.number), points, font=BOLD_FONT, align=0.5)


def draw_flatness(pen: Pen) -> None:
    """Draws a sheet on a stiff plate, and a wavy one."""
    _draw_box(pen, (2e-3, 8e-3), (36e-3, 12e-3), SHADE_COLOR, 0.2e-3)
    pen.line((2e-3, 12.5e-3), (36e-3, 12.5e-3), width=0.8e-3)
    _draw_label(pen, 19e-3, 2.5e-3, "glued to a plate", align=0.5)
    _draw_tick_or_cross(pen, (17e-3, 17e-3), good=True)
    x = np.linspace(44e-3, 78e-3, 60)
    y = 11e-3 + 2.0e-3 * np.sin((x - 44e-3) / 34e-3 * 4 * np.pi)
    pen.line((44e-3, 8e-3), (78e-3, 8e-3), width=0.3e-3, color=FAINT_LINE_RGB)
    pen.line(*zip(x.tolist(), y.tolist(), strict=True), width=0.8e-3)
    _draw_label(pen, 61e-3, 2.5e-3, "waves, curls", align=0.5)
    _draw_tick_or_cross(pen, (59e-3, 17e-3), good=False)


def draw_lighting(pen: Pen) -> None:
    """Draws soft light from a wide source, and a lamp with its shadow and glare."""
    lamp_color = (0.98, 0.80, 0.30)  # Colour of lamps.
    for left in (2e-3, 44e-3):
        pen.line((left, 6e-3), (left + 34e-3, 6e-3), width=0.6e-3)
        _draw_box(pen, (left + 14e-3, 6.3e-3), (left + 20e-3, 12e-3), SHADE_COLOR)
    pen.area([rectangle((6e-3, 23.5e-3), (32e-3, 25.5e-3))], lamp_color)
    for x in (8e-3, 15e-3, 22e-3, 29e-3):
        _draw_sketch_arrow(pen, (x, 22.5e-3), (x, 16e-3), FAINT_LINE_RGB)
    _draw_label(pen, 19e-3, 0.5e-3, "wide, soft light", align=0.5)
    _draw_tick_or_cross(pen, (34.5e-3, 20e-3), good=True)
    lamp = 48e-3, 22e-3
    pen.area([_ellipse_outline(lamp, 2.2e-3)], lamp_color)
    _draw_sketch_arrow(pen, (50e-3, 20.5e-3), (57e-3, 13.5e-3), FAINT_LINE_RGB)
    pen.area([rectangle((64e-3, 5.2e-3), (73e-3, 6.0e-3))], TEXT_RGB)
    _draw_label(pen, 61e-3, 0.5e-3, "lamp, hard shadow", align=0.5)
    _draw_tick_or_cross(pen, (72e-3, 20e-3), good=False)


def draw_camera(pen: Pen, distances: tuple[float, float], tilt_deg: float) -> None:
    """Draws a camera over the board, and the range of its positions.

    Args:
        pen: draws in the box.
        distances: smallest and largest distance of the camera from the middle of the board [m].
        tilt_deg: largest angle from the vertical [deg].
    """
    range_color = (0.86, 0.94, 0.89)  # Colour of the range of camera positions.
    foot, reach = np.array([40e-3, 3e-3]), 21e-3
    pen.line((18e-3, 3e-3), (62e-3, 3e-3), width=0.9e-3)
    around = np.radians(np.linspace(-tilt_deg, tilt_deg, 30))
    rays = np.column_stack([np.sin(around), np.cos(around)])
    pen.area([np.concatenate([foot + reach * rays, foot + 0.5 * reach * rays[::-1]])], range_color)
    for end in ((40e-3, 25e-3), foot + 1.1 * reach * rays[-1]):
        pen.line((40e-3, 3e-3), end, width=0.2e-3, color=FAINT_LINE_RGB, dash=1e-3)
    at = foot + 0.78 * reach * rays[8]
    along = -rays[8]
    across = np.array([-along[1], along[0]])
    for shape in (
        ((-2.0, 2.0), (-2.0, -2.0), (1.0, -2.0), (1.0, 2.0)),
        ((1.0, 1.0), (1.0, -1.0), (2.6, -1.6), (2.6, 1.6)),
    ):
        pen.area([np.array([at + 1e-3 * (a * along + b * across) for a, b in shape])], TEXT_RGB)
    _draw_label(pen, 58.5e-3, 17e-3, f"{tilt_deg:g}°")
    _draw_label(pen, 2e-3, 18e-3, f"{distances[0]:.1f} to {distances[1]:.1f} m", bold=True)


def draw_placing(pen: Pen) -> None:
    """Draws an object that is set down on its silhouette."""
    sheet = np.array([[8e-3, 3e-3], [62e-3, 3e-3], [72e-3, 14e-3], [18e-3, 14e-3]])
    pen.area([sheet], PAPER_COLOR)
    pen.outline([sheet], 0.25e-3, TEXT_RGB)
    shape = _ellipse_outline((40e-3, 8.5e-3), 8e-3, 0.42)
    pen.area([shape], (0.72, 0.82, 0.90))
    pen.outline([shape], 0.3e-3, (0.25, 0.45, 0.60))
    pen.outline([_ellipse_outline((40e-3, 8.5e-3), 6e-3, 0.42)], 0.6e-3, (0.10, 0.28, 0.42))
    base, top = 15.5e-3, 22.5e-3
    pen.area([rectangle((34e-3, base), (46e-3, top))], SHADE_COLOR)
    pen.area([_ellipse_outline((40e-3, base), 6e-3, 0.25)], SHADE_COLOR)
    pen.area([_ellipse_outline((40e-3, top), 6e-3, 0.25)], WHITE_RGB)
    pen.outline([_ellipse_outline((40e-3, top), 6e-3, 0.25)], 0.25e-3, TEXT_RGB)
    pen.line((34e-3, top), (34e-3, base), width=0.25e-3)
    pen.line((46e-3, top), (46e-3, base), width=0.25e-3)
    _draw_sketch_arrow(pen, (52e-3, 21e-3), (52e-3, 12e-3), GOOD_COLOR)


def _draw_box(
    pen: Pen,
    lower: Spot | Array,
    upper: Spot | Array,
    color: Rgb = PAPER_COLOR,
    line_width: float = 0.25e-3,
) -> None:
    pen.area([rectangle(lower, upper)], color)
    pen.outline([rectangle(lower, upper)], line_width, TEXT_RGB)


def _draw_label(
    pen: Pen,
    x: float,
    y: float,
    words: str,
    *,
    align: float = 0.0,
    bold: bool = False,
    color: Rgb = TEXT_RGB,
) -> None:
    font = BOLD_FONT if bold else REGULAR_FONT
    pen.text(x, y, words, LABEL_SIZE, font=font, color=color, align=align)


def _draw_tick_or_cross(pen: Pen, at: Spot, *, good: bool) -> None:
    """Draws a tick or a cross, 5 mm wide, with its lower left corner at a point."""
    x, y = at
    if good:
        pen.line((x, y + 2e-3), (x + 1.6e-3, y), (x + 5e-3, y + 5e-3), width=1e-3, color=GOOD_COLOR)
    else:
        pen.line((x, y), (x + 4.5e-3, y + 4.5e-3), width=1e-3, color=BAD_COLOR)
        pen.line((x, y + 4.5e-3), (x + 4.5e-3, y), width=1e-3, color=BAD_COLOR)


def _draw_sketch_arrow(pen: Pen, start: Spot, tip: Spot, color: Rgb) -> None:
    draw_arrow(pen, start, tip, color, head=2.2e-3, width=THICK_LINE)


def _draw_scissors(pen: Pen, at: Spot) -> None:
    """Draws open scissors whose blades meet left of a point."""
    x, y = at
    for side in (1.0, -1.0):
        pen.line((x - 4e-3, y + side * 1.2e-3), (x + 5e-3, y - side * 1.6e-3), width=THICK_LINE)
        pen.circle(x + 6.8e-3, y - side * 2.2e-3, 1.8e-3, TEXT_RGB, THICK_LINE)


def _ellipse_outline(middle: Spot, radius: float, flat: float = 1.0) -> Array:
    """Outline (40, 2) of a circle, or of an ellipse with height `flat` times width."""
    around = np.linspace(0.0, 2 * math.pi, 40, endpoint=False)
    return np.array(middle) + radius * np.column_stack([np.cos(around), flat * np.sin(around)])


@dataclass(frozen=True)
class GuideStep:
    """A step of the instructions.

    Attributes:
        heading: a word or two.
        words: paragraphs, one per line.
        draw: draws its sketch, in a box of `SKETCH_SIZE`.
        height: height of the sketch [m].
    """

    heading: str
    words: str
    draw: Callable[[Pen], None]
    height: float = SKETCH_SIZE[1]


FLATTEN_STEP = GuideStep(
    "Keep it flat",
    "Glue the sheet, all over, onto a flat, stiff plate of wood, foam or aluminium. A sheet"
    " that waves moves the pose that a camera finds.",
    draw_flatness,
)
LIGHTING_STEP = GuideStep(
    "Light",
    "Soft, even light. No lamp or sun whose shadows have hard edges or that shines back from"
    " the paper; white paper must not be overexposed.",
    draw_lighting,
)
PLACING_STEP = GuideStep(
    "Place the objects",
    "Each object on its silhouette. The thick line is where it touches the sheet, the thin one"
    " its outline from above; darker is closer to the sheet. Begin at the far edge. Then let a"
    " camera check: burg-drake ar, or burg-drake camera placement.",
    draw_placing,
)


def guide_steps(
    sheet: Sheet, tiling: Tiling, settings: PrintSettings, losses: Sequence[str]
) -> list[GuideStep]:
    """The steps of the instructions for a board, in order.

    Args:
        sheet: the board.
        tiling: pages of the board.
        settings: print settings.
        losses: parts that the margins of printers cut off, a sentence each.
    """
    steps = [_print_step(settings.margin, losses), _measure_step(settings.measured)]
    if len(tiling.tiles) > 1:
        steps += _assembly_steps(sheet, tiling)
    steps += [FLATTEN_STEP, LIGHTING_STEP, _camera_step(sheet.layout.side)]
    return [*steps, PLACING_STEP] if sheet.drawings else steps


def _print_step(margin: float, losses: Sequence[str]) -> GuideStep:
    white = f"The printer may leave {1e3 * margin:g} mm white on each side."
    lost = [f"{loss[0].upper()}{loss[1:]}." for loss in losses] or ["Nothing is cut off by that."]
    scale = "Print at 100 %, on matt paper; not “fit to page”, not “shrink to printable area”."
    return GuideStep("Print", f"{scale}\n{' '.join((white, *lost))}", draw_scale)


def _measure_step(measured: tuple[float, float]) -> GuideStep:
    words = "On every page hold a steel ruler to the two printed rulers, along x and along y."
    remedy = (
        "Each must be 100 mm long, to 0.2 mm. If not, print again and tell the program what they"
        " measure: it draws all larger or smaller by as much."
    )
    if measured != (0.1, 0.1):
        x, y = (f"{1e3 * m:g}" for m in measured)
        remedy = (
            f"These pages are drawn for a printer that made 100 mm {x if x == y else f'{x} x {y}'}"
            " mm. " + remedy
        )
    return GuideStep("Measure", f"{words}\n{remedy}", draw_measuring)


def _assembly_steps(sheet: Sheet, tiling: Tiling) -> list[GuideStep]:
    columns, rows = len(tiling.x_cuts) + 1, len(tiling.y_cuts) + 1
    plan = GuideStep(
        "Plan of pages",
        f"{len(tiling.tiles)} pages, {columns} side by side in {count_with_noun(rows, 'row')}."
        " They are numbered from the upper left, row by row.",
        partial(draw_plan, tiling=tiling, size=sheet.size, objects=sheet.drawings),
        PLAN_HEIGHT,
    )
    cut = GuideStep(
        "Cut",
        "Cut each page along the dashed lines that say CUT, on its left and above, with a knife"
        " and a ruler. What lies beyond the other dashed lines stays.",
        draw_cutting,
    )
    strip = "onto the strips of those before it" if tiling.flap else "edge to edge with the others"
    glue = GuideStep(
        "Glue",
        f"In the order of the numbers: lay each page {strip}, so that the crosses in circles"
        " meet, and glue. Check every cross before the glue sets.",
        partial(draw_gluing, flap=tiling.flap),
    )
    return [plan, cut, glue]


def _camera_step(marker_side: float) -> GuideStep:
    min_distance = 11.0  # Distance of the camera in sides of a marker: 0.5 m for 45 mm.
    max_distance = 22.0  # Distance of the camera in sides of a marker: 1 m for 45 mm.
    max_tilt_deg = 50.0  # Degrees of the camera from the vertical.
    near, far = (times * marker_side for times in (min_distance, max_distance))
    words = (
        f"From {near:.1f} to {far:.1f} m away (with 640 x 480 pixels; twice as far with twice as"
        f" many), up to {max_tilt_deg:g}° off the vertical. As many markers as possible in sight;"
        " nothing moves, nothing is blurred."
    )
    sketch = partial(draw_camera, distances=(near, far), tilt_deg=max_tilt_deg)
    return GuideStep("Camera", words, sketch)


HEADING_SIZE = 12.5  # Points, on A4.
BODY_SIZE = 10.0  # Points, on A4.
LINE_SPACING = 1.2  # Distance of lines over the size of the text.
EDGE_GAP = 5e-3  # Metres between the text and the page's margin.


@dataclass(frozen=True)
class Guide:
    """The instructions.

    Attributes:
        title: title of the page.
        subtitle: one line.
        steps: steps in order.
    """

    title: str
    subtitle: str
    steps: tuple[GuideStep, ...]


@dataclass(frozen=True)
class StepPlace:
    """Position of a step.

    Attributes:
        number: number of the step, from 1.
        step: the step.
        page: number of the page, from 0.
        left, top: upper left corner, from the lower left corner of the page's text area [m].
        width: width of its column [m].
    """

    number: int
    step: GuideStep
    page: int
    left: float
    top: float
    width: float


def draw_guide(pen: Pen, paper: Paper, guide: Guide, *, scale_page: tuple[float, float]) -> int:
    """Draws the pages of a guide and ends each.

    Args:
        pen: draws in metres.
        paper: paper of the pages.
        guide: the instructions.
        scale_page: factors by which everything is drawn larger along x and y.

    Returns:
        Number of pages.
    """
    # Sizes over that on A4; the first that fits on one page is used.
    scales = (2.0, 1.8, 1.6, 1.4, 1.3, 1.2, 1.1, 1.0)
    fits = ((s, lay_out_steps(guide, paper, s)) for s in scales)
    scale, places = next(
        (found for found in fits if found[1] and found[1][-1].page == 0),
        (scales[-1], lay_out_steps(guide, paper, scales[-1])),
    )
    pages = places[-1].page + 1
    edge = paper.margin + EDGE_GAP
    for page in range(pages):
        canvas = pen.canvas
        canvas.scale(*scale_page)
        canvas.translate(edge / METRES_PER_POINT, edge / METRES_PER_POINT)
        canvas.scale(scale, scale)
        width, height = (side - 2 * edge for side in (paper.width, paper.height))
        _draw_header(pen, guide, height / scale, width / scale)
        for place in places:
            if place.page == page:
                _draw_step(pen, place)
        canvas.showPage()
    return pages


def lay_out_steps(guide: Guide, paper: Paper, scale: float) -> list[StepPlace]:
    """Places the steps column by column, on further pages if there is no room.

    Args:
        guide: the instructions.
        paper: paper of the pages.
        scale: scale of everything; the lengths of the places are unscaled.

    Returns:
        The places in the order of the steps; empty if no column fits on the page.
    """
    column_gap = 8e-3  # Metres.
    min_column_width = SKETCH_SIZE[0] + 1e-3  # Metres.
    step_gap = 3.5e-3  # Metres.
    header_height = 17e-3  # Metres, of title and subtitle.
    edge = paper.margin + EDGE_GAP
    width, height = (paper.width - 2 * edge) / scale, (paper.height - 2 * edge) / scale
    columns = int((width + column_gap) / (min_column_width + column_gap))
    if columns < 1:
        return []
    each = (width + column_gap) / columns - column_gap
    places: list[StepPlace] = []
    page, column, top = 0, 0, height - header_height
    for number, step in enumerate(guide.steps, start=1):
        tall = step_height(step, each)
        if tall > top and top < height - header_height:
            column, top = column + 1, height - header_height
            if column == columns:
                page, column = page + 1, 0
        places.append(StepPlace(number, step, page, column * (each + column_gap), top, each))
        top -= tall + step_gap
    return places


def step_height(step: GuideStep, width: float) -> float:
    """Height of a step in a column [m]."""
    lines = sum(len(wrap_text(words, width)) for words in step.words.splitlines())
    text = LINE_SPACING * METRES_PER_POINT * (HEADING_SIZE + 2.0 + lines * BODY_SIZE)
    return text + (step.height + 2e-3)


def wrap_text(words: str, width: float) -> list[str]:
    """Wraps text to a width [m], except for longer words."""
    lines, line = [], ""
    for word in words.split():
        longer = f"{line} {word}" if line else word
        if line and text_width(longer, BODY_SIZE) > width:
            lines.append(line)
            longer = word
        line = longer
    return [*lines, line]


def _draw_header(pen: Pen, guide: Guide, top: float, right: float) -> None:
    title_size = 20.0  # Points.
    pen.text(0.0, top - title_size * METRES_PER_POINT, guide.title, title_size, font=BOLD_FONT)
    size = BODY_SIZE * min(1.0, right / max(text_width(guide.subtitle, BODY_SIZE), 1e-9))
    pen.text(0.0, top - 13e-3, guide.subtitle, max(size, 10.0))
    pen.line((0.0, top - 15e-3), (right, top - 15e-3), width=0.2e-3, color=FAINT_LINE_RGB)


def _draw_step(pen: Pen, place: StepPlace) -> None:
    y = place.top - HEADING_SIZE * METRES_PER_POINT
    heading = f"{place.number}  {place.step.heading}"
    pen.text(place.left, y, heading, HEADING_SIZE, font=BOLD_FONT, color=TEXT_RGB)
    y -= 2.0 * LINE_SPACING * METRES_PER_POINT
    y -= place.step.height + 1e-3
    left = place.left + (place.width - SKETCH_SIZE[0]) / 2
    pen.canvas.saveState()
    pen.canvas.translate(left / METRES_PER_POINT, y / METRES_PER_POINT)
    place.step.draw(pen)
    pen.canvas.restoreState()
    y -= 1e-3
    for paragraph in place.step.words.splitlines():
        for line in wrap_text(paragraph, place.width):
            y -= LINE_SPACING * BODY_SIZE * METRES_PER_POINT
            pen.text(place.left, y + 0.25 * BODY_SIZE * METRES_PER_POINT, line, BODY_SIZE)
