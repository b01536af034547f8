"""Rays of pointers, held against the projection of a pinhole camera by OpenCV."""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.core.frames import inverse, make_pose, rotation_from_rpy
from burg_drake.ui.pointing.pointer import PageCamera

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
    seen = eye().on_screen(p_SQ) * (WIDTH, HEIGHT)
    np.testing.assert_allclose(seen, pixels[:, 0], atol=1e-6)


def test_what_is_grabbed_stays_under_the_pointer() -> None:
    grabbed, up = np.array([0.3, 0.2, 0.07]), np.array([0.0, 0.0, 1.0])
    for p_SQ in ((0.1, 0.1, 0.0), (0.5, 0.3, 0.2)):
        dragged = eye().on_plane(p_SQ, grabbed, up)
        assert dragged is not None and abs(dragged[2] - grabbed[2]) < 1e-12
        np.testing.assert_allclose(eye().on_screen(dragged), eye().on_screen(p_SQ), atol=1e-9)


def test_rays_that_graze_or_miss_the_plane_hit_nothing() -> None:
    up = np.array([0.0, 0.0, 1.0])
    p_SC = eye().X_SC[:3, 3]
    assert eye().on_plane(p_SC + np.array([0.0, 1.0, 0.001]), (0.0, 0.0, 0.0), up) is None
    assert eye().on_plane(p_SC + np.array([0.0, 1.0, 0.5]), (0.0, 0.0, 0.0), up) is None
    assert eye().on_plane(p_SC, (0.0, 0.0, 0.0), up) is None
    assert np.isnan(eye().on_screen(p_SC - eye().X_SC[:3, 2])).all()
