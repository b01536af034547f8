"""Write a calibration target as a PDF page, true to scale."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from reportlab.pdfgen.canvas import Canvas

from burg_drake.cameras.calibration.charuco_target import CharucoTarget
from burg_drake.core import Array, InvalidInputError, atomic_write, option_name
from burg_drake.printout import (
    BLACK_RGB,
    BOLD_FONT,
    METRES_PER_POINT,
    TEXT_RGB,
    Paper,
    Pen,
    PrintSettings,
    cell_outlines,
    draw_rulers,
    page_orientations,
    rectangle,
)
from burg_drake.scene import marker_dictionary


def write_target(
    target: CharucoTarget, path: str | Path, settings: PrintSettings | None = None
) -> Paper:
    """Writes a target as a PDF of one page.

    Args:
        target: to print.
        path: file to write.
        settings: page and printer; A4 by default. Height map and names are ignored.

    Returns:
        The page, in portrait or landscape, whichever the target fits on.

    Raises:
        UnknownNameError: there is no such page.
        InvalidInputError: the target does not fit on the page, or the file cannot be written.
    """
    settings = settings or PrintSettings()
    papers = page_orientations(settings.page, settings.margin, settings.measured)
    # White around the squares, in addition to the white margin.
    needed = np.array(target.size) + 2.0 * 0.3 * target.square
    paper = next((p for p in papers if (needed <= np.array(p.room) + 1e-9).all()), None)
    if paper is None:
        raise InvalidInputError(
            "a target of {} x {} squares of {:g} mm measures {:.0f} x {:.0f} mm, but page {} has"
            " room for {:.0f} x {:.0f} mm; give a larger page or smaller squares".format(
                *target.squares,
                1e3 * target.square,
                *(1e3 * side for side in target.size),
                papers[0].name,
                *(1e3 * side for side in papers[0].room),
            )
        )
    stream = io.BytesIO()
    print_scale = 0.1 / np.array(settings.measured)
    page_size = tuple((print_scale * [paper.width, paper.height] / METRES_PER_POINT).tolist())
    canvas = Canvas(stream, pagesize=page_size, pageCompression=1, invariant=1)
    canvas.setTitle("Calibration target")
    canvas.setCreator("burg-drake")
    canvas.setViewerPreference("PrintScaling", "None")
    canvas.scale(*print_scale.tolist())
    pen = Pen(canvas)
    draw_rulers(pen, paper)
    _draw_caption(pen, target, paper)
    _draw_squares(pen, target, target_origin(target, paper))
    canvas.showPage()
    canvas.save()
    atomic_write(path, stream.getvalue())
    return paper


def target_origin(target: CharucoTarget, paper: Paper) -> Array:
    """(2,) position of the target's origin from the lower left corner of the page [m]."""
    margins = (np.array(paper.room) - target.size) / 2.0
    return np.array(paper.lower) + margins + [0.0, target.size[1]]


def _draw_squares(pen: Pen, target: CharucoTarget, origin: Array) -> None:
    """Draws black squares and markers; T has y down the page."""
    flip = np.array([1.0, -1.0])
    markers = np.asarray(target.board.getObjPoints())[:, 0, :2]
    white = {tuple(at) for at in np.floor(markers / target.square).astype(int).tolist()}
    columns, rows = target.squares
    black = [(i, j) for j in range(rows) for i in range(columns) if (i, j) not in white]
    squares = []
    for at in black:
        corner = np.array(at) * target.square
        squares.append(
            origin + flip * rectangle(corner.tolist(), (corner + target.square).tolist())
        )
    pen.area(squares, BLACK_RGB, holes=False)
    dictionary = marker_dictionary(target.dictionary)
    bits = int(dictionary.markerSize) + 2
    for number, corner in zip(target.board.getIds().ravel(), markers, strict=True):
        image = dictionary.generateImageMarker(int(number), bits)
        loops = [loop * (target.marker / bits) for loop in cell_outlines(image < 128)]
        pen.area([origin + flip * (corner + loop) for loop in loops], BLACK_RGB)


def _draw_caption(pen: Pen, target: CharucoTarget, paper: Paper) -> None:
    left, base = paper.lower[0] + 0.108, paper.margin
    columns, rows = target.squares
    values = {
        "squares": f"{columns}x{rows}",
        "square": f"{1e3 * target.square:g}",
        "marker": f"{1e3 * target.marker:g}",
        "dictionary": target.dictionary,
    }
    words = [f"{option_name(CharucoTarget, name)} {value}" for name, value in values.items()]
    words += [option_name(CharucoTarget, "legacy")] if target.legacy else []
    pen.text(left, base + 9.0e-3, "Calibration target", 9.0, font=BOLD_FONT, color=TEXT_RGB)
    for k, line in enumerate(
        (
            "Print at 100 %, glue onto something flat and stiff, then",
            "burg-drake camera calibrate PHOTOS -o K.yaml",
            " ".join(words),
        )
    ):
        pen.text(left, base + 5.9e-3 - 2.75e-3 * k, line, 5.5)
