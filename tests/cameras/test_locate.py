"""A camera's place from synthetic images of the board with known truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from burg_drake.cameras import BoardEstimate, Intrinsics, estimate_board, locate_camera
from burg_drake.core import InvalidInputError, Pose, make_pose, rotation_angle, rotation_from_rpy
from burg_drake.scene import Board
from burg_drake.station import Station, load_station
from tests.cameras.synthetic import ImageDegradation, board_image

K = Intrinsics(width=640, height=480, focal=(600.0, 602.0), center=(318.0, 241.0))
X_SC = make_pose(rotation_from_rpy(np.deg2rad([165.0, 8.0, 30.0])), (0.25, 0.08, 0.75))


@pytest.fixture(scope="module")
def station() -> Station:
    station = load_station("panda_tabletop")
    X_WS = Pose((0.4, 0.1, 0.05), rpy_deg=(0.0, 0.0, -70.0))
    return replace(station, document=replace(station.document, X_WS=X_WS))


def test_place_in_the_world(station: Station) -> None:
    """From two noisy images."""
    rng = np.random.default_rng(0)
    clean = board_image(Board(), K, X_SC, look=ImageDegradation(blur=0.7)).astype(float)
    noisy = [clean + rng.normal(0.0, 3.0, clean.shape) for _ in range(2)]
    images = [np.clip(np.round(image), 0, 255).astype(np.uint8) for image in noisy]
    located = locate_camera(station, [estimate_board(i, K, Board()) for i in images], K)
    X_WC = station.document.X_WS.matrix() @ X_SC
    for X in (located.X_WC, located.camera.X_WC.matrix()):
        assert np.linalg.norm(X[:3, 3] - X_WC[:3, 3]) < 5e-4
        assert rotation_angle(X_WC[:3, :3].T @ X[:3, :3]) < np.deg2rad(0.05)
    assert 0.0 < located.apart[0] < 5e-4
    camera = located.camera
    assert (camera.width, camera.focal, camera.principal_point) == (640, K.focal, K.center)


def test_mean_of_two_is_half_way(station: Station) -> None:
    """Two poses apart by 2 mm and 0.4 degrees about one axis."""
    turn = make_pose(rotation_from_rpy(np.deg2rad([0.0, 0.0, 0.4])))
    X_SD = X_SC @ turn
    X_SD[:3, 3] += [0.002, 0.0, 0.0]
    given = [BoardEstimate(X_SC=X, valid=True) for X in (X_SC, X_SD)]
    lost = BoardEstimate(reason="no marker of the board in the image")
    located = locate_camera(station, [given[0], lost, given[1]], K)
    half = make_pose(rotation_from_rpy(np.deg2rad([0.0, 0.0, 0.2])))
    expected = X_SC @ half
    expected[:3, 3] += [0.001, 0.0, 0.0]
    np.testing.assert_allclose(
        located.X_WC, station.document.X_WS.matrix() @ expected, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(located.apart, (0.001, np.deg2rad(0.2)), rtol=1e-6)


def test_a_camera_that_moved_and_one_that_sees_nothing(station: Station) -> None:
    moved = X_SC.copy()
    moved[:3, 3] += [0.0, 0.03, 0.0]
    given = [BoardEstimate(X_SC=X, valid=True) for X in (X_SC, moved)]
    with pytest.raises(InvalidInputError, match=r"15\.0 mm and 0\.00 degrees .* moved"):
        locate_camera(station, given, K)
    with pytest.raises(InvalidInputError, match="cannot be located: no marker of the board"):
        locate_camera(station, [BoardEstimate(reason="no marker of the board")] * 2, K)
    with pytest.raises(InvalidInputError, match="cannot be located: there is no image"):
        locate_camera(station, [], K)
