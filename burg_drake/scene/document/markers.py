"""The ArUco markers of a board: their document, and where each corner and cell lies on the sheet.

The one place that knows the board's geometry; printing, rendering and pose estimation take it
from here. All is in the scene frame S (lower left corner of the sheet, x right, y up, z out of it);
OpenCV's own board frames appear nowhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, FieldError, InvalidInputError, nearest

EDGE = 0.010
"""Least distance of automatically placed markers from the sheet's edge [m]: what printers leave
white, and a quiet zone."""


@dataclass(frozen=True, kw_only=True)
class Markers:
    """A grid of ArUco markers in the middle of the board, numbered row by row from the upper left.

    Attributes:
        dictionary: name of the dictionary in OpenCV, without `DICT_`.
        side: length of a marker's side, with its black border [m].
        spacing: width of the gap between markers [m].
        count: number of columns and rows; as many as fit if left out.
        first_id: id of the marker in the upper left corner.
    """

    dictionary: str = "ARUCO_MIP_36h12"
    side: float = 0.045
    spacing: float = 0.015
    count: tuple[int, int] | None = None
    first_id: int = 0

    def __post_init__(self) -> None:
        if not (0.0 < self.side < np.inf and 0.0 < self.spacing < np.inf):
            raise InvalidInputError("side and spacing of markers must be above 0 and finite [m]")
        if self.count is not None and min(self.count) < 1:
            raise FieldError(
                f"count {list(self.count)} must have at least one column and one row", "count"
            )
        if self.first_id < 0:
            raise FieldError(f"first_id {self.first_id} must be at least 0", "first_id")


@dataclass(frozen=True, eq=False)
class MarkerLayout:
    """The markers of a board, placed.

    Attributes:
        dictionary: OpenCV's name of their dictionary, without `DICT_`.
        ids: (N,) numbers in the dictionary, row by row from the upper left.
        p_SQ: (N, 4, 3) corners in the scene frame [m], clockwise from the marker's upper left, the
            order in which ArUco detectors return them.
        black: (N, K, K) cells that are black, border included, rows from the top.
    """

    dictionary: str
    ids: NDArray[np.int32]
    p_SQ: Array
    black: NDArray[np.bool_]

    @property
    def cells(self) -> int:
        """Cells along a marker's side, border included (8 for `ARUCO_MIP_36h12`)."""
        return int(self.black.shape[1])

    @property
    def side(self) -> float:
        """Length of a marker's side [m]."""
        return float(self.p_SQ[0, 1, 0] - self.p_SQ[0, 0, 0])


def marker_dictionary(name: str) -> Any:
    """OpenCV's dictionary of a name (without `DICT_`, in any case).

    Raises:
        InvalidInputError: OpenCV has none of that name.
    """
    import cv2

    known = {key[5:].lower(): key for key in dir(cv2.aruco) if key.startswith("DICT_")}
    key = known.get(name.lower().removeprefix("dict_"))
    if key is None:
        raise InvalidInputError(
            f"marker dictionary {name!r} does not exist;"
            f" {nearest(name, [k[5:] for k in known.values()])}"
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, key))


def marker_layout(size: tuple[float, float], markers: Markers) -> MarkerLayout:
    """Places a board's markers.

    Args:
        size: extents of the sheet along x and y [m].
        markers: of the board.

    Raises:
        InvalidInputError: no marker, or not all of `count`, fit on the sheet; the dictionary does
            not exist or has too few markers.
    """
    import cv2

    pitch = markers.side + markers.spacing
    columns, rows = markers.count or _most(size, markers.side, pitch)
    extent = np.array([columns, rows]) * pitch - markers.spacing
    if min(columns, rows) < 1 or (extent > np.array(size) + 1e-9).any():
        raise InvalidInputError(
            f"markers of {1e3 * markers.side:g} mm with {1e3 * markers.spacing:g} mm between them"
            f" do not fit on a board of {1e3 * size[0]:g} x {1e3 * size[1]:g} mm"
            + (f" {columns} x {rows} times" if markers.count else "")
            + "; give smaller markers or a larger board"
        )
    dictionary = marker_dictionary(markers.dictionary)
    total, available = columns * rows, len(dictionary.bytesList)
    if markers.first_id + total > available:
        raise InvalidInputError(
            f"{total} markers with ids from {markers.first_id} on need more than the "
            f"{available} ids of {markers.dictionary}; give larger markers, a smaller"
            " first_id or another dictionary"
        )
    left, bottom = (np.array(size) - extent) / 2
    x = left + pitch * np.arange(columns)
    y = bottom + pitch * np.arange(rows)[::-1] + markers.side  # upper edges, from the top row on
    grid = np.stack([*np.meshgrid(x, y), np.zeros((rows, columns))], axis=-1)
    square = markers.side * np.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [0, -1, 0]], dtype=float)
    ids = np.arange(markers.first_id, markers.first_id + total, dtype=np.int32)
    cells = dictionary.markerSize + 2
    images = [cv2.aruco.generateImageMarker(dictionary, int(i), cells) for i in ids]
    return MarkerLayout(
        markers.dictionary, ids, grid.reshape(-1, 1, 3) + square, np.array(images) == 0
    )


def _most(size: tuple[float, float], side: float, pitch: float) -> tuple[int, int]:
    """Columns and rows that fit between the edges."""
    columns, rows = (int((s - 2 * EDGE - side) / pitch + 1e-9 + 1.0) for s in size)
    return max(columns, 0), max(rows, 0)
