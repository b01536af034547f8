"""Cameras for portraits: all is in the picture and in its middle, by a pinhole of its own."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from burg_drake.core import rot_z
from burg_drake.objects import load_library
from burg_drake.visualization import best_yaw, camera_rotation, fit_camera, upright_rotation

HALF = np.array([0.4, 0.3])


def image(points: np.ndarray, R_WC: np.ndarray, p_WC: np.ndarray) -> np.ndarray:
    """(N, 2) slopes of the rays to points; asserts that they are in front of the camera."""
    p_C = (points - p_WC) @ R_WC
    assert (p_C[:, 2] > 0.0).all()
    return p_C[:, :2] / p_C[:, 2:]


@pytest.mark.parametrize("elevation", [0.0, 0.5, 1.5])
def test_camera_frame(elevation: float) -> None:
    R = camera_rotation(elevation)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert R[:, 2] == pytest.approx([0.0, np.cos(elevation), -np.sin(elevation)])


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("stretch", [(1, 1, 1), (5, 1, 1), (1, 1, 6), (0.01, 0.02, 0.01)])
def test_fitted_points_fill_the_picture_and_are_in_its_middle(
    seed: int, stretch: tuple[float, float, float]
) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(60, 3)) * stretch + rng.normal(size=3)
    R_WC = camera_rotation(0.6)
    seen = image(points, R_WC, fit_camera(points, R_WC, HALF)) / HALF
    low, high = seen.min(axis=0), seen.max(axis=0)
    assert np.abs(seen).max() == pytest.approx(1.0, abs=1e-6)
    assert low == pytest.approx(-high, abs=1e-6)


def test_a_bar_is_turned_to_show_its_length() -> None:
    bar = np.array([[x, y, z] for x in (-1, 1) for y in (-9, 9) for z in (-1, 1)], dtype=float)
    turned = bar @ rot_z(best_yaw(bar, camera_rotation(0.3))).T
    assert np.ptp(turned[:, 0]) > 15.0


def test_what_shows_the_same_from_all_sides_is_not_turned() -> None:
    angle = np.deg2rad(np.arange(0, 360, 5.0))
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert best_yaw(np.vstack([rim, rim + np.array([0, 0, 2])]), camera_rotation(0.5)) == 0.0


def test_objects_stand_in_their_own_frame_if_they_can() -> None:
    library = load_library("household")
    assert upright_rotation(library.entry("bottle")) == pytest.approx(np.eye(3))
    entry = library.entry("bottle")
    lying = dataclasses.replace(entry, stable_poses=entry.stable_poses[:1])
    assert upright_rotation(lying) == pytest.approx(entry.X_SO(0)[:3, :3])
    assert upright_rotation(dataclasses.replace(entry, stable_poses=())) == pytest.approx(np.eye(3))
