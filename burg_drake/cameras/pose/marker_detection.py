"""Detect a board's markers in an image: identify them and locate their corners."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, Booleans, Bytes, Indices, Single, linear_levels, srgb_to_linear
from burg_drake.scene import MarkerLayout, marker_dictionary

MIN_CELL_CONTRAST = 10.0
"""Least contrast of black and white cells of a marker, in 8-bit levels."""


def find_dark_quadrilaterals(grey: Bytes, window: int, constant: float, perimeter: float) -> Array:
    """(N, 4, 2) corners of dark quadrilaterals, clockwise in the image [pixels].

    Args:
        grey: (H, W) image.
        window: odd side of the neighbourhood whose mean is the threshold [pixels].
        constant: least difference to the mean [8-bit levels].
        perimeter: least length of a contour [pixels].
    """
    border = 3  # Pixels between corners and the image's border: OpenCV's value.

    dark = cv2.adaptiveThreshold(
        grey, 255.0, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, window, constant
    )
    contours, _ = cv2.findContours(dark, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
    found, lengths = [], []
    for contour in contours:
        if len(contour) < 4:  # specks, most of all contours
            continue
        length = cv2.arcLength(contour, True)
        if length >= perimeter:
            # Fraction of the contour's length: OpenCV's value.
            polygon = cv2.approxPolyDP(contour, 0.03 * length, True)
            if len(polygon) == 4:
                found.append(polygon)
                lengths.append(length)
    if not found:
        return np.empty((0, 4, 2))
    corners = np.asarray(found, dtype=float).reshape(-1, 4, 2)
    side = np.roll(corners, -1, axis=1) - corners
    turn = side[..., 0] * np.roll(side[..., 1], -1, 1) - side[..., 1] * np.roll(side[..., 0], -1, 1)
    convex = (turn > 0.0).all(axis=1) | (turn < 0.0).all(axis=1)
    shortest = np.sqrt((side**2).sum(axis=2)).min(axis=1)
    limit = np.array([grey.shape[1], grey.shape[0]]) - 1 - border
    inside = ((corners >= border) & (corners <= limit)).all(axis=(1, 2))
    corners[turn[:, 0] < 0.0] = corners[turn[:, 0] < 0.0, ::-1]
    # Fraction of the contour's length: OpenCV's value.
    chosen: Array = corners[convex & inside & (shortest >= 0.05 * np.array(lengths))]
    return chosen


def read_cells(grey: Bytes, corners: Array, cells: int) -> tuple[Booleans, Array]:
    """Reads the black cells of quadrilaterals, in rows from the first corner toward the second.

    Args:
        grey: (H, W) image.
        corners: (N, 4, 2), see `find_dark_quadrilaterals`.
        cells: number of cells along a side.

    Returns:
        (N, cells, cells) True for black, and (N,) contrasts of black and white [8-bit levels].
    """
    sample_offsets = (-0.2, 0.2)  # Cells from the middle of a cell, along both axes.

    at = (np.arange(cells)[:, None] + 0.5 + sample_offsets).ravel() / cells
    x, y = np.meshgrid(at, at)
    u, v = _from_unit_square(corners, x.ravel(), y.ravel())
    values = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    n = len(sample_offsets)
    shaped = values.astype(float).reshape(len(corners), cells, n, cells, n)
    means = sum(shaped[:, :, i, :, j] for i in range(n) for j in range(n)) / n**2
    return _otsu_split(means.reshape(len(corners), -1), means.shape)


def _from_unit_square(corners: Array, x: Array, y: Array) -> tuple[Single, Single]:
    """(N, M) columns and rows of points of the unit square, mapped by the homographies to
    quadrilaterals (Heckbert, Fundamentals of Texture Mapping, 1989, section 2.2).
    """
    a, b, c, d = corners.transpose(1, 0, 2)
    (bx, by), (dx, dy), (sx, sy) = (b - c).T, (d - c).T, (a - b + c - d).T
    det = bx * dy - dx * by
    g, h = (sx * dy - dx * sy) / det, (bx * sy - sx * by) / det
    along_x, along_y = b - a + g[:, None] * b, d - a + h[:, None] * d
    u = along_x[:, :1] * x + along_y[:, :1] * y + a[:, :1]
    v = along_x[:, 1:] * x + along_y[:, 1:] * y + a[:, 1:]
    w = g[:, None] * x + h[:, None] * y + 1.0
    return (u / w).astype(np.float32), (v / w).astype(np.float32)


def _otsu_split(means: Array, shape: tuple[int, ...]) -> tuple[Booleans, Array]:
    """Splits each row of brightnesses where the between-class variance is largest (Otsu, A
    Threshold Selection Method from Gray-Level Histograms, 1979).
    """
    ordered = np.sort(means, axis=1)
    count = np.arange(1, means.shape[1])
    total = np.cumsum(ordered, axis=1)
    lower = total[:, :-1] / count
    upper = (total[:, -1:] - total[:, :-1]) / (means.shape[1] - count)
    best = (count * (means.shape[1] - count) * (upper - lower) ** 2).argmax(axis=1)[:, None]
    limit = np.take_along_axis(ordered, best, axis=1)
    contrast = np.take_along_axis(upper - lower, best, axis=1)[:, 0]
    return (means <= limit).reshape(shape), contrast


FIRST_SEARCH = ((13,), 15.0)
"""Threshold windows in pixels, and contrast in 8-bit levels, for fair light."""
MARKER_SEARCHES = (True, FIRST_SEARCH), (False, FIRST_SEARCH), (True, ((5, 21, 37), 5.0))
"""Use of the encoded image (or its linear light), windows and contrast of each search."""
MIN_PERIMETER = 0.06
"""Least perimeter of a marker, as a fraction of the image's longer side."""
MAX_BORDER_ERRORS = 0.35
"""Fraction of a marker's border cells that may be white: OpenCV's value."""
MAX_BIT_CORRECTION = 0.6
"""Fraction of the correctable cells that may be wrong: OpenCV's value."""
MIN_FOREIGN_MARKERS = 2
"""Least number of foreign markers that are not found by chance."""


@dataclass(frozen=True, eq=False)
class Detection:
    """Markers of a board that were found in an image.

    Attributes:
        index: (N,) indices into the layout's markers.
        corners: (N, 4, 2) corners of these markers, in the layout's order [pixels].
        candidates: number of other squares, which may be markers of another board.
        duplicated: (M,) indices of markers that were found at several places; not in `index`.
    """

    index: Indices = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    corners: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    candidates: int = 0
    duplicated: Indices = field(default_factory=lambda: np.empty(0, dtype=np.intp))

    @property
    def count(self) -> int:
        """Number of the board's markers that were read."""
        return len(self.index) + len(self.duplicated)


class MarkerDetector:
    """Finds the markers of one board."""

    def __init__(self, layout: MarkerLayout) -> None:
        turned = [np.rot90(layout.black, -turns, axes=(1, 2)) for turns in range(4)]
        self._cells = layout.cells
        self._border = np.pad(np.zeros((layout.cells - 2,) * 2, bool), 1, constant_values=True)
        # (4 N,) patterns of the markers, turned clockwise by quarter turns.
        self._patterns = _pack_bits(np.concatenate(turned)[:, ~self._border])
        correctable = marker_dictionary(layout.dictionary).maxCorrectionBits
        self._tolerance = int(MAX_BIT_CORRECTION * correctable)
        self._sufficient_count = min(3, len(layout.ids))  # markers with which the search ends

    def detect(self, grey: Bytes) -> Detection:
        """Finds markers in an image (H, W). Markers that are found twice are left out."""
        found = Detection()
        for encoded, (windows, constant) in MARKER_SEARCHES:
            image = grey if encoded else linear_levels(srgb_to_linear(grey))
            again = self._search(image, windows, constant)
            if again.count >= found.count:
                found = again
            if found.count >= (self._sufficient_count if encoded else 1):
                break
        return found

    def _search(self, grey: Bytes, windows: tuple[int, ...], constant: float) -> Detection:
        perimeter = MIN_PERIMETER * max(grey.shape)
        squares = np.concatenate(
            [find_dark_quadrilaterals(grey, window, constant, perimeter) for window in windows]
        )
        if not len(squares):
            return Detection()
        black, contrast = read_cells(grey, squares, self._cells)
        inside = _pack_bits(black[:, ~self._border])
        bit_errors = np.bitwise_count(inside[:, None] ^ self._patterns)
        best = bit_errors.argmin(axis=1)
        fits = (
            (bit_errors.min(axis=1) <= self._tolerance)
            & ((~black[:, self._border]).mean(axis=1) <= MAX_BORDER_ERRORS)
            & (contrast >= MIN_CELL_CONTRAST)
        )
        turns, index = np.divmod(best[fits], len(self._patterns) // 4)
        first = (np.arange(4) + turns[:, None]) % 4
        corners = np.take_along_axis(squares[fits], first[..., None], axis=1)
        index, corners, twice = _remove_duplicates(index, corners)
        return Detection(index, self._refined_corners(grey, corners), int((~fits).sum()), twice)

    def _refined_corners(self, grey: Bytes, corners: Array) -> Array:
        """Refines corners to the intersections of the sides' lines."""

        if not len(corners):
            return corners
        # Contours run through the middles of dark pixels, half a pixel inside.
        side = corners - np.roll(corners, 1, axis=1)
        direction = side / np.sqrt((side**2).sum(axis=2, keepdims=True))
        corners = corners + 0.5 * (direction - np.roll(direction, -1, axis=1))
        cell = side_lengths(corners).min() / self._cells
        half = int(np.clip(np.rint(0.3 * cell), 1, 5))  # OpenCV's values
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.1)  # OpenCV's values
        flat = np.ascontiguousarray(corners.reshape(-1, 1, 2), dtype=np.float32)
        exact = cv2.cornerSubPix(grey, flat, (half, half), (-1, -1), criteria)
        return np.asarray(exact, dtype=float).reshape(-1, 4, 2)


def _pack_bits(cells: Booleans) -> NDArray[np.uint64]:
    """(N,) integers whose bits are the cells (N, K); dictionaries have at most 49 bits."""
    bits = np.uint64(1) << np.arange(cells.shape[1], dtype=np.uint64)
    return np.asarray(np.where(cells, bits, np.uint64(0)).sum(axis=1, dtype=np.uint64))


def side_lengths(corners: Array) -> Array:
    """(N,) mean lengths of the sides of quadrilaterals (N, 4, 2 or 3)."""
    side = corners - np.roll(corners, 1, axis=1)
    return np.asarray(np.sqrt((side**2).sum(axis=2)).mean(axis=1))


def _remove_duplicates(index: Indices, corners: Array) -> tuple[Indices, Array, Indices]:
    """Removes duplicates: keeps the largest quadrilateral of a marker that was found at one place.

    Returns:
        Indices and corners of the markers at one place, and indices of markers at several places.
    """
    side, middle = side_lengths(corners), corners.mean(axis=1)
    order = np.lexsort((-side, index))
    index, corners, side, middle = index[order], corners[order], side[order], middle[order]
    values, first, which = np.unique(index, return_index=True, return_inverse=True)
    largest = first[which]
    # Quadrilaterals within half a side of each other are one marker.
    elsewhere = np.abs(middle - middle[largest]).max(axis=1) > 0.5 * side[largest]
    once = ~np.isin(values, index[elsewhere])
    return values[once], corners[first[once]], values[~once]


@dataclass(frozen=True)
class ForeignMarkers:
    """Markers that do not belong to a board.

    Attributes:
        dictionary: OpenCV's name of the markers' dictionary, without `DICT_`.
        ids: numbers of the markers.
    """

    dictionary: str
    ids: tuple[int, ...]


def format_ids(ids: tuple[int, ...] | list[int]) -> str:
    """The first ids as text."""
    return ", ".join(map(str, ids[:3])) + (" ..." if len(ids) > 3 else "")


def no_markers_reason(grey: Bytes, layout: MarkerLayout, candidates: int) -> str:
    """Explains why no marker of a board was found in an image (H, W)."""
    other = find_foreign_markers(grey, layout) if candidates else None
    if other is None:
        return "no marker of the board in sight"
    start = f"another board: {format_marker_count(len(other.ids))} of {other.dictionary}"
    if other.dictionary == layout.dictionary:
        return (
            f"{start} with ids {format_ids(other.ids)} in sight, but this one has"
            f" {layout.ids[0]} to {layout.ids[-1]}; is first_id right?"
        )
    return f"{start} in sight, but this one has {layout.dictionary}"


def misplaced_reason(count: int, fit: int) -> str:
    """Explains that the markers are of another board, as only some are in their places."""
    return (
        f"another board: only {fit} of {format_marker_count(count)} in sight are where this one"
        " has them; are columns, rows and first_id right?"
    )


def format_marker_count(count: int) -> str:
    """A number of markers as text."""
    return "1 marker" if count == 1 else f"{count} markers"


def find_foreign_markers(grey: Bytes, layout: MarkerLayout) -> ForeignMarkers | None:
    """Finds markers that a board does not have, of its dictionary and other common ones.

    Takes as long as eight detections.

    Returns:
        The markers of the most frequent dictionary; None if fewer than `MIN_FOREIGN_MARKERS`.
    """
    # Dictionaries of other boards.
    others = ["ARUCO_MIP_36h12", "4X4_250", "5X5_250", "6X6_250", "7X7_250", "APRILTAG_36h11"]
    others += ["ARUCO_ORIGINAL", layout.dictionary]
    best: ForeignMarkers | None = None
    names = {name.lower(): name for name in others}
    for name in names.values():
        ids = _opencv_detector(marker_dictionary(name)).detectMarkers(grey)[1]
        found = tuple(sorted({int(i) for i in np.ravel([] if ids is None else ids)}))
        if len(found) >= MIN_FOREIGN_MARKERS and (best is None or len(found) > len(best.ids)):
            best = ForeignMarkers(name, found)
    return best


def _opencv_detector(dictionary: Any) -> Any:

    parameters = cv2.aruco.DetectorParameters()
    (window,), constant = FIRST_SEARCH
    parameters.adaptiveThreshWinSizeMin = parameters.adaptiveThreshWinSizeMax = window
    parameters.adaptiveThreshConstant = constant
    parameters.minMarkerPerimeterRate = MIN_PERIMETER
    return cv2.aruco.ArucoDetector(dictionary, parameters)
