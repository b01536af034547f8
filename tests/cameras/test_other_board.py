"""Other sheets whose markers fit at a place of the document: told by what is around."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from burg_drake.cameras import BoardPose, WrongBoardCheck
from burg_drake.core import srgb_to_linear
from burg_drake.scene import Board, Markers
from tests.cameras.board_views import CAMERA, SMALL, error, view
from tests.cameras.synthetic import ImageDegradation, board_image, covers_of

BOARD = Board(size=(0.3, 0.24))  # 4 x 3 markers
VIEW = view((0.15, 0.1), 0.55, 25.0, 40.0, 15.0)
STEEP = view((0.15, 0.1), 0.55, 45.0, 250.0, -70.0)


@pytest.fixture(scope="module")
def poses() -> BoardPose:
    return BoardPose(BOARD, SMALL)


@pytest.mark.parametrize("X_SC", [VIEW, STEEP], ids=["view", "steep"])
@pytest.mark.parametrize(
    ("first_id", "ids"),
    [(4, "12, 13, 14 ..."), (1, "4, 8, 12")],
)
def test_another_first_id(poses: BoardPose, X_SC: np.ndarray, first_id: int, ids: str) -> None:
    other = replace(BOARD, markers=Markers(first_id=first_id))
    estimate = poses.estimate(board_image(other, SMALL, X_SC))
    assert not estimate.valid and np.isnan(estimate.X_SC).all()
    assert estimate.reason == (
        f"another board: markers with ids {ids} lie next to those of the document, which has"
        " 4 x 3 from 0 to 11; are count and first_id right?"
    )


@pytest.mark.parametrize("X_SC", [VIEW, STEEP], ids=["view", "steep"])
@pytest.mark.parametrize("first_id", [2, 3])
def test_another_first_id_may_look_like_a_second_print(
    poses: BoardPose, X_SC: np.ndarray, first_id: int
) -> None:
    """Ids that go on in the next row make groups of markers that each fit the document."""
    other = replace(BOARD, markers=Markers(first_id=first_id))
    estimate = poses.estimate(board_image(other, SMALL, X_SC))
    assert not estimate.valid
    assert estimate.reason.startswith("two copies of this board in sight, or another board: 6 of ")
    assert estimate.reason.endswith("or correct columns, rows and first_id")


def test_more_rows_than_the_document_has() -> None:
    board = replace(BOARD, markers=Markers(count=(4, 2)))
    estimate = BoardPose(board, SMALL).estimate(board_image(BOARD, SMALL, VIEW))
    assert not estimate.valid
    assert (
        "ids 8, 9, 10 ... lie next to those of the document, which has 4 x 2 from 0 to 7"
        in estimate.reason
    )


@pytest.mark.parametrize(
    ("markers", "row", "count"),
    [
        (Markers(count=(4, 2)), 3, "count [4, 2] and first_id 0?"),
        (Markers(count=(4, 2), first_id=4), 1, "count [4, 2] and first_id 4?"),
    ],
)
def test_fewer_rows_are_a_doubt(poses: BoardPose, markers: Markers, row: int, count: str) -> None:
    image = board_image(
        replace(BOARD, markers=markers), SMALL, VIEW, look=ImageDegradation(gradient=0.3)
    )
    estimate = poses.estimate(image)
    assert estimate.valid
    assert estimate.reason == (
        f"row {row} of markers from the top is blank paper: is it covered, or is it another board"
        f" with {count}"
    )


def test_this_board_gives_no_alarm(poses: BoardPose) -> None:
    rng = np.random.default_rng(4)
    looks = [
        ImageDegradation(),
        ImageDegradation(gain=0.2, noise=3.0),
        ImageDegradation(blur=1.8, noise=2.0),
        ImageDegradation(gradient=0.6, noise=6.0),
    ]
    valid = 0
    for k in range(6):
        target = rng.uniform([0.1, 0.05], [0.2, 0.16])
        X_SC = view(tuple(target), rng.uniform(0.3, 0.7), 5.0 * k, *rng.uniform(0.0, 360.0, 2))
        covers, _ = covers_of(BOARD.layout, (0.0, 0.5, 0.85)[k % 3], rng, partial=k % 2 == 0)
        image = board_image(BOARD, SMALL, X_SC, covers=covers, look=looks[k % 4], rng=rng)
        estimate = poses.estimate(image)
        assert "another board" not in estimate.reason, k
        valid += estimate.valid
    assert valid >= 5


def test_things_beside_the_board_are_no_markers(poses: BoardPose) -> None:
    """Dark squares and frames in all places around the board, and one marker."""
    image = np.ascontiguousarray(board_image(BOARD, SMALL, VIEW))
    pitch, first = 0.06, BOARD.layout.p_SQ[0].mean(axis=0)
    for column in range(-1, 5):
        for row in (-1, 3):
            middle = first + pitch * np.array([column, -row, 0.0])
            for half, color in ((0.03, 235), (0.0225, 25), (0.017, 235 if column % 2 else 25)):
                p_S = middle + half * np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
                corners = SMALL.project((p_S - VIEW[:3, 3]) @ VIEW[:3, :3])
                cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), (color,) * 3)
    estimate = poses.estimate(image)
    assert estimate.valid and estimate.reason == ""
    assert np.linalg.norm(error(estimate.X_SC, VIEW)[3:]) < 1e-3


def test_frames_are_looked_at_where_the_ring_is() -> None:
    """Every place around the grid reads as what a larger sheet has there, and no other."""
    one = Board(size=(0.1, 0.1), markers=Markers(count=(1, 1), first_id=5))
    X_SC = VIEW.copy()  # marker 5 of the sheet stands where the board of one has its own
    X_SC[:3, 3] -= BOARD.layout.p_SQ[5].mean(axis=0) - one.layout.p_SQ[0].mean(axis=0)
    grey = board_image(BOARD, SMALL, VIEW)[:, :, 1]
    light = srgb_to_linear(grey)
    said = WrongBoardCheck(one, SMALL, (1.0, 1.0)).describe_foreign_markers(grey, light, X_SC)
    assert "ids 0, 1, 2 ..." in said
    assert not WrongBoardCheck(BOARD, SMALL, (1.0, 1.0)).describe_foreign_markers(grey, light, VIEW)


@pytest.mark.parametrize("covered", [False, True], ids=["whole", "each marker once"])
def test_two_copies_of_the_board(covered: bool) -> None:
    left, right = (
        np.array([[0.075, 0.12, 0.075, 0.12, 0.0]]),
        np.array([[0.22, 0.12, 0.07, 0.12, 0.0]]),
    )
    images = [
        board_image(BOARD, CAMERA, view((x, 0.12), 0.65, 0.0, 0.0, 0.0), covers=hidden)
        for x, hidden in ((0.3, right if covered else None), (0.0, left if covered else None))
    ]
    side_by_side = np.hstack([images[0][:, :320], images[1][:, 320:]])
    estimate = BoardPose(BOARD, CAMERA).estimate(side_by_side)
    assert not estimate.valid
    assert estimate.reason.startswith("two copies of this board in sight")
    assert "; remove or cover one" in estimate.reason


@pytest.mark.parametrize("axis", [0, 1])
def test_a_mirrored_image(poses: BoardPose, axis: int) -> None:
    estimate = poses.estimate(np.flip(board_image(BOARD, SMALL, VIEW), axis))
    assert not estimate.valid
    assert estimate.reason.startswith("the image is mirrored: 12 markers of the board can be read")


def test_a_picture_of_something_else_is_not_mirrored(poses: BoardPose) -> None:
    other = replace(BOARD, markers=Markers(first_id=100))
    assert "mirrored" not in poses.estimate(board_image(other, SMALL, VIEW)).reason
