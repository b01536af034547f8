"""All that looks through a fisheye: the board's pose, the overlay, straightened images, top views.

Images are of the printed board with known truth, through OpenCV's fisheye formula.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from burg_drake.cameras import (
    BoardPose,
    FieldOfView,
    Intrinsics,
    Overlay,
    Undistortion,
    board_picture,
)
from burg_drake.core import InvalidInputError
from burg_drake.dataset import View
from burg_drake.scene import Board, load_scene
from tests.cameras.board_views import error, view
from tests.cameras.synthetic import ImageDegradation, board_image

BOARD = Board()
FISHEYE = Intrinsics(
    width=1280,
    height=720,
    focal=(430.0, 431.0),
    center=(643.0, 356.0),
    model="fisheye",
    distortion=(0.03, -0.02, 0.006, -0.001),
)
"""Sees 170 degrees across."""
PINHOLE = replace(FISHEYE, model="perspective", distortion=())
VIEWS = [
    view((0.29, 0.2), 0.45, 25.0, 40.0, 15.0),
    view((0.15, 0.1), 0.35, 40.0, 200.0, 100.0),
    view((0.8, 0.2), 0.35, 10.0, 0.0, 10.0),  # the board to one side
]


@pytest.fixture(scope="module")
def images() -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    look = ImageDegradation(blur=0.6, noise=4.0)
    return [board_image(BOARD, FISHEYE, X_SC, look=look, rng=rng) for X_SC in VIEWS]


@pytest.mark.parametrize("number", range(len(VIEWS)))
def test_the_pose_is_as_exact_as_through_other_lenses(
    images: list[np.ndarray], number: int
) -> None:
    estimate = BoardPose(BOARD, FISHEYE).estimate(images[number])
    assert estimate.valid, estimate.reason
    off = error(estimate.X_SC, VIEWS[number])
    assert 1e3 * np.linalg.norm(off[3:]) < 0.15
    assert np.degrees(np.linalg.norm(off[:3])) < 0.02
    assert np.linalg.norm(off / np.sqrt(np.diag(estimate.covariance))) < 4.0 * np.sqrt(6.0)


def test_markers_far_off_the_axis_are_used(images: list[np.ndarray]) -> None:
    estimate = BoardPose(BOARD, FISHEYE).estimate(images[2])
    angles = np.degrees(np.arccos(FISHEYE.rays(estimate.corners.reshape(-1, 2))[:, 2]))
    assert len(estimate.ids) > 40 and angles.min() > 25.0 and angles.max() > 55.0


def test_a_straightened_image_is_that_of_a_pinhole(images: list[np.ndarray]) -> None:
    straight = Undistortion(FISHEYE).color(images[0])
    estimate = BoardPose(BOARD, PINHOLE).estimate(straight)
    assert estimate.valid, estimate.reason
    assert 1e3 * np.linalg.norm(error(estimate.X_SC, VIEWS[0])[3:]) < 0.5


def test_a_top_view_shows_markers_at_their_places(images: list[np.ndarray]) -> None:
    picture = board_picture(images[0], BOARD, FISHEYE, resolution=1e-3)
    height, width = picture.image.shape[:2]
    (left, low), (right, high) = picture.lower, picture.upper
    grey = cv2.cvtColor(picture.image, cv2.COLOR_RGB2GRAY)
    detector = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_ARUCO_MIP_36h12)
    )
    corners, ids, _ = detector.detectMarkers(grey)
    assert len(ids) > 30
    places = dict(zip(BOARD.layout.ids, BOARD.layout.p_SQ.mean(axis=1), strict=True))
    for quad, number in zip(corners, ids.ravel(), strict=True):
        column, row = quad.reshape(4, 2).mean(axis=0) + 0.5
        at = [left + column * (right - left) / width, high - row * (high - low) / height]
        assert at == pytest.approx(places[int(number)][:2], abs=1e-3)


def test_an_overlay_is_drawn_through_the_lens() -> None:
    """The middle of what is drawn of an object is where OpenCV's formula puts its own middle."""
    scene = load_scene("tabletop_six")
    X_SC = VIEWS[0]
    blank = np.full((720, 1280, 3), 255, np.uint8)
    drawn = Overlay(scene, FISHEYE).draw(blank, X_SC)
    changed = (drawn != blank).any(axis=2)
    rows, columns = np.nonzero(changed)
    places = np.array([scene.X_SO(name)[:3, 3] for name in scene.instances])
    p_C = (places - X_SC[:3, 3]) @ X_SC[:3, :3]
    theirs, _ = cv2.fisheye.projectPoints(
        p_C[:, None], np.zeros(3), np.zeros(3), FISHEYE.K, np.array(FISHEYE.distortion)
    )
    for u, v in theirs[:, 0]:
        assert np.hypot(columns - u, rows - v).min() < 30.0
    assert np.ptp(columns) < 900  # nothing is smeared to the edges


def test_what_is_beside_or_behind_is_not_seen() -> None:
    sees = FieldOfView(FISHEYE).sees
    angle = np.radians([0.0, 60.0, 80.0, 89.9, 100.0, 180.0])
    p_C = np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    assert sees(p_C).tolist() == [True, True, True, False, False, False]


def test_views_of_data_sets_are_no_fisheyes() -> None:
    with pytest.raises(InvalidInputError, match=r"camera board.*fisheye"):
        View(camera="board", intrinsics=FISHEYE, X_SC=np.eye(4))
