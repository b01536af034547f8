"""Pages of a printed board: their pixels, and where on the board each of them belongs.

The pages come from the command `burg-drake printout`; where they belong is read from the PDF: the
drawing of the whole board is a form that each page places, and dashed lines say where to cut.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium
from numpy.typing import NDArray

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

POINT = 0.0254 / 72
DPI = 300
WITHOUT_OBJECTS = "version: 1\nname: room\nlibrary: household\ninstances: []\n"


@dataclass(frozen=True)
class Board:
    """A board as docs/reference/board.md has it, with that page's defaults.

    Attributes:
        dictionary: OpenCV's name without `DICT_`.
        size: of the board [m].
        side, spacing: of the markers [m].
        count: columns and rows.
        first_id: of the upper left marker.
        scene: whose objects are drawn on it; none if None.
    """

    dictionary: str = "ARUCO_MIP_36h12"
    size: tuple[float, float] = (0.594, 0.420)
    side: float = 0.045
    spacing: float = 0.015
    count: tuple[int, int] = (9, 6)
    first_id: int = 0
    scene: str | None = None

    @property
    def ids(self) -> NDArray[np.int64]:
        """(N,) row by row from the upper left."""
        return self.first_id + np.arange(self.count[0] * self.count[1])

    @property
    def p_SQ(self) -> Array:
        """(N, 4, 2) corners, clockwise from the upper left, as far as the print is right."""
        pitch = self.side + self.spacing
        extent = np.array(self.count) * pitch - self.spacing
        left, bottom = (np.array(self.size) - extent) / 2
        x = left + pitch * np.arange(self.count[0])
        y = bottom + extent[1] - pitch * np.arange(self.count[1])
        first = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 1, 2)
        return first + self.side * np.array([[0, 0], [1, 0], [1, -1], [0, -1.0]])

    def document(self) -> str:
        """The scene with this board; a built-in one keeps its default board.

        Raises:
            ValueError: another board is to have the objects of a scene.
        """
        if self.scene is not None:
            if self != Board(scene=self.scene):
                raise ValueError(f"{self.scene} has its own board; give one or the other")
            return self.scene
        return WITHOUT_OBJECTS + (
            f"board:\n  size: [{self.size[0]}, {self.size[1]}]\n  markers:\n"
            f"    dictionary: {self.dictionary}\n    side: {self.side}\n"
            f"    spacing: {self.spacing}\n    count: [{self.count[0]}, {self.count[1]}]\n"
            f"    first_id: {self.first_id}\n"
        )


@dataclass(frozen=True, eq=False)
class Page:
    """A page, as it was printed.

    Attributes:
        reflectance: (H, W, 3) linear, 255 is bare paper, 0 is solid ink; row 0 is at the top.
        size: width and height [m].
        p_PS: origin of S from the page's lower left corner [m].
        cut_left, cut_top: where it is cut, from there [m]; None if it is not.
    """

    reflectance: Image
    size: tuple[float, float]
    p_PS: tuple[float, float]
    cut_left: float | None = None
    cut_top: float | None = None


@lru_cache(maxsize=8)
def printed(board: Board, page: str = "A2") -> tuple[Page, ...]:
    """The pages of a board, row by row from the upper left, as the command prints them.

    Raises:
        ValueError: the markers in the PDF are not where the documents have them.
    """
    with tempfile.TemporaryDirectory() as folder:
        scene, pdf = board.document(), Path(folder) / "board.pdf"
        if board.scene is None:
            document = Path(folder) / "room.yaml"
            document.write_text(scene)
            scene = str(document)
        command = [sys.executable, "-m", "burg_drake.apps.cli", "printout", scene]
        command.append("--no-instructions")
        subprocess.run([*command, "--page", page, "-o", pdf], check=True, capture_output=True)
        return read_pages(pdf.read_bytes(), board)


def read_pages(pdf: bytes, board: Board | None = None) -> tuple[Page, ...]:
    """The pages of a PDF.

    Args:
        pdf: the document.
        board: whose pages they are; None for any other document, whose pages are as they are.

    Raises:
        ValueError: the markers in the PDF are not where the documents have them.
    """
    pages = []
    with pypdfium2.PdfDocument(pdf) as document:
        for page in document:
            p_PS, (left, top) = (0.0, 0.0), (None, None)
            if board is not None:
                p_PS, (left, top) = _origin(page, board), _cuts(page)
            size = tuple(POINT * side for side in page.get_size())
            pages.append(Page(linear(_rasterised(page)), size, p_PS, left, top))
    return tuple(pages)


def linear(image: Image) -> Image:
    """(H, W, 3) linear reflectance [1/255] of what PDFium drew.

    A pixel on the edge between two colours was mixed of their sRGB values by area, and light mixes
    linearly: the share is found from the darkest and the lightest neighbour.
    """
    levels = np.arange(256) / 255.0
    decoded = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
    decoded *= 255.0
    found = cv2.LUT(image, np.round(decoded).astype(np.uint8))
    around = np.ones((3, 3), np.uint8)
    low, high = cv2.erode(image, around), cv2.dilate(image, around)
    edge = (image > low) & (image < high)
    value, dark, light = (each[edge].astype(int) for each in (image, low, high))
    share = (value - dark) / (light - dark)
    found[edge] = np.round(decoded[dark] + share * (decoded[light] - decoded[dark]))
    return found


def _rasterised(page: pypdfium2.PdfPage) -> Image:
    """(H, W, 3) RGB; PDFium stretches the page to whole pixels."""
    image = page.render(scale=DPI / 72, rev_byteorder=True).to_numpy()
    return np.ascontiguousarray(image[..., :3])


def _origin(page: pypdfium2.PdfPage, board: Board) -> tuple[float, float]:
    """Origin of S on the page [m]: that of the form that draws the whole board.

    Raises:
        ValueError: its markers are not where the documents have them.
    """
    corners = board.p_SQ.reshape(-1, 2)
    expected = np.r_[corners.min(axis=0), corners.max(axis=0)]
    for drawn in page.get_objects(filter=[pdfium.FPDF_PAGEOBJ_PATH], max_depth=3):
        if drawn.level > 0 and np.abs(_bounds(drawn) - expected).max() < 1e-5:
            right, up, x, y = (drawn.container.get_matrix().get()[k] for k in (0, 3, 4, 5))
            if (right, up) == (1.0, 1.0):
                return POINT * x, POINT * y
    raise ValueError(f"the PDF has no markers at {expected.tolist()} [m]; is it of this board?")


def _cuts(page: pypdfium2.PdfPage) -> tuple[float | None, float | None]:
    """Where the page is cut on the left and above [m]: lines across it in that half."""
    width, height = (POINT * side for side in page.get_size())
    left, top = None, None
    for line in page.get_objects(filter=[pdfium.FPDF_PAGEOBJ_PATH], max_depth=1):
        x0, y0, x1, y1 = _bounds(line)
        if x1 - x0 < 1e-3 and y1 - y0 > 0.8 * height and x1 < width / 2:
            left = (x0 + x1) / 2
        if y1 - y0 < 1e-3 and x1 - x0 > 0.8 * width and y0 > height / 2:
            top = (y0 + y1) / 2
    return left, top


def _bounds(drawn: pypdfium2.PdfObject) -> Array:
    """(4,) left, bottom, right, top [m] in the frame of the page or form that it is drawn in."""
    return POINT * np.array(drawn.get_bounds())
