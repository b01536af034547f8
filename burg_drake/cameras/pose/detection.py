"""Finds a board's markers in an image: which ones, and about where their corners are.

The steps of OpenCV's ArUco detector, with its tolerances, but for one board: at first with the one
threshold window that finds nearly all markers, and with more where that finds few; cells of all
candidates are read at once. Corners are good to some tenths of a pixel; `refinement` makes the
pose exact. Markers of other boards are looked for with OpenCV's detector itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.pose.quadrilaterals import LEAST_CONTRAST, dark_quadrilaterals, read_cells
from burg_drake.core import Array, even_levels, photo_light
from burg_drake.scene.document import MarkerLayout, marker_dictionary

FIRST_SEARCH = ((13,), 15.0)
"""Threshold windows [pixels], and a contrast that markers in fair light have [8-bit levels]: finds
as many markers on boards at 0.5 to 1 m as OpenCV's own values (windows 3, 13 and 23, and 7 levels),
in less than half the time."""
SECOND_SEARCH = ((5, 21, 37), 5.0)
"""For dark or blurred images, or very large markers."""
SEARCHES = (True, FIRST_SEARCH), (False, FIRST_SEARCH), (True, SECOND_SEARCH)
"""Which are made, one after the other, in the levels of the image or in its light: the latter finds
a half more in images of a camera that moves, and a fifth more in dark ones. The last one is for
images in which neither finds a marker."""
SMALLEST = 0.06
"""Least perimeter of a marker, as a share of the image's longer side; cells of a pixel cannot be
read."""
BORDER_ERRORS = 0.35
"""Most cells of a marker's border that may be white, as a share of them: OpenCV's value."""
CORRECTED = 0.6
"""Cells that may be wrong inside, as a share of those that the dictionary can correct: OpenCV's
value."""
SAME_PLACE = 0.5
"""Distance of middles up to which quadrilaterals are one marker, as a share of a side."""
CORNER_WINDOW = (0.3, 1, 5)
"""Half a window in which corners are made exact, as a share of a cell, and its limits [pixels]:
OpenCV's values."""
ENOUGH = 3
"""Markers of the board with which the first look suffices."""
COMMON_DICTIONARIES = (
    "ARUCO_MIP_36h12",
    "4X4_250",
    "5X5_250",
    "6X6_250",
    "7X7_250",
    "APRILTAG_36h11",
    "ARUCO_ORIGINAL",
)
"""What other boards are printed with, to name them."""
FEWEST_OTHER = 2
"""Markers of another dictionary that are not chance."""


@dataclass(frozen=True, eq=False)
class Detection:
    """Markers of a board that were found in an image.

    Attributes:
        index: (N,) which of the layout's markers each is.
        corners: (N, 4, 2) their corners, in the order of the layout's [pixels].
        candidates: number of other squares that may be markers, but not of this board.
        twice: (M,) markers of the layout that are seen at two places or more; not in `index`.
    """

    index: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    corners: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    candidates: int = 0
    twice: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))

    @property
    def count(self) -> int:
        """Markers of the board that were read."""
        return len(self.index) + len(self.twice)


class MarkerDetector:
    """Finds the markers of one board."""

    def __init__(self, layout: MarkerLayout) -> None:
        turned = [np.rot90(layout.black, -turns, axes=(1, 2)) for turns in range(4)]
        self._cells = layout.cells
        self._border = np.pad(np.zeros((layout.cells - 2,) * 2, bool), 1, constant_values=True)
        # (4 N,) of markers turned clockwise by quarters.
        self._patterns = _packed(np.concatenate(turned)[:, ~self._border])
        correctable = marker_dictionary(layout.dictionary).maxCorrectionBits
        self._tolerance = int(CORRECTED * correctable)
        self._enough = min(ENOUGH, len(layout.ids))

    def detect(self, grey: NDArray[np.uint8]) -> Detection:
        """Finds markers in an image (H, W). One that is seen twice counts as not seen."""
        found = Detection()
        for encoded, (windows, constant) in SEARCHES:
            image = grey if encoded else even_levels(photo_light(grey))
            again = self._search(image, windows, constant)
            if again.count >= found.count:
                found = again
            if found.count >= (self._enough if encoded else 1):
                break
        return found

    def _search(
        self, grey: NDArray[np.uint8], windows: tuple[int, ...], constant: float
    ) -> Detection:
        perimeter = SMALLEST * max(grey.shape)
        squares = np.concatenate(
            [dark_quadrilaterals(grey, window, constant, perimeter) for window in windows]
        )
        if not len(squares):
            return Detection()
        black, contrast = read_cells(grey, squares, self._cells)
        inside = _packed(black[:, ~self._border])
        wrong = np.bitwise_count(inside[:, None] ^ self._patterns)
        best = wrong.argmin(axis=1)
        fits = (
            (wrong.min(axis=1) <= self._tolerance)
            & ((~black[:, self._border]).mean(axis=1) <= BORDER_ERRORS)
            & (contrast >= LEAST_CONTRAST)
        )
        turns, index = np.divmod(best[fits], len(self._patterns) // 4)
        first = (np.arange(4) + turns[:, None]) % 4
        corners = np.take_along_axis(squares[fits], first[..., None], axis=1)
        index, corners, twice = _without_duplicates(index, corners)
        return Detection(index, self._refined_corners(grey, corners), int((~fits).sum()), twice)

    def _refined_corners(self, grey: NDArray[np.uint8], corners: Array) -> Array:
        """Corners where the lines of both of their sides meet."""
        import cv2

        if not len(corners):
            return corners
        # Contours run through the middles of dark pixels, half a pixel inside.
        side = corners - np.roll(corners, 1, axis=1)
        direction = side / np.sqrt((side**2).sum(axis=2, keepdims=True))
        corners = corners + 0.5 * (direction - np.roll(direction, -1, axis=1))
        cell = side_lengths(corners).min() / self._cells
        share, least, most = CORNER_WINDOW
        half = int(np.clip(np.rint(share * cell), least, most))
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.1)  # OpenCV's values
        flat = np.ascontiguousarray(corners.reshape(-1, 1, 2), dtype=np.float32)
        exact = cv2.cornerSubPix(grey, flat, (half, half), (-1, -1), criteria)
        return np.asarray(exact, dtype=float).reshape(-1, 4, 2)


def _packed(cells: NDArray[np.bool_]) -> NDArray[np.uint64]:
    """(N,) cells (N, K) as the bits of a number; dictionaries have 49 at most."""
    bits = np.uint64(1) << np.arange(cells.shape[1], dtype=np.uint64)
    return np.asarray(np.where(cells, bits, np.uint64(0)).sum(axis=1, dtype=np.uint64))


def side_lengths(corners: Array) -> Array:
    """(N,) mean lengths of the sides of quadrilaterals (N, 4, 2 or 3)."""
    side = corners - np.roll(corners, 1, axis=1)
    return np.asarray(np.sqrt((side**2).sum(axis=2)).mean(axis=1))


def _without_duplicates(
    index: NDArray[np.intp], corners: Array
) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Markers that are seen at one place, by the largest quadrilateral there, and those that are
    seen at several."""
    side, middle = side_lengths(corners), corners.mean(axis=1)
    order = np.lexsort((-side, index))
    index, corners, side, middle = index[order], corners[order], side[order], middle[order]
    values, first, which = np.unique(index, return_index=True, return_inverse=True)
    largest = first[which]
    elsewhere = np.abs(middle - middle[largest]).max(axis=1) > SAME_PLACE * side[largest]
    once = ~np.isin(values, index[elsewhere])
    return values[once], corners[first[once]], values[~once]


@dataclass(frozen=True)
class OtherMarkers:
    """Markers that are not of a board.

    Attributes:
        dictionary: OpenCV's name of theirs, without `DICT_`.
        ids: their numbers.
    """

    dictionary: str
    ids: tuple[int, ...]


def other_markers(grey: NDArray[np.uint8], layout: MarkerLayout) -> OtherMarkers | None:
    """Looks for markers that a board does not have: of its dictionary, and of common others.

    Takes as long as eight detections.

    Returns:
        Those of the dictionary of which there are most; None if there are fewer than `FEWEST_OTHER`
        of each.
    """
    best: OtherMarkers | None = None
    names = {name.lower(): name for name in (*COMMON_DICTIONARIES, layout.dictionary)}
    for name in names.values():
        ids = _opencv_detector(marker_dictionary(name)).detectMarkers(grey)[1]
        found = tuple(sorted({int(i) for i in np.ravel([] if ids is None else ids)}))
        if len(found) >= FEWEST_OTHER and (best is None or len(found) > len(best.ids)):
            best = OtherMarkers(name, found)
    return best


def _opencv_detector(dictionary: Any) -> Any:
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    (window,), constant = FIRST_SEARCH
    parameters.adaptiveThreshWinSizeMin = parameters.adaptiveThreshWinSizeMax = window
    parameters.adaptiveThreshConstant = constant
    parameters.minMarkerPerimeterRate = SMALLEST
    return cv2.aruco.ArucoDetector(dictionary, parameters)
