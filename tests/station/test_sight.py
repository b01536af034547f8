"""What cameras see of the board, against OpenCV's projection and points along rays."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from burg_drake.core import Pose, builtin_names, inverse, transform_points
from burg_drake.scene import Board
from burg_drake.station import (
    Camera,
    Obstacle,
    are_points_in_view,
    board_points,
    frustum,
    lines_through_box,
    load_station,
    visible_board_share,
)

SKEW = Camera(
    X_WC=Pose((0.1, -0.3, 0.6), rpy_deg=(-140.0, 10.0, 20.0)),
    width=320,
    height=200,
    focal=(300.0, 310.0),
    center=(150.0, 90.0),
    depth_range=(0.3, 0.9),
)
DOWN = (180.0, 0.0, 0.0)


def pixels(camera: Camera, p_WQ: np.ndarray) -> np.ndarray:
    """(N, 2) by OpenCV."""
    X_CW = inverse(camera.X_WC.matrix())
    (fx, fy), (cx, cy) = camera.focal, camera.principal_point
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    rotation, _ = cv2.Rodrigues(X_CW[:3, :3])
    found, _ = cv2.projectPoints(p_WQ, rotation, X_CW[:3, 3], K, None)
    return found.reshape(-1, 2)


def test_in_view_is_what_opencv_projects_into_the_image() -> None:
    p_WQ = np.random.default_rng(0).uniform((-0.5, -0.5, -0.2), (0.7, 0.7, 0.4), (4000, 3))
    z = transform_points(inverse(SKEW.X_WC.matrix()), p_WQ)[:, 2]
    inside = (pixels(SKEW, p_WQ) > -0.5) & (pixels(SKEW, p_WQ) < (319.5, 199.5))
    expected = inside.all(axis=1) & (z > 0.3) & (z < 0.9)
    np.testing.assert_array_equal(are_points_in_view(SKEW, p_WQ), expected)
    assert 0.05 < expected.mean() < 0.9


def test_corners_of_the_image() -> None:
    corners = frustum(SKEW, 0.5)
    z = transform_points(inverse(SKEW.X_WC.matrix()), corners)[:, 2]
    np.testing.assert_allclose(z, 0.5)
    expected = [[-0.5, -0.5], [319.5, -0.5], [319.5, 199.5], [-0.5, 199.5]]
    np.testing.assert_allclose(pixels(SKEW, corners), expected, atol=1e-6)


def test_crossed_boxes_hold_points_of_the_ray() -> None:
    rng = np.random.default_rng(1)
    box = Obstacle(X_WB=Pose((0.2, 0.1, 0.3), rpy_deg=(20.0, 30.0, 40.0)), size=(0.3, 0.2, 0.1))
    p_WA, p_WQ = np.array([-0.3, -0.2, 0.5]), rng.uniform(-0.6, 0.8, (3000, 3))
    share = np.linspace(0.0, 1.0, 400)[:, None, None]
    p_B = transform_points(
        inverse(box.X_WB.matrix()), (p_WA + share * (p_WQ - p_WA)).reshape(-1, 3)
    )
    depth = (np.array(box.size) / 2 - np.abs(p_B)).min(axis=1).reshape(400, -1).max(axis=0)
    clear = np.abs(depth) > 2e-3  # what only touches may be called either way
    np.testing.assert_array_equal(lines_through_box(box, p_WA, p_WQ)[clear], depth[clear] > 0.0)
    assert 0.02 < (depth > 0.0).mean() < 0.5


def test_along_a_face() -> None:
    """Rays parallel to two pairs of faces, between them and beside them."""
    box = Obstacle(X_WB=Pose((1.0, 0.0, 0.0)), size=(0.2, 0.2, 0.2))
    p_WA = np.zeros(3)
    assert lines_through_box(box, p_WA, np.array([[2.0, 0.0, 0.0]])).all()
    assert not lines_through_box(box, np.array([0.0, 0.2, 0.0]), np.array([[2.0, 0.2, 0.0]])).any()
    behind, short = np.array([[-2.0, 0.0, 0.0]]), np.array([[0.8, 0.0, 0.0]])
    assert (
        not lines_through_box(box, p_WA, behind).any()
        and not lines_through_box(box, p_WA, short).any()
    )


def test_half_of_the_board() -> None:
    """Straight from above; the image's left half hidden by a plate, or its field of view halved."""
    station = load_station("wsg_tabletop")
    station = replace(station, document=replace(station.document, X_WS=Pose((-0.297, -0.21, 0.0))))
    camera = Camera(X_WC=Pose((0.0, 0.0, 1.0), rpy_deg=DOWN), width=640, height=480)
    assert visible_board_share(camera, station, Board()) == 1.0
    plate = Obstacle(X_WB=Pose((0.5, 0.0, 0.5)), size=(1.0, 1.0, 0.01))
    hidden = replace(station, document=replace(station.document, background={"plate": plate}))
    assert visible_board_share(camera, hidden, Board()) == pytest.approx(0.5, abs=0.02)
    half = replace(camera, center=(639.4, 239.5))
    assert visible_board_share(half, station, Board()) == pytest.approx(0.5, abs=0.02)
    away = replace(camera, X_WC=Pose((0.0, 0.0, 1.0)))
    assert visible_board_share(away, station, Board()) == 0.0


def test_board_points_are_all_over_the_sheet() -> None:
    station = load_station("panda_tabletop")
    p_WQ = board_points(station, Board())
    np.testing.assert_allclose(p_WQ.min(axis=0), [0.24, -0.297, 0.0], atol=1e-9)
    np.testing.assert_allclose(p_WQ.max(axis=0), [0.66, 0.297, 0.0], atol=1e-9)


@pytest.mark.parametrize("name", builtin_names("stations"))
def test_every_built_in_station_has_a_camera_that_sees_the_board(name: str) -> None:
    station = load_station(name)
    seen = {
        k: visible_board_share(c, station, Board()) for k, c in station.document.cameras.items()
    }
    assert max(seen.values()) > 0.9 and min(seen.values()) > 0.75, seen
