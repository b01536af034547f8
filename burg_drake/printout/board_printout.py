"""The printout of a scene's board as PDF: markers at true scale, objects, pages to assemble."""

from __future__ import annotations

import contextlib
import dataclasses
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from reportlab.pdfgen.canvas import Canvas

from burg_drake.core import Array, InvalidInputError, atomic_write, count_with_noun
from burg_drake.printout.guide import Guide, draw_guide, guide_steps
from burg_drake.printout.object_drawings import (
    FIXED_TINT_COLOR,
    MAX_TINT_HEIGHT,
    ObjectDrawing,
    draw_arrows,
    draw_objects,
    luma_at,
    tint_colors,
)
from burg_drake.printout.page_tiling import (
    BLEED,
    BOTTOM_STRIP,
    PAPER_SIZES,
    Paper,
    Tile,
    Tiling,
    page_orientations,
    tile_board,
)
from burg_drake.printout.print_settings import PrintSettings
from burg_drake.printout.sheet import (
    BOLD_FONT,
    FAINT_LINE_RGB,
    METRES_PER_POINT,
    TEXT_RGB,
    WHITE_RGB,
    Pen,
    Sheet,
    alignment_marks,
    draw_board_edge,
    draw_origin,
    draw_sheet,
    place_names,
    rectangle,
    text_width,
)
from burg_drake.scene import (
    MARKER_EDGE_MARGIN,
    MarkerLayout,
    Scene,
    SceneLike,
    as_scene,
    validate_scene,
)

RULER_LENGTH = 0.100  # Metres.
THIN_LINE = 0.12e-3  # Metres.
MAP_SIZE = (0.026, 0.011)  # Metres, width and height of the map of pages.
LEGEND_WIDTH = 0.030  # Metres.


@dataclass(frozen=True, kw_only=True)
class Caption:
    """Text at the foot of every page.

    Attributes:
        title: name of the scene.
        board: size of the board and content hash of the scene.
        facts: dictionary and positions of the markers, in small print.
        how: printing instructions.
    """

    title: str
    board: str
    facts: str
    how: str


def draw_page_frame(pen: Pen, tile: Tile, tiling: Tiling, sheet: Sheet, caption: Caption) -> None:
    """Draws rulers, cuts, map and caption around the board on a page, with the origin lower left.

    Args:
        pen: draws in metres of the page.
        tile: the page.
        tiling: all pages.
        sheet: the board; text keeps clear of its alignment marks.
        caption: text at the foot.
    """
    paper, tints = tiling.paper, bool(sheet.drawings)
    draw_rulers(pen, paper)
    right = paper.width - paper.margin
    base = paper.margin
    if len(tiling.tiles) > 1:
        right -= MAP_SIZE[0]
        _draw_map(pen, tile, tiling, sheet.size, (right, base))
        right -= 4e-3
    left = paper.lower[0] + RULER_LENGTH + 8e-3
    above = paper.lower[1] + RULER_LENGTH + 8e-3
    if tints and above + LEGEND_WIDTH < paper.upper[1]:
        _draw_legend(pen, (paper.lower[0] - 2.1e-3, above), turned=True)
    elif tints and right - left > 0.105:
        right -= LEGEND_WIDTH
        _draw_legend(pen, (right, base + 5.8e-3), turned=False)
        right -= 6e-3
    _draw_caption(pen, caption, tile, len(tiling.tiles), (left, right), base)
    _draw_cuts(pen, tile, tiling, sheet.size, sheet.marks)


def draw_rulers(pen: Pen, paper: Paper) -> None:
    """Draws a ruler along x and one along y, as printers may scale the two differently."""
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

    pen.line(at(0.0, 0.0), at(RULER_LENGTH, 0.0), width=THIN_LINE)
    for millimetre in range(101):
        tick = 2.4e-3 if millimetre % 50 == 0 else 1.7e-3 if millimetre % 10 == 0 else 0.9e-3
        width = 2 * THIN_LINE if millimetre in (0, 100) else THIN_LINE
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
    title_size = _fitting_text_size(caption.title, room, 10, BOLD_FONT)
    pen.text(left, base + 10.0e-3, caption.title, title_size, font=BOLD_FONT)
    start = left - RULER_LENGTH - 8e-3  # also below the ruler
    for x, y, text, size in (
        (left, 6.8e-3, caption.board, 6.5),
        (start, 4.2e-3, caption.facts, 6.5),
        (start, 0.75e-3, caption.how, 10),
    ):
        pen.text(x, base + y, text, _fitting_text_size(text, right - x, size))


def _fitting_text_size(text: str, room: float, size: float, font: str = "Helvetica") -> float:
    """Largest text size [points], at most `size`, at which a line fits into the width `room`
    [m]."""
    return size * min(1.0, room / max(text_width(text, size, font), 1e-9))


def _draw_map(
    pen: Pen, tile: Tile, tiling: Tiling, size: tuple[float, float], corner: tuple[float, float]
) -> None:
    """Draws a map of the board with its cuts, and this page filled."""
    scale = min(MAP_SIZE[0] / size[0], MAP_SIZE[1] / size[1])
    start = np.array([corner[0] + MAP_SIZE[0] - scale * size[0], corner[1] + 0.5e-3])
    for other, area in zip(tiling.tiles, tiling.visible_areas(size), strict=True):
        lower, upper = (start + scale * p for p in area)
        here = other.number == tile.number
        if here:
            pen.area([rectangle(lower, upper)], TEXT_RGB)
        pen.outline([rectangle(lower, upper)], THIN_LINE, TEXT_RGB)
        text = min(6.0, 0.6 * float(upper[1] - lower[1]) / METRES_PER_POINT)
        x, y = ((lower + upper) / 2 - [0.0, 0.35 * text * METRES_PER_POINT]).tolist()
        color = WHITE_RGB if here else TEXT_RGB
        pen.text(x, y, str(other.number), text, align=0.5, color=color)


def _draw_legend(pen: Pen, start: tuple[float, float], *, turned: bool) -> None:
    """Draws the height legend of the tints in grey, from `start` [m] to the right, or turned
    upwards."""
    along = np.array([0.0, 1.0] if turned else [1.0, 0.0])
    up = np.array([-1.0, 0.0] if turned else [0.0, 1.0])

    def at(length: float, off: float) -> tuple[float, float]:
        x, y = (start + length * along + off * up).tolist()
        return x, y

    steps = 60
    edges = LEGEND_WIDTH * np.arange(steps + 1) / steps
    for k in range(steps):
        luma = luma_at(MAX_TINT_HEIGHT * (k + 0.5) / steps)
        r, g, b = tint_colors(FIXED_TINT_COLOR, luma).tolist()
        # Bands overlap, against white hairlines.
        end = min(edges[k + 1] + 0.1e-3, edges[-1])
        corners = at(edges[k], 0.0), at(end, 0.0), at(end, 2.0e-3), at(edges[k], 2.0e-3)
        pen.area([np.array(corners)], (r, g, b))
    pen.text(*at(0.0, 2.8e-3), "height above the sheet", 6, turned=turned)
    for k, millimetre in enumerate((0, 50, 100)):
        words = f"{millimetre} mm" if millimetre == 100 else str(millimetre)
        pen.text(*at(k * LEGEND_WIDTH / 2, -2.0e-3), words, 6, align=k / 2, turned=turned)


def _draw_cuts(
    pen: Pen, tile: Tile, tiling: Tiling, size: tuple[float, float], marks: Array
) -> None:
    """Draws dashed lines: cut lines on the left and above, glue lines for the next page on the
    right and below."""
    (x0, y0), (x1, y1) = tiling.paper.lower, tiling.paper.upper
    columns = len(tiling.x_cuts) + 1
    for axis, cut, trimmed in (
        *((0, tile.cut_left, True), (0, tile.cut_right, False)),
        *((1, tile.cut_top, True), (1, tile.cut_bottom, False)),
    ):
        if cut is None:
            continue
        at = tile.p_PS[axis] + cut
        start, end = ((at, y0), (at, y1)) if axis == 0 else ((x0, at), (x1, at))
        pen.line(start, end, width=THIN_LINE, color=FAINT_LINE_RGB, dash=1.2e-3)
        on_cut = marks[np.abs(marks[:, axis] - cut) < 1e-5, 1 - axis]
        crossed = tile.p_PS[1 - axis] + np.array([0.0, size[1 - axis], *on_cut])
        neighbour = tile.number + (columns if axis else 1)
        words = f"page {neighbour} " + ("is glued here" if tiling.flap else "joins here")
        words = "CUT" if trimmed else words
        _label_cut(pen, end, words, trimmed, crossed, turned=axis == 0)


def _label_cut(
    pen: Pen, end: tuple[float, float], words: str, trimmed: bool, crossed: Array, *, turned: bool
) -> None:
    """Writes at the end of a cut line what to do there.

    Args:
        pen: draws in metres of the page.
        end: the line runs towards it [m].
        words: text to write.
        trimmed: write on the side that is cut off, or else on the strip that stays.
        crossed: (N,) positions along the line that text keeps clear of [m].
        turned: the line runs upwards.
    """
    text_size = 7.5  # Points.
    mark_clearance = 4.5e-3  # Metres between text and an alignment mark or the board's edge.
    length = text_width(words, text_size, BOLD_FONT)
    along = end[1 if turned else 0] - 1e-3
    for there in np.sort(crossed)[::-1]:
        if along - length - mark_clearance < there < along + mark_clearance:
            along = there - mark_clearance
    off = BLEED + 1.0e-3 if trimmed else -(BLEED + 1.0e-3 + 0.72 * text_size * METRES_PER_POINT)
    at = (end[0] - off, along) if turned else (along, end[1] + off)
    pen.text(*at, words, text_size, font=BOLD_FONT, align=1.0, turned=turned)


def margin_losses(sheet: Sheet, tiling: Tiling) -> list[str]:
    """Parts of the objects that no page shows, by page, except for objects beyond the board."""
    min_loss = 0.5e-3  # Metres; smaller losses are not reported.
    beyond = {arrow.name for arrow in sheet.arrows}
    losses = []
    for tile in tiling.tiles:
        for drawing in sheet.drawings:
            loops = [*drawing.outline, *drawing.raised]
            if drawing.name in beyond or not loops:
                continue
            points = _between_cuts(np.concatenate(loops), tile)
            if not len(points):
                continue
            below = np.array(tile.lower) - points.min(axis=0)
            above = points.max(axis=0) - np.array(tile.upper)
            loss = float(max(below.max(), above.max()))
            if loss > min_loss:
                losses.append(
                    f"page {tile.number}: the outermost {1e3 * loss:.1f} mm of {drawing.name!r} lie"
                    " in the margin of the page; larger pages have room"
                )
    return losses


def printer_losses(sheet: Sheet, tiling: Tiling) -> list[str]:
    """Parts that usual printers would cut off, by page, if the margin is less than theirs."""
    usual_margin = 4.23e-3  # Metres; most laser printers leave 1/6 inch white (estimate).
    paper = tiling.paper
    if paper.margin >= usual_margin:
        return []
    lower = np.full(2, usual_margin)
    upper = np.array([paper.width, paper.height]) - usual_margin
    corners = [c[:, :2] for c in sheet.layout.p_SQ]
    outlines = [loop for d in sheet.drawings for loop in (*d.outline, *d.raised)]
    losses = []
    for tile in tiling.tiles:
        shown = np.array([tile.lower, tile.upper]) + tile.p_PS
        cut = []
        for what, shapes in (("markers", corners), ("objects", outlines)):
            parts = [p for shape in shapes if len(p := _between_cuts(shape, tile))]
            if parts:
                points = np.clip(np.concatenate(parts) + tile.p_PS, *shown)
                loss = max((lower - points).max(), (points - upper).max())
                cut += [f"{1e3 * loss:.1f} mm of {what}"] if loss > 1e-4 else []
        if cut:
            losses.append(
                f"page {tile.number}: a printer with a margin of {1e3 * usual_margin:.1f} mm, as"
                f" most laser printers have, cuts off {' and '.join(cut)}"
            )
    return losses


def markers_without_quiet_zone(size: tuple[float, float], layout: MarkerLayout) -> list[str]:
    """Warning about markers at the sheet's edge; detectors need a white zone about a cell wide."""
    corners = layout.p_SQ[..., :2].reshape(-1, 2)
    white = min(corners.min(), (np.array(size) - corners).min())
    least = min(layout.side / layout.cells, MARKER_EDGE_MARGIN)
    if white > least - 1e-9:
        return []
    return [
        f"markers are {1e3 * white:.1f} mm from the edge of the board, but detectors need a white"
        f" border of {1e3 * least:.1f} mm around them; give a larger board or smaller markers"
    ]


def _between_cuts(points: Array, tile: Tile) -> Array:
    """Selects the points (N, 2) of the board that belong on a page [m]."""
    low = [-np.inf if c is None else c for c in (tile.cut_left, tile.cut_bottom)]
    high = [np.inf if c is None else c for c in (tile.cut_right, tile.cut_top)]
    return points[((points >= low) & (points <= high)).all(axis=1)]


@dataclass(frozen=True, eq=False)
class Printout:
    """A printed board.

    Attributes:
        pdf: the document; the same bytes for the same scene and settings.
        tiling: pages, and the part of the board on each.
        settings: print settings.
        warnings: differences from the scene, a sentence each.
        first: number of pages of instructions before the pages of the board.
    """

    pdf: bytes
    tiling: Tiling
    settings: PrintSettings
    warnings: tuple[str, ...]
    first: int = 0

    def __repr__(self) -> str:
        pages, kib = len(self.tiling.tiles), len(self.pdf) / 1024
        return f"Printout({pages} pages of {self.settings.page}, {kib:.0f} KiB)"

    def p_PQ(self, page: int, p_SQ: Array) -> Array:
        """Transforms points of the board to a page.

        Args:
            page: the page number printed on it, from 1; instructions do not count.
            p_SQ: (..., 2 or 3) points in the scene frame [m].

        Returns:
            (..., 2) from the page's lower left corner [m], in the document; a printer that scales
            as `measured` says prints them at their true place.
        """
        tile = self.tiling.tiles[page - 1]
        return (np.asarray(p_SQ)[..., :2] + tile.p_PS) * _scale_correction(self.settings)

    def save(self, path: str | Path) -> None:
        """Writes the PDF.

        Raises:
            InvalidInputError: the place cannot be written to.
        """
        atomic_write(path, self.pdf)


def print_board(scene: SceneLike, settings: PrintSettings | None = None) -> Printout:
    """Prints the board of a scene.

    Example::

        burg.print_board("tabletop_six").save("board.pdf")

    Args:
        scene: objects that reach beyond the board are cut off, and an arrow points to them.
        settings: page and printer; A4 by default.

    Raises:
        UnknownNameError: there is no such page; a mesh file is missing.
        InvalidInputError: no markers fit on the board, or none on a page; too many pages.
    """
    scene = as_scene(scene)
    scene.require_markers()
    settings = settings or PrintSettings()
    size, layout = scene.board.size, scene.board.layout
    page_orientations(settings.page, settings.margin, settings.measured)  # before the drawings
    drawings = draw_objects(scene) if settings.height_map else []
    tiling = _choose_tiling(size, layout, drawings, settings)
    sheet = Sheet(
        size=size,
        layout=layout,
        drawings=drawings,
        arrows=draw_arrows(scene) if settings.height_map else [],
        marks=alignment_marks(layout, tiling),
    )
    unplaced: list[str] = []
    if settings.names:
        sheet, unplaced = place_names(sheet, tiling)
    warnings = [issue.message for issue in validate_scene(scene)] if settings.height_map else []
    losses = [*margin_losses(sheet, tiling), *printer_losses(sheet, tiling)]
    warnings += losses
    warnings += _multiple_pages_warning(size, layout, drawings, settings, tiling)
    warnings += markers_without_quiet_zone(size, layout)
    warnings += [f"there is no room to print {words}" for words in unplaced]
    pdf, first = _make_pdf(scene, sheet, tiling, settings, losses)
    return Printout(pdf, tiling, settings, tuple(warnings), first)


def _choose_tiling(
    size: tuple[float, float],
    layout: MarkerLayout,
    drawings: list[ObjectDrawing],
    settings: PrintSettings,
) -> Tiling:
    papers = page_orientations(settings.page, settings.margin, settings.measured)
    return tile_board(size, layout, _required_points(size, layout, drawings, papers[0]), papers)


def _multiple_pages_warning(
    size: tuple[float, float],
    layout: MarkerLayout,
    drawings: list[ObjectDrawing],
    settings: PrintSettings,
    tiling: Tiling,
) -> list[str]:
    """Advice on printing a board that is no larger than a page on one page."""
    smaller_margins = (4e-3, 3e-3, 2e-3, 1e-3, 0.0)  # Metres that are tried in turn.
    paper, pages = tiling.paper, len(tiling.tiles)
    sides = np.sort(size), np.sort([paper.width, paper.height])
    if pages == 1 or (sides[0] > sides[1] + 1e-6).any():
        return []

    def fits_on_one_page(**changes: Any) -> bool:
        with contextlib.suppress(InvalidInputError):
            changed = dataclasses.replace(settings, **changes)
            return len(_choose_tiling(size, layout, drawings, changed).tiles) == 1
        return False

    margin = next(
        (m for m in smaller_margins if m < settings.margin and fits_on_one_page(margin=m)), None
    )
    page = next((name for name in PAPER_SIZES if fits_on_one_page(page=name)), None)
    changes = [f"a margin of {1e3 * margin:g} mm"] if margin is not None else []
    changes += [f"page {page}"] if page else []
    remedy = f"; {' or '.join(changes)} would fit on one" if changes else ""
    return [
        f"the board is no larger than the page, but takes {pages} pages because of the margins,"
        f" rulers and text{remedy}"
    ]


def _required_points(
    size: tuple[float, float], layout: MarkerLayout, drawings: list[ObjectDrawing], paper: Paper
) -> tuple[Array, Array]:
    """Corners of the area that has to be on paper: markers, and objects except in the rim that a
    page of the board's own size cannot show."""
    points = layout.p_SQ[:, :, :2].reshape(-1, 2)
    lower, upper = points.min(axis=0), points.max(axis=0)
    inner = np.array(paper.lower), np.array(size) - paper.margin
    for drawing in drawings:
        for outline in (*drawing.outline, *drawing.raised):
            lower = np.minimum(lower, np.maximum(outline.min(axis=0), inner[0]))
            upper = np.maximum(upper, np.minimum(outline.max(axis=0), inner[1]))
    return lower, upper


def _scale_correction(settings: PrintSettings) -> Array:
    """Factors by which everything is drawn larger along x and y."""
    return 0.1 / np.array(settings.measured)


def _make_pdf(
    scene: Scene, sheet: Sheet, tiling: Tiling, settings: PrintSettings, losses: list[str]
) -> tuple[bytes, int]:
    """The PDF, and the number of pages of instructions at its beginning."""
    print_scale, paper = _scale_correction(settings), tiling.paper
    stream = io.BytesIO()
    page_size = tuple((print_scale * [paper.width, paper.height] / METRES_PER_POINT).tolist())
    canvas = Canvas(stream, pagesize=page_size, pageCompression=1, invariant=1)
    canvas.setTitle(f"Board of {scene.name}")
    canvas.setSubject(f"scene {scene.name}, content {scene.content}")
    canvas.setCreator("burg-drake")
    canvas.setAuthor("burg-drake")
    canvas.setViewerPreference("PrintScaling", "None")
    pen = Pen(canvas)
    first = 0
    if settings.instructions:
        guide, (x, y) = _make_guide(scene, sheet, tiling, settings, losses), print_scale.tolist()
        first = draw_guide(pen, tiling.paper, guide, scale_page=(x, y))
    canvas.beginForm(
        "board", 0.0, 0.0, sheet.size[0] / METRES_PER_POINT, sheet.size[1] / METRES_PER_POINT
    )
    draw_sheet(pen, sheet)
    canvas.endForm()
    caption = _make_caption(scene, settings, len(tiling.tiles), tiling.flap)
    for tile in tiling.tiles:
        canvas.scale(*print_scale.tolist())
        _draw_tile(pen, sheet, tile)
        draw_page_frame(pen, tile, tiling, sheet, caption)
        canvas.showPage()
    canvas.save()
    return stream.getvalue(), first


def _make_guide(
    scene: Scene, sheet: Sheet, tiling: Tiling, settings: PrintSettings, losses: list[str]
) -> Guide:
    pages, paper = count_with_noun(len(tiling.tiles), "page"), tiling.paper.name
    x, y = (f"{1e3 * s:g}" for s in sheet.size)
    return Guide(
        title="How to make this board",
        subtitle=f"{scene.name}: {x} x {y} mm on {pages} {paper}, content {scene.content[:8]}",
        steps=tuple(guide_steps(sheet, tiling, settings, losses)),
    )


def _draw_tile(pen: Pen, sheet: Sheet, tile: Tile) -> None:
    """Draws the tile's part of the board, and the board's edge as far as it is on the page."""
    cover_width = 2e-3  # Metres of white around the part that a page shows.
    canvas = pen.canvas
    canvas.saveState()
    canvas.translate(tile.p_PS[0] / METRES_PER_POINT, tile.p_PS[1] / METRES_PER_POINT)
    # Covered, not clipped, beyond the page's part: along a clip, viewers show hairlines of the
    # drawing below the white frames of markers.
    lower, upper = np.array(tile.lower), np.array(tile.upper)
    canvas.saveState()
    pen.clip([rectangle(lower - cover_width / 2, upper + cover_width / 2)])
    canvas.doForm("board")
    draw_board_edge(pen, tile, sheet.size)
    draw_origin(pen, tile, float(sheet.layout.p_SQ[:, :, :2].reshape(-1, 2).min(axis=0).max()))
    canvas.restoreState()
    pen.area(
        [rectangle(lower - cover_width, upper + cover_width), rectangle(lower, upper)], WHITE_RGB
    )
    canvas.restoreState()


def _make_caption(scene: Scene, settings: PrintSettings, pages: int, flap: float) -> Caption:
    layout, size = scene.board.layout, scene.board.size
    edge = layout.p_SQ[:, :, :2].reshape(-1, 2).min(axis=0)
    how = "Print at 100 %, not fitted to the page: both rulers must measure 100 mm."
    if settings.measured != (0.1, 0.1):
        x, y = (f"{1e3 * m:g}" for m in settings.measured)
        how = (
            f"For a printer that made 100 mm {x if x == y else f'{x} x {y}'} mm. Print at 100 %:"
            " both rulers must measure 100 mm."
        )
    side, gap = 1e3 * layout.side, 1e3 * scene.board.markers.spacing
    markers = (
        f"{layout.dictionary}, ids {layout.ids[0]} to {layout.ids[-1]}, {side:g} mm with gaps of"
        f" {gap:g} mm."
    )
    origin = (
        f"The board's origin lies {1e3 * edge[0]:g} mm left of the markers, {1e3 * edge[1]:g} mm"
        " below."
    )
    join = "Glue each page onto the strips of those before it, cross on cross."
    if not flap:
        join = "Join each page to those before it edge to edge, cross on cross."
    steps = f" 1 Check the rulers. 2 Cut along the lines that say CUT. 3 {join}"
    has_steps_elsewhere = settings.instructions or pages == 1
    return Caption(
        title=scene.name,
        board=f"{1e3 * size[0]:g} x {1e3 * size[1]:g} mm, content {scene.content[:8]}",
        facts=f"{markers} {origin}{'' if has_steps_elsewhere else steps}",
        how=how,
    )
