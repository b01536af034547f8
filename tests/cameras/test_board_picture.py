"""Top views of the printed board, held against the printout's own pixels."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from burg_drake.cameras import (
    BoardPicture,
    BoardRectifier,
    Intrinsics,
    board_observations,
    board_picture,
    open_source,
    top_view,
)
from burg_drake.core import InvalidInputError, inverse, transform_points
from burg_drake.scene import Board, Markers
from tests.cameras.board_views import view
from tests.cameras.live_views import Pictures
from tests.cameras.paper_photos import photo, shown_at
from tests.cameras.synthetic import levels

BOARD = Board()
VGA = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5))
COARSE = 4e-3
"""Side of a pixel of a top view at which nobody looks [m]."""
TILTED = view((0.3, 0.21), 0.75, 30.0, 40.0, 12.0)
BENT = Intrinsics(
    width=800, height=600, focal=(700.0, 700.0), center=(399.5, 299.5),
    distortion=(-0.12, 0.0, 0.0, 0.0),
)  # fmt: skip


@pytest.fixture(scope="module")
def plain() -> np.ndarray:
    return photo(TILTED, (640, 480), 600.0)


@pytest.fixture(scope="module")
def bent() -> np.ndarray:
    return photo(TILTED, (800, 600), 700.0, -0.12)


def misplaced(picture: BoardPicture) -> np.ndarray:
    """(N,) how far each marker is from its place [m]: the shift between what the top view shows
    around it and what the printout has there."""
    height, width = picture.image.shape[:2]
    (left, low), (right, high) = picture.lower, picture.upper
    x = left + (np.arange(width) + 0.5) * (right - left) / width
    y = high - (np.arange(height) + 0.5) * (high - low) / height
    truth = levels(shown_at(np.stack(np.meshgrid(x, y), axis=-1))).astype(np.float32)
    shown = picture.image.mean(axis=2).astype(np.float32)
    side = (right - left) / width
    found = []
    for p_SQ in BOARD.layout.p_SQ:
        column, row = (p_SQ[:, 0].min() - left) / side, (high - p_SQ[:, 1].max()) / side
        n, margin = round(BOARD.layout.side / side), round(0.006 / side)
        part = np.s_[round(row) - margin : round(row) + n + margin,
                     round(column) - margin : round(column) + n + margin]  # fmt: skip
        window = cv2.createHanningWindow(truth[part].shape[::-1], cv2.CV_32F)
        shift, _ = cv2.phaseCorrelate(truth[part], np.ascontiguousarray(shown[part]), window)
        found.append(side * np.hypot(*shift))
    return np.array(found)


def test_markers_are_at_their_places(plain: np.ndarray) -> None:
    picture = board_picture(plain, BOARD, VGA)
    assert misplaced(picture).max() < 4e-4
    assert (picture.lower, picture.upper) == ((-0.02, -0.02), (0.614, 0.44))
    assert picture.image.shape == (920, 1268, 3)
    assert set(picture.ids) == set(BOARD.layout.ids.tolist())
    assert picture.error < 3e-4
    assert not picture.note


def test_distortion_is_taken_out(bent: np.ndarray) -> None:
    assert misplaced(board_picture(bent, BOARD, BENT, resolution=1e-3)).max() < 3e-4
    wrong = board_picture(bent, BOARD, replace(BENT, distortion=()), resolution=1e-3)
    assert misplaced(wrong).max() > 1e-3
    assert "check the intrinsics" in wrong.note


def test_without_intrinsics(plain: np.ndarray, bent: np.ndarray) -> None:
    for image in (plain, bent):
        picture = board_picture(image, BOARD, resolution=1e-3)
        assert misplaced(picture).max() < 5e-4
        assert picture.error < 1e-3


def test_no_more_pixels_than_graphics_cards_take(
    plain: np.ndarray, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert top_view.MAX_PICTURE_SIDE == 2048
    monkeypatch.setattr(top_view, "MAX_PICTURE_SIDE", 512)
    picture = board_picture(plain, BOARD, VGA, margin=0.0, resolution=1e-4)
    assert picture.image.shape == (362, 512, 3)


@pytest.mark.parametrize("intrinsics", [VGA, None])
def test_refusals(plain: np.ndarray, intrinsics: Intrinsics | None) -> None:
    def why(image: np.ndarray, board: Board) -> str:
        with pytest.raises(InvalidInputError) as error:
            board_picture(image, board, intrinsics, resolution=COARSE)
        return str(error.value)

    assert "no marker of the board" in why(np.full_like(plain, 200), BOARD)
    assert "another board" in why(plain, Board(markers=Markers(first_id=100)))
    assert "another board" in why(plain, Board(markers=Markers(dictionary="4X4_250")))
    fewer = Markers(side=0.045, spacing=0.03)
    assert "another board" in why(plain, Board(markers=fewer))
    larger = Markers(side=0.05, spacing=0.01)
    assert "another board" in why(plain, Board(markers=larger))
    assert "expected RGB, (H, W, 3) uint8" in why(plain[..., 0], BOARD)
    assert "expected RGB, (H, W, 3) uint8" in why(plain.astype(float), BOARD)


@pytest.mark.parametrize("intrinsics", [VGA, None])
def test_a_larger_board_whose_first_row_is_the_same(
    plain: np.ndarray, intrinsics: Intrinsics | None
) -> None:
    smaller = Board(size=(0.42, 0.297))
    columns = len({round(x, 6) for x in smaller.layout.p_SQ[:, 0, 0]})
    image = plain.copy()
    for p_SQ in BOARD.layout.p_SQ[columns : len(smaller.layout.ids)]:  # objects stand on these
        corners = VGA.project(transform_points(inverse(TILTED), p_SQ))
        cv2.fillConvexPoly(image, np.rint(corners).astype(np.int32), (128, 128, 128))
    assert board_picture(image, BOARD, intrinsics, resolution=COARSE).error < 0.001
    with pytest.raises(InvalidInputError, match="another board"):
        board_picture(image, smaller, intrinsics)


def test_numbers_out_of_range() -> None:
    for wrong in ({"margin": -0.01}, {"margin": np.nan}, {"resolution": 0.0}):
        with pytest.raises(InvalidInputError, match=r"margin .* must be at least 0, resolution"):
            BoardRectifier(BOARD, **wrong)  # type: ignore[arg-type]


def test_looks_at_files(plain: np.ndarray, tmp_path: Path) -> None:
    """One shows the board, one does not, one is no image, one has another size."""
    other = np.full_like(plain, 128)
    cv2.imwrite(str(tmp_path / "1.png"), plain)
    cv2.imwrite(str(tmp_path / "2.png"), other)
    (tmp_path / "3.png").write_bytes(b"no image")
    cv2.imwrite(str(tmp_path / "4.png"), plain[::2, ::2])
    with open_source(tmp_path) as source:
        looks = list(board_observations(source, BoardRectifier(BOARD, VGA, resolution=COARSE)))
    assert [look.picture is not None for look in looks] == [True, False, False, False]
    assert looks[0].reason == ""
    assert "no marker of the board in sight" in looks[1].reason
    assert "3.png cannot be read as an image" in looks[2].reason
    assert "320 x 240 pixels" in looks[3].reason


def test_looks_at_a_camera_until_it_is_stopped(plain: np.ndarray) -> None:
    stop = threading.Event()
    camera = Pictures(plain, plain, plain, live=True)
    rectifier = BoardRectifier(BOARD, VGA, resolution=COARSE)
    looks = board_observations(camera, rectifier, period=0.01, stop=stop)
    assert next(looks).picture is not None
    assert next(looks).picture is not None
    stop.set()
    assert list(looks) == []
    assert camera.given == 2
