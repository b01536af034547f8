"""Marker layouts: where they lie, what fits, and that OpenCV's own board agrees."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from burg_drake.core import InvalidInputError
from burg_drake.scene import Board, Markers, marker_dictionary, marker_layout

A2 = (0.594, 0.420)


@pytest.mark.parametrize(
    "markers",
    [
        Markers(),
        Markers(dictionary="4X4_250", side=0.057, spacing=0.019, count=(7, 5)),
        Markers(dictionary="DICT_6x6_100", side=0.03, spacing=0.012, first_id=7, count=(3, 2)),
    ],
)
def test_as_opencv_lays_it_out(markers: Markers) -> None:
    """OpenCV's grid board, turned from its frame (y down) into ours (y up), corner for corner."""
    layout = marker_layout(A2, markers)
    columns = len(np.unique(layout.p_SQ[:, 0, 0].round(9)))
    rows = len(np.unique(layout.p_SQ[:, 0, 1].round(9)))
    dictionary = marker_dictionary(markers.dictionary)
    board = cv2.aruco.GridBoard(
        (columns, rows), markers.side, markers.spacing, dictionary, layout.ids
    )
    theirs = np.array(board.getObjPoints(), dtype=float)
    turned = np.stack([theirs[..., 0], -theirs[..., 1], 0 * theirs[..., 2]], axis=-1)
    shift = layout.p_SQ[0, 0] - turned[0, 0]
    assert np.allclose(turned + shift, layout.p_SQ, atol=1e-7)
    middle = (layout.p_SQ.reshape(-1, 3).min(axis=0) + layout.p_SQ.reshape(-1, 3).max(axis=0)) / 2
    assert np.allclose(middle[:2], np.array(A2) / 2)


def test_cells_are_what_a_detector_reads() -> None:
    layout = marker_layout(A2, Markers())
    assert layout.cells == 8 and layout.side == pytest.approx(0.045)
    detector = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_ARUCO_MIP_36h12)
    )
    for number, black in zip(layout.ids, layout.black, strict=True):
        image = np.kron(np.where(np.pad(black, 2), 0, 255), np.ones((9, 9))).astype(np.uint8)
        image[:18], image[-18:], image[:, :18], image[:, -18:] = 255, 255, 255, 255
        _, ids, _ = detector.detectMarkers(image)
        assert ids.ravel().tolist() == [number]


def test_as_many_as_fit() -> None:
    assert len(marker_layout(A2, Markers()).ids) == 9 * 6
    corners = marker_layout(A2, Markers(side=0.05, spacing=0.01)).p_SQ[..., :2]
    assert corners.min() >= 0.010 and (corners <= np.array(A2) - 0.010).all()
    # Exactly one marker between the edges, and none if the sheet is a hair smaller.
    assert len(marker_layout((0.065, 0.065), Markers()).ids) == 1
    with pytest.raises(InvalidInputError, match=r"do not fit on a board of 64\.9 x 65 mm; give"):
        marker_layout((0.0649, 0.065), Markers())


@pytest.mark.parametrize(
    ("markers", "message"),
    [
        (Markers(count=(11, 2)), r"do not fit on a board of 594 x 420 mm 11 x 2 times"),
        (Markers(dictionary="ARUCO_MIP_36h21"), r"did you mean 'ARUCO_MIP_36h12'\?"),
        (
            Markers(first_id=200),
            "54 markers with ids from 200 on need more than the 250",
        ),
    ],
)
def test_what_cannot_be_laid_out(markers: Markers, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        marker_layout(A2, markers)


def test_documents_are_checked() -> None:
    with pytest.raises(InvalidInputError, match="side and spacing of markers must be above 0"):
        Markers(side=0.0)
    for wrong in (float("nan"), float("inf")):
        with pytest.raises(InvalidInputError, match="above 0 and finite"):
            Markers(side=wrong)
        with pytest.raises(InvalidInputError, match="above 0 and finite"):
            Markers(spacing=wrong)
    with pytest.raises(InvalidInputError, match="must have at least one column and one row"):
        Markers(count=(0, 3))
    assert Board().layout.ids[0] == 0
