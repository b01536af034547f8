"""Prints a scene's board as a PDF: markers at true scale, objects from below, pages to assemble."""

from __future__ import annotations

import contextlib
import dataclasses
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from reportlab.pdfgen.canvas import Canvas

from burg_drake.core import MILLIMETRES, Array, InvalidInputError, setting
from burg_drake.core.files import atomic_write
from burg_drake.printout.board_edge import draw_edge, draw_origin
from burg_drake.printout.drawings import Drawing, draw_arrows, draw_objects
from burg_drake.printout.guide import BoardFacts, Guide, draw_guide, guide_steps
from burg_drake.printout.losses import lacking_white, margin_losses, printer_losses
from burg_drake.printout.page_frame import Caption, draw_page_frame
from burg_drake.printout.paper import PAPERS, Paper, orientations
from burg_drake.printout.pen import POINT, WHITE, Pen, rectangle
from burg_drake.printout.sheet import Sheet, alignment_marks, draw_sheet, place_names
from burg_drake.printout.tiling import Tile, Tiling, tile_board
from burg_drake.scene.document import MarkerLayout, Scene, SceneLike, as_scene, validate_scene

MEASURED = (0.080, 0.125)
"""What a printed ruler of 100 mm can measure [m]; else it was read in another unit."""
FORM = "board"
COVER = 2e-3
"""Width of the white around what a page shows [m]."""
MARGINS = (4e-3, 3e-3, 2e-3, 1e-3, 0.0)
"""Smaller ones that are tried for a board that is spread over pages because of the margin [m]."""


@dataclass(frozen=True, kw_only=True)
class PrintSettings:
    """How a board is printed.

    Attributes:
        page: name of a paper, or `WxH` in millimetres; see `printout.paper`.
        margin: that the printer leaves white on all sides of a page [m].
        measured: what the rulers of 100 mm along x and y of the page measured on paper [m]; all is
            drawn larger by as much as that is too little.
        height_map: draw the objects.
        names: write their names beside them, on every page that shows a part of them.
        instructions: begin with a page that shows how the board is printed, assembled and used.
    """

    page: str = setting(
        "A4",
        "paper: A4 to A0, letter, legal, tabloid, or WxH in mm",
        metavar="PAGE",
    )
    margin: float = setting(5e-3, "unprintable margin of the printer", unit=MILLIMETRES, low=0)
    measured: tuple[float, float] = (0.1, 0.1)
    height_map: bool = setting(
        True, "print only markers, not where objects stand", name="no_height_map"
    )
    names: bool = setting(True, "do not print names of objects", name="no_names")
    instructions: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.margin <= 0.05:
            raise InvalidInputError(f"margin is {1e3 * self.margin:g} mm; it must be 0 to 50 mm")
        for value in self.measured:
            if not MEASURED[0] <= value <= MEASURED[1]:
                raise InvalidInputError(
                    f"the measured length of the 100 mm ruler is {1e3 * value:g} mm; it must be"
                    f" {1e3 * MEASURED[0]:g} to {1e3 * MEASURED[1]:g} mm"
                )


@dataclass(frozen=True, eq=False)
class Printout:
    """A printed board.

    Attributes:
        pdf: the document; the same bytes for the same scene and settings.
        tiling: what of the board is where on which page.
        settings: how it was printed.
        warnings: what is not as the scene has it, a sentence each.
        first: number of pages of instructions in the document, before those of the board.
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
        """Points of the board on a page of it.

        Args:
            page: the number that is printed on it, from 1; instructions do not count.
            p_SQ: (..., 2 or 3) points in the scene frame [m].

        Returns:
            (..., 2) from the page's lower left corner [m], as the document has them: what a printer
            that scales as `measured` says puts in its true place.
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
        scene: what reaches beyond the board is cut off, and an arrow points to it.
        settings: page and printer; A4 by default.

    Raises:
        UnknownNameError: there is no such page; a mesh file is missing.
        InvalidInputError: no markers fit on the board, or none on a page; too many pages.
    """
    scene = as_scene(scene)
    scene.require_markers()
    settings = settings or PrintSettings()
    size, layout = scene.board.size, scene.board.layout
    orientations(settings.page, settings.margin, settings.measured)  # before the drawings
    drawings = draw_objects(scene) if settings.height_map else []
    tiling = _tiling(size, layout, drawings, settings)
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
    warnings += _spread(size, layout, drawings, settings, tiling)
    warnings += lacking_white(size, layout)
    warnings += [f"there is no room to print {words}" for words in unplaced]
    pdf, first = _document(scene, sheet, tiling, settings, losses)
    return Printout(pdf, tiling, settings, tuple(warnings), first)


def _tiling(
    size: tuple[float, float],
    layout: MarkerLayout,
    drawings: list[Drawing],
    settings: PrintSettings,
) -> Tiling:
    papers = orientations(settings.page, settings.margin, settings.measured)
    return tile_board(size, layout, _needed(size, layout, drawings, papers[0]), papers)


def _spread(
    size: tuple[float, float],
    layout: MarkerLayout,
    drawings: list[Drawing],
    settings: PrintSettings,
    tiling: Tiling,
) -> list[str]:
    """What would print on one page a board that is no larger than the page."""
    paper, pages = tiling.paper, len(tiling.tiles)
    sides = np.sort(size), np.sort([paper.width, paper.height])
    if pages == 1 or (sides[0] > sides[1] + 1e-6).any():
        return []

    def on_one(**changes: Any) -> bool:
        with contextlib.suppress(InvalidInputError):
            changed = dataclasses.replace(settings, **changes)
            return len(_tiling(size, layout, drawings, changed).tiles) == 1
        return False

    margin = next((m for m in MARGINS if m < settings.margin and on_one(margin=m)), None)
    page = next((name for name in PAPERS if on_one(page=name)), None)
    changes = [f"a margin of {1e3 * margin:g} mm"] if margin is not None else []
    changes += [f"page {page}"] if page else []
    remedy = f"; {' or '.join(changes)} would fit on one" if changes else ""
    return [
        f"the board is no larger than the page, but takes {pages} pages because of the margins,"
        f" rulers and text{remedy}"
    ]


def _needed(
    size: tuple[float, float], layout: MarkerLayout, drawings: list[Drawing], paper: Paper
) -> tuple[Array, Array]:
    """Corners of what has to be on paper: markers, and objects but for the rim that a page of the
    board's own size has no room for."""
    points = layout.p_SQ[:, :, :2].reshape(-1, 2)
    lower, upper = points.min(axis=0), points.max(axis=0)
    inner = np.array(paper.lower), np.array(size) - paper.margin
    for drawing in drawings:
        for outline in (*drawing.outline, *drawing.raised):
            lower = np.minimum(lower, np.maximum(outline.min(axis=0), inner[0]))
            upper = np.maximum(upper, np.minimum(outline.max(axis=0), inner[1]))
    return lower, upper


def _scale_correction(settings: PrintSettings) -> Array:
    """How much larger all is drawn along x and y."""
    return 0.1 / np.array(settings.measured)


def _document(
    scene: Scene, sheet: Sheet, tiling: Tiling, settings: PrintSettings, losses: list[str]
) -> tuple[bytes, int]:
    """The PDF, and how many pages of instructions it begins with."""
    print_scale, paper = _scale_correction(settings), tiling.paper
    stream = io.BytesIO()
    page_size = tuple((print_scale * [paper.width, paper.height] / POINT).tolist())
    canvas = Canvas(stream, pagesize=page_size, pageCompression=1, invariant=1)
    canvas.setTitle(f"Board of {scene.name}")
    canvas.setSubject(f"scene {scene.name}, content {scene.content}")
    canvas.setCreator("burg-drake")
    canvas.setAuthor("burg-drake")
    canvas.setViewerPreference("PrintScaling", "None")
    pen = Pen(canvas)
    first = 0
    if settings.instructions:
        guide, (x, y) = _guide(scene, sheet, tiling, settings, losses), print_scale.tolist()
        first = draw_guide(pen, tiling.paper, guide, scale_page=(x, y))
    canvas.beginForm(FORM, 0.0, 0.0, sheet.size[0] / POINT, sheet.size[1] / POINT)
    draw_sheet(pen, sheet)
    canvas.endForm()
    for tile in tiling.tiles:
        canvas.scale(*print_scale.tolist())
        _draw_board(pen, sheet, tile)
        draw_page_frame(
            pen,
            tile,
            tiling,
            sheet.size,
            _caption(scene, settings, len(tiling.tiles), tiling.flap),
            marks=sheet.marks,
            tints=bool(sheet.drawings),
        )
        canvas.showPage()
    canvas.save()
    return stream.getvalue(), first


def _guide(
    scene: Scene, sheet: Sheet, tiling: Tiling, settings: PrintSettings, losses: list[str]
) -> Guide:
    facts = BoardFacts(
        size=sheet.size,
        side=sheet.layout.side,
        margin=settings.margin,
        measured=settings.measured,
        tiling=tiling,
        objects=sheet.drawings,
        losses=tuple(f"{loss[0].upper()}{loss[1:]}." for loss in losses),
    )
    pages, paper = len(tiling.tiles), tiling.paper.name
    x, y = (f"{1e3 * s:g}" for s in sheet.size)
    return Guide(
        title="How to make this board",
        subtitle=f"{scene.name}: {x} x {y} mm on {pages} page{'s' * (pages > 1)} {paper}, content"
        f" {scene.content[:8]}",
        steps=tuple(guide_steps(facts)),
    )


def _draw_board(pen: Pen, sheet: Sheet, tile: Tile) -> None:
    """The tile's part of the board, and the board's edge where it is on the page."""
    canvas = pen.canvas
    canvas.saveState()
    canvas.translate(tile.p_PS[0] / POINT, tile.p_PS[1] / POINT)
    # Covered, not clipped, where the page's part ends: along a clip, viewers blend what is below
    # the white frames of markers into hairs.
    lower, upper = np.array(tile.lower), np.array(tile.upper)
    canvas.saveState()
    pen.clip([rectangle(lower - COVER / 2, upper + COVER / 2)])
    canvas.doForm(FORM)
    draw_edge(pen, tile, sheet.size)
    draw_origin(pen, tile, float(sheet.layout.p_SQ[:, :, :2].reshape(-1, 2).min(axis=0).max()))
    canvas.restoreState()
    pen.area([rectangle(lower - COVER, upper + COVER), rectangle(lower, upper)], WHITE)
    canvas.restoreState()


def _caption(scene: Scene, settings: PrintSettings, pages: int, flap: float) -> Caption:
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
    told = settings.instructions or pages == 1
    return Caption(
        title=scene.name,
        board=f"{1e3 * size[0]:g} x {1e3 * size[1]:g} mm, content {scene.content[:8]}",
        facts=f"{markers} {origin}{'' if told else steps}",
        how=how,
    )
