"""The sheet: where the objects' lines may run."""

from __future__ import annotations

import io

import numpy as np
import pytest
from reportlab.pdfgen.canvas import Canvas

from burg_drake.printout import (
    METRES_PER_POINT,
    ObjectDrawing,
    Pen,
    Sheet,
    SheetGrid,
    SheetLayer,
    draw_sheet,
    rectangle,
)
from burg_drake.scene import Markers, marker_layout
from tests.printout.paper import rasterised
from tests.thorough import thorough

DPI = 600
SIZE = (0.06, 0.06)


def lines_everywhere() -> ObjectDrawing:
    """An object whose lines, red on white and light blue on black, cover the sheet."""
    ys = np.arange(0.0, SIZE[1], 1.5e-4)
    hatching = tuple(rectangle((0.0, y), (SIZE[0], y + 1e-6)) for y in ys)
    red, blue = (1.0, 0.0, 0.0), (0.5, 0.5, 1.0)
    nothing = SheetLayer(SheetGrid(SIZE, 1e-3), 0, 0, np.full((1, 1), np.inf, np.float32), 0.0)
    return ObjectDrawing("all", "all", nothing, (), hatching, red, (), red, blue, fixed=False)


@pytest.mark.parametrize(
    ("side", "spacing", "clear"),
    [
        (0.020, 0.015, 1e-3),
        thorough(0.020, 0.001, 4e-4),
        (0.008, 0.004, 5e-4),  # cells of 1 mm
    ],
)
def test_lines_keep_clear_of_the_edges_of_markers(
    side: float, spacing: float, clear: float
) -> None:
    """They run in the middle of gaps and of cells; beside all edges there is none."""
    layout = marker_layout(SIZE, Markers(side=side, spacing=spacing, count=(2, 2)))
    stream = io.BytesIO()
    canvas = Canvas(stream, pagesize=(SIZE[0] / METRES_PER_POINT, SIZE[1] / METRES_PER_POINT))
    draw_sheet(Pen(canvas), Sheet(SIZE, layout, [lines_everywhere()], [], np.zeros((0, 2))))
    canvas.save()
    (image,) = rasterised(stream.getvalue(), DPI, grey=False)
    lined = np.ptp(image.astype(int), axis=-1) > 60
    rows, columns = np.indices(lined.shape)
    pixel = 0.0254 / DPI
    points = np.stack([columns + 0.5, len(lined) - rows - 0.5], axis=-1) * pixel
    middles = layout.p_SQ[:, :, :2].mean(axis=1)
    beyond = np.abs(points[:, :, None] - middles).max(axis=-1) - side / 2
    distance = np.abs(beyond).min(axis=-1)  # in front of an edge; along diagonals, of both edges
    assert not lined[distance < clear - 2 * pixel].any()
    assert lined[(distance > clear + 2 * pixel) & (points < 0.0595).all(axis=-1)].all()
    middle = np.abs(points[:, :, 0] - SIZE[0] / 2) < pixel
    assert lined[middle & (points[:, :, 1] < 0.0595)].all()
