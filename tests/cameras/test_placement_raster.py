"""Depth by rays, against ray casting by closed forms."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.cameras import ImageWindow, PinholeView, target_shape
from burg_drake.core import make_pose, rot_z

K = np.array([[500.0, 0.0, 31.5], [0.0, 480.0, 23.5], [0.0, 0.0, 1.0]])
ALL = ImageWindow(0, 0, 64, 48)


def buffer(p_CV: np.ndarray, faces: np.ndarray, window: ImageWindow) -> np.ndarray:
    """Depth by the code, of a mesh given in the camera frame, for a camera anywhere."""
    X_SC = make_pose(rot_z(0.4), (0.2, -0.1, 0.3))
    shape = target_shape(p_CV, faces, X_SC)
    return PinholeView(K, (64, 48), X_SC).buffer(shape, np.zeros(3), window)


def rays(window: ImageWindow) -> np.ndarray:
    v, u = np.mgrid[: window.shape[0], : window.shape[1]].astype(float)
    at = window.image(np.stack([u, v], axis=-1))
    return np.dstack([(at - K[:2, 2]) / K[[0, 1], [0, 1]], np.ones(window.shape)])


def brute_force(p_CV: np.ndarray, faces: np.ndarray, window: ImageWindow) -> np.ndarray:
    """Moeller and Trumbore's intersection of every ray with every triangle."""
    nearest = np.full(window.shape, np.inf)
    d = rays(window)
    for a, b, c in p_CV[faces]:
        p = np.cross(d, c - a)
        det = p @ (b - a)
        u = p @ -a / det
        q = np.cross(-a, b - a)
        v = d @ q / det
        t = (c - a) @ q / det
        nearest = np.where(
            (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), np.minimum(nearest, t), nearest
        )
    return nearest


def test_overlapping_triangles_are_as_ray_casting_has_them() -> None:
    rng = np.random.default_rng(1)
    p_CV = np.column_stack([rng.uniform(-0.08, 0.08, (60, 2)), rng.uniform(0.8, 1.2, 60)])
    faces = np.arange(60).reshape(20, 3)
    for window in (ALL, ImageWindow(10, 5, 30, 30, 2.0), ImageWindow(8, 8, 40, 32, 0.5)):
        found = buffer(p_CV, faces, window)
        true = brute_force(p_CV, faces, window)
        assert found.shape == window.shape
        assert np.isfinite(true).mean() > 0.2
        np.testing.assert_allclose(found, true, rtol=1e-5)


def test_a_sphere_has_the_depth_of_a_sphere() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.03)
    center = np.array([0.004, -0.006, 1.0])
    p_CV = ball.vertices + center
    d = rays(ALL)
    b, c = d @ center, center @ center - 0.03**2
    a = (d**2).sum(axis=-1)
    root = b**2 - a * c
    true = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    found = buffer(p_CV, ball.faces, ALL)
    both = np.isfinite(found) & np.isfinite(true) & (root > 0.1 * root.max())
    assert (np.isfinite(found) != np.isfinite(true)).sum() < 0.02 * np.isfinite(true).sum()
    np.testing.assert_allclose(found[both], true[both], atol=2e-4)


def test_what_lies_behind_or_outside_is_not_drawn() -> None:
    tip = np.array([[-0.1, -0.1, -1.0], [0.1, -0.1, -1.0], [0.0, 0.1, -1.0], [0.0, 0.0, -2.0]])
    assert np.isinf(buffer(tip, np.array([[0, 1, 2], [0, 1, 3]]), ALL)).all()
    empty = PinholeView(K, (64, 48), np.eye(4)).window_of(
        np.array([[100.0, 100.0], [120.0, 130.0]]), 2.0
    )
    assert empty.shape[0] * empty.shape[1] == 0
    assert buffer(np.abs(tip), np.array([[0, 1, 2], [0, 1, 3]]), empty).size == 0


def test_pixels_of_a_finer_raster() -> None:
    """The first pixel is three raster pixels wide, and its middle is that of the second of them."""
    window = ImageWindow(7, 3, 20, 10, 3.0)
    at = window.pixels()
    np.testing.assert_allclose(at[1, 1], [7.0, 3.0])
    np.testing.assert_allclose(at[2, 4], [8.0, 3.0 + 1.0 / 3.0])
