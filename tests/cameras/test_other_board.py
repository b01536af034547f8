"""Sheets whose markers fit at a place of the document, but are of another: told by what is around."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from burg_drake.cameras.board_pose import BoardPose
from burg_drake.cameras.other_board import OtherBoard
from burg_drake.cameras.synthetic import Look, board_image, covers_of
from burg_drake.scene.markers import Markers
from burg_drake.scene.scene import Board
from tests.cameras.board_views import CAMERA, error, view

BOARD = Board()
VIEW = view((0.29, 0.2), 0.85, 25.0, 40.0, 15.0)
STEEP = view((0.29, 0.2), 0.8, 50.0, 250.0, -70.0)


@pytest.fixture(scope="module")
def poses() -> BoardPose:
    return BoardPose(BOARD, CAMERA)


@pytest.mark.parametrize("X_SC", [VIEW, STEEP], ids=["view", "steep"])
@pytest.mark.parametrize(
    ("first_id", "ids"),
    [(9, "54, 55, 56 ..."), (1, "9, 18, 27 ..."), (18, "54, 55, 56 ...")],
)
def test_another_first_id(poses: BoardPose, X_SC: np.ndarray, first_id: int, ids: str) -> None:
    other = replace(BOARD, markers=Markers(first_id=first_id))
    estimate = poses.estimate(board_image(other, CAMERA, X_SC))
    assert not estimate.valid and np.isnan(estimate.X_SC).all()
    if X_SC is VIEW:
        assert estimate.reason == (
            f"another board: markers beyond those that the document has in sight, ids {ids}; it has"
            " 9 x 6 from 0 to 53: are count and first_id right?"
        )


def test_more_rows_than_the_document_has() -> None:
    board = replace(BOARD, markers=Markers(count=(9, 5)))
    estimate = BoardPose(board, CAMERA).estimate(board_image(BOARD, CAMERA, VIEW))
    assert not estimate.valid
    assert "ids 45, 46, 47 ...; it has 9 x 5 from 0 to 44" in estimate.reason


@pytest.mark.parametrize(
    ("markers", "row", "count"),
    [
        (Markers(count=(9, 5)), 6, "count [9, 5], first_id 0?"),
        (Markers(count=(9, 4)), 5, "count [9, 4], first_id 0?"),
        (Markers(count=(9, 5), first_id=9), 1, "count [9, 5], first_id 9?"),
    ],
)
def test_fewer_rows_are_a_doubt(poses: BoardPose, markers: Markers, row: int, count: str) -> None:
    image = board_image(replace(BOARD, markers=markers), CAMERA, VIEW, look=Look(gradient=0.3))
    estimate = poses.estimate(image)
    assert estimate.valid
    assert estimate.reason == (
        f"blank paper where the document has row {row} of markers from the top: covered, or another"
        f" board ({count})"
    )


def test_this_board_gives_no_alarm(poses: BoardPose) -> None:
    rng = np.random.default_rng(4)
    looks = [
        Look(),
        Look(gain=0.2, noise=3.0),
        Look(blur=1.8, noise=2.0),
        Look(gradient=0.6, noise=6.0),
    ]
    valid = 0
    for k in range(16):
        target = rng.uniform([0.2, 0.1], [0.4, 0.3])
        X_SC = view(tuple(target), rng.uniform(0.4, 1.2), 4.0 * k, *rng.uniform(0.0, 360.0, 2))
        covers, _ = covers_of(BOARD.layout, (0.0, 0.5, 0.85)[k % 3], rng, partial=k % 2 == 0)
        image = board_image(BOARD, CAMERA, X_SC, covers=covers, look=looks[k % 4], rng=rng)
        estimate = poses.estimate(image)
        assert "another board" not in estimate.reason, k
        valid += estimate.valid
    assert valid >= 14


def test_things_beside_the_board_are_no_markers(poses: BoardPose) -> None:
    """Dark squares and frames in all places around the board, and one marker."""
    image = np.ascontiguousarray(board_image(BOARD, CAMERA, VIEW))
    pitch, first = 0.06, BOARD.layout.p_SQ[0].mean(axis=0)
    for column in range(-1, 10):
        for row in (-1, 6):
            middle = first + pitch * np.array([column, -row, 0.0])
            for half, color in ((0.03, 235), (0.0225, 25), (0.017, 235 if column % 2 else 25)):
                p_S = middle + half * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
                corners = CAMERA.project((p_S - VIEW[:3, 3]) @ VIEW[:3, :3])
                cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), (color,) * 3)
    estimate = poses.estimate(image)
    assert estimate.valid and estimate.reason == ""
    assert np.linalg.norm(error(estimate.X_SC, VIEW)[3:]) < 1e-3


def test_frames_are_looked_at_where_the_ring_is() -> None:
    """Every place around the grid reads as what a larger sheet has there, and no other."""
    small = Board(markers=Markers(count=(1, 1), first_id=30))
    middle = BOARD.layout.p_SQ[30].mean(axis=0) - small.layout.p_SQ[0].mean(axis=0)
    X_SC = VIEW.copy()
    X_SC[:3, 3] -= middle  # marker 30 of the larger sheet stands where the small one has its own
    grey = board_image(BOARD, CAMERA, VIEW)[:, :, 1]
    said = OtherBoard(small, CAMERA, (1.0, 1.0)).beyond(grey, X_SC, 200.0)
    assert "ids 20, 21, 22 ..." in said
    assert not OtherBoard(BOARD, CAMERA, (1.0, 1.0)).beyond(grey, VIEW, 200.0)
