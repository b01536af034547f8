"""Rays of pointers, held against the projection of a pinhole camera by OpenCV."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.core import inverse, make_pose, rotation_from_rpy
from burg_drake.scene import Board
from burg_drake.ui import (
    FRONT_FOV,
    TOP_FOV,
    Handle,
    PageCamera,
    direction_to_camera,
    handle_under,
    viewpoint,
)

WIDTH, HEIGHT = 1200.0, 800.0
FOV = 0.8


def eye() -> PageCamera:
    X_SC = make_pose(rotation_from_rpy((-2.3, 0.1, 0.2)), (0.1, -0.6, 0.8))
    return PageCamera(X_SC, FOV, WIDTH / HEIGHT)


def test_points_are_seen_where_a_pinhole_camera_sees_them() -> None:
    p_SQ = np.random.default_rng(1).uniform((0, 0, 0), (0.6, 0.4, 0.2), (50, 3))
    X_CS = inverse(eye().X_SC)
    focal = HEIGHT / 2.0 / np.tan(FOV / 2.0)
    K = np.array([[focal, 0.0, WIDTH / 2.0], [0.0, focal, HEIGHT / 2.0], [0.0, 0.0, 1.0]])
    rotation, _ = cv2.Rodrigues(X_CS[:3, :3])
    pixels, _ = cv2.projectPoints(p_SQ, rotation, X_CS[:3, 3], K, None)
    seen = eye().project(p_SQ) * (WIDTH, HEIGHT)
    np.testing.assert_allclose(seen, pixels[:, 0], atol=1e-6)


def test_what_is_grabbed_stays_under_the_pointer() -> None:
    grabbed, up = np.array([0.3, 0.2, 0.07]), np.array([0.0, 0.0, 1.0])
    for p_SQ in ((0.1, 0.1, 0.0), (0.5, 0.3, 0.2)):
        dragged = eye().intersect_plane(p_SQ, grabbed, up)
        assert dragged is not None and abs(dragged[2] - grabbed[2]) < 1e-12
        np.testing.assert_allclose(eye().project(dragged), eye().project(p_SQ), atol=1e-9)


def test_rays_that_graze_or_miss_the_plane_hit_nothing() -> None:
    up = np.array([0.0, 0.0, 1.0])
    p_SC = eye().X_SC[:3, 3]
    assert eye().intersect_plane(p_SC + np.array([0.0, 1.0, 0.001]), (0.0, 0.0, 0.0), up) is None
    assert eye().intersect_plane(p_SC + np.array([0.0, 1.0, 0.5]), (0.0, 0.0, 0.0), up) is None
    assert eye().intersect_plane(p_SC, (0.0, 0.0, 0.0), up) is None
    assert np.isnan(eye().project(p_SC - eye().X_SC[:3, 2])).all()


def seen_through(p_SQ: np.ndarray) -> np.ndarray:
    """Another point on the ray from the camera through a point."""
    p_SC = eye().X_SC[:3, 3]
    return np.asarray(p_SC + 0.6 * (p_SQ - p_SC))


X_SG = make_pose(rotation_from_rpy((0.3, -0.2, 0.4)), (0.25, 0.15, 0.05))
PLACES = {
    "arrow": lambda along, u, v: 0.09 * along,
    "square": lambda along, u, v: 0.025 * (u + v),
    "ring": lambda along, u, v: 0.65 * 0.11 * (np.cos(0.6) * u + np.sin(0.6) * v),
}


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("kind", ["arrow", "square", "ring"])
def test_a_handle_is_found_where_it_is_drawn_and_follows_the_pointer(kind: Any, axis: int) -> None:
    """The pointer goes to where a motion along or about the handle brings the point that it holds;
    what is found is that motion."""
    R = X_SG[:3, :3]
    along, u, v = R[:, axis], R[:, (axis + 1) % 3], R[:, (axis + 2) % 3]
    grabbed = X_SG[:3, 3] + PLACES[kind](along, u, v)
    parts = [Handle(k, X_SG, i) for k in ("arrow", "square", "ring") for i in range(3)]
    found = handle_under(parts, eye(), seen_through(grabbed))
    assert found is not None
    handle = Handle(kind, X_SG, axis)
    assert handle.distance(eye(), seen_through(grabbed)) is not None
    truth = {
        "arrow": make_pose(p_AB=0.03 * along),
        "square": make_pose(p_AB=0.02 * u - 0.03 * v),
        "ring": X_SG @ make_pose(cv2.Rodrigues(0.4 * np.eye(3)[axis])[0]) @ inverse(X_SG),
    }[kind]
    there = (truth @ (*grabbed, 1.0))[:3]
    motion = handle.motion(eye(), seen_through(grabbed), seen_through(there))
    assert motion is not None
    np.testing.assert_allclose(motion, truth, atol=1e-9)


def test_no_handle_is_found_beside_them_and_none_in_the_middle() -> None:
    parts = [Handle(k, X_SG, i) for k in ("arrow", "square", "ring") for i in range(3)]
    assert handle_under(parts, eye(), X_SG[:3, 3]) is None
    assert handle_under(parts, eye(), X_SG[:3, 3] - 0.06 * X_SG[:3, 0]) is None


@pytest.mark.parametrize("aspect", [0.46, 0.65, 1.0, 2.2])
@pytest.mark.parametrize("above", [True, False])
@pytest.mark.parametrize("size", [(0.297, 0.21), (0.42, 0.594), (1.189, 0.841)])
def test_a_view_has_all_of_the_board(aspect: float, above: bool, size: tuple[float, float]) -> None:
    """The corners by OpenCV's pinhole camera; where the page is a phone's, above the sheet."""
    board, fov = Board(size=size), FRONT_FOV if not above else TOP_FOV
    position, target = viewpoint(board, direction_to_camera(above=above), fov, aspect)
    z = (target - position) / np.linalg.norm(target - position)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    R_CS = np.stack([x, np.cross(z, x), z])
    corners = np.array([[a, b, 0.0] for a in (0.0, size[0]) for b in (0.0, size[1])])
    focal = HEIGHT / 2.0 / np.tan(fov / 2.0)
    K = np.array([[focal, 0.0, HEIGHT * aspect / 2], [0.0, focal, HEIGHT / 2], [0.0, 0.0, 1.0]])
    rotation, _ = cv2.Rodrigues(R_CS)
    pixels, _ = cv2.projectPoints(corners, rotation, -R_CS @ position, K, None)
    shown = 0.55 if aspect < 0.6 else 1.0
    assert (pixels > 0.0).all()
    assert (pixels[:, 0] < (HEIGHT * aspect, HEIGHT * shown)).all()
