"""Draws on a PDF canvas in metres: lines, areas, words."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from reportlab.pdfbase.pdfmetrics import stringWidth
from reportlab.pdfgen.canvas import FILL_EVEN_ODD, FILL_NON_ZERO, Canvas

from burg_drake.core import Array
from burg_drake.core.terminal import Rgb

POINT = 0.0254 / 72
"""Unit of PDF [m]."""
BLACK: Rgb = (0.0, 0.0, 0.0)
INK: Rgb = (0.16, 0.18, 0.22)
"""Of words and rulers."""
FAINT: Rgb = (0.52, 0.55, 0.60)
"""Of lines that are to be seen and not looked at."""
WHITE: Rgb = (1.0, 1.0, 1.0)
REGULAR, BOLD = "Helvetica", "Helvetica-Bold"


def printable(text: str) -> str:
    """A text in the characters that a PDF's built-in fonts have; `?` for others."""
    return text.encode("cp1252", "replace").decode("cp1252")


def text_width(text: str, size: float, font: str = REGULAR) -> float:
    """Length of a line of text [m]; `size` in points."""
    return float(stringWidth(printable(text), font, size) * POINT)


class Pen:
    """Draws on a canvas in metres; widths of lines too, sizes of text in points."""

    def __init__(self, canvas: Canvas) -> None:
        self.canvas = canvas

    def line(
        self,
        *points: tuple[float, float],
        width: float = 0.15e-3,
        color: Rgb = INK,
        dash: float = 0.0,
    ) -> None:
        """Draws a line through points."""
        self._stroke(width, color, dash)
        self.canvas.drawPath(self._path([np.array(points)], closed=False), stroke=1, fill=0)

    def outline(
        self, polygons: Sequence[Array], width: float, color: Rgb, dash: float = 0.0
    ) -> None:
        """Draws around areas."""
        if polygons:
            self._stroke(width, color, dash)
            self.canvas.drawPath(self._path(polygons), stroke=1, fill=0)

    def area(self, polygons: Sequence[Array], color: Rgb, *, holes: bool = True) -> None:
        """Fills areas, all as one shape.

        Args:
            polygons: (N, 2) each [m].
            color: of the area.
            holes: polygons inside others are holes; else it is those that run the other way round.
        """
        if polygons:
            self.canvas.setFillColorRGB(*color)
            rule = FILL_EVEN_ODD if holes else FILL_NON_ZERO
            self.canvas.drawPath(self._path(polygons), stroke=0, fill=1, fillMode=rule)

    def clip(self, polygons: Sequence[Array]) -> None:
        """Draws only inside of areas until the canvas' state is restored."""
        path = self._path(polygons)
        self.canvas.clipPath(path, stroke=0, fill=0, fillMode=FILL_EVEN_ODD)

    def circle(self, x: float, y: float, radius: float, color: Rgb, width: float) -> None:
        """Draws a circle."""
        self._stroke(width, color)
        self.canvas.circle(x / POINT, y / POINT, radius / POINT, stroke=1, fill=0)

    def text(
        self,
        x: float,
        y: float,
        text: str,
        size: float,
        *,
        font: str = REGULAR,
        color: Rgb = INK,
        align: float = 0.0,
        turned: bool = False,
    ) -> None:
        """Writes a line.

        Args:
            x, y: where its baseline begins [m]; with `align` 0.5 its middle, with 1 its end.
            text: the line.
            size: [points].
            font: of a PDF's built-in ones.
            color: of the text.
            align: share of its length before x.
            turned: reads upwards.
        """
        canvas = self.canvas
        canvas.saveState()
        canvas.translate(x / POINT, y / POINT)
        if turned:
            canvas.rotate(90)
        canvas.setFillColorRGB(*color)
        canvas.setFont(font, size)
        shown = text if font == "ZapfDingbats" else printable(text)
        canvas.drawString(-align * stringWidth(shown, font, size), 0.0, shown)
        canvas.restoreState()

    def _stroke(self, width: float, color: Rgb, dash: float = 0.0) -> None:
        self.canvas.setStrokeColorRGB(*color)
        self.canvas.setLineWidth(width / POINT)
        self.canvas.setLineJoin(1)
        self.canvas.setDash([dash / POINT, dash / POINT] if dash else [])

    def _path(self, polygons: Iterable[Array], *, closed: bool = True) -> Any:
        path = self.canvas.beginPath()
        for polygon in polygons:
            points = (np.asarray(polygon, dtype=float) / POINT).tolist()
            path.moveTo(*points[0])
            for point in points[1:]:
                path.lineTo(*point)
            if closed:
                path.close()
        return path


def rectangle(lower: Sequence[float] | Array, upper: Sequence[float] | Array) -> Array:
    """(4, 2) corners, counter-clockwise from the lower left."""
    (x0, y0), (x1, y1) = lower, upper
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
