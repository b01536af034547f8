"""Finds a board's markers in an image: which ones, and about where their corners are.

OpenCV's ArUco detector, at first with the one threshold window that finds nearly all markers, and
with more where that finds few. Corners are good to some tenths of a pixel; `edge_refinement` makes
the pose exact.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.frames import Array
from burg_drake.scene.markers import MarkerLayout, marker_dictionary

FIRST_LOOK = {
    "adaptiveThreshWinSizeMin": 13,
    "adaptiveThreshWinSizeMax": 13,
    "adaptiveThreshConstant": 15,
}
"""One threshold window [pixels], and a contrast that markers in fair light have [8-bit levels]:
finds as many markers on boards at 0.5 to 1 m as OpenCV's own values (windows 3, 13 and 23, and 7
levels), in less than half the time."""
SECOND_LOOK = {
    "adaptiveThreshWinSizeMin": 5,
    "adaptiveThreshWinSizeMax": 37,
    "adaptiveThreshWinSizeStep": 16,
    "adaptiveThreshConstant": 5,
}
"""For dark or blurred images, or very large markers."""
SMALLEST = 0.06
"""Least perimeter of a marker, as a share of the image's longer side; cells of a pixel cannot be
read."""
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
    """

    index: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    corners: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    candidates: int = 0


class MarkerDetector:
    """Finds the markers of one board, and knows no others: OpenCV compares every square with every
    marker of its dictionary, which takes longer than all else if there are many of both."""

    def __init__(self, layout: MarkerLayout) -> None:
        import cv2

        whole = marker_dictionary(layout.dictionary)
        ours = cv2.aruco.Dictionary(
            whole.bytesList[layout.ids], whole.markerSize, whole.maxCorrectionBits
        )
        self._looks = [_detector(ours, look) for look in (FIRST_LOOK, SECOND_LOOK)]
        self._enough = min(ENOUGH, len(layout.ids))

    def detect(self, grey: NDArray[np.uint8]) -> Detection:
        """Finds markers in an image (H, W). One that is seen twice counts as not seen."""
        found = Detection()
        for look in self._looks:
            again = _unique(*look.detectMarkers(grey))
            if len(again.index) >= len(found.index):
                found = again
            if len(found.index) >= self._enough:
                break
        return found


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
        ids = _detector(marker_dictionary(name), FIRST_LOOK).detectMarkers(grey)[1]
        found = tuple(sorted({int(i) for i in np.ravel([] if ids is None else ids)}))
        if len(found) >= FEWEST_OTHER and (best is None or len(found) > len(best.ids)):
            best = OtherMarkers(name, found)
    return best


def _unique(corners: Any, ids: Any, rejected: Any) -> Detection:
    if ids is None or len(ids) == 0:
        return Detection(candidates=len(rejected))
    index = np.asarray(ids, dtype=np.intp).ravel()
    values, counts = np.unique(index, return_counts=True)
    once = np.isin(index, values[counts == 1])
    places = np.asarray(corners, dtype=float).reshape(-1, 4, 2)
    return Detection(index[once], places[once], len(rejected))


def _detector(dictionary: Any, look: dict[str, int]) -> Any:
    import cv2

    parameters = cv2.aruco.DetectorParameters()
    parameters.minMarkerPerimeterRate = SMALLEST
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    for name, value in look.items():
        setattr(parameters, name, value)
    return cv2.aruco.ArucoDetector(dictionary, parameters)
