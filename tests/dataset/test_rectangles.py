"""Rectangles of grasps against the images of the pads' corners."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, InvalidInputError, swap_fingers
from burg_drake.dataset import MAX_APPROACH_ANGLE, LabelledGrasps, grasp_rectangles

CAMERA = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(320.3, 239.1))
JAW = 0.02


def grasps(X_CG: Array, width: float = 0.06) -> LabelledGrasps:
    n = len(X_CG)
    return LabelledGrasps(X_CG, np.full(n, width), np.ones(n, np.uint16), np.full(n, "lifted"), {})


def random_grasps(n: int, tilt: float, seed: int = 0) -> Array:
    """Grasps in view, each at this angle to the optical axis."""
    rng = np.random.default_rng(seed)
    X_CG = np.tile(np.eye(4), (n, 1, 1))
    for k in range(n):
        axis = rng.normal(size=2)
        vector = tilt * np.array([*axis, 0.0]) / np.linalg.norm(axis)
        turn = np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
        X_CG[k, :3, :3] = cv2.Rodrigues(vector)[0] @ cv2.Rodrigues(turn)[0]
    X_CG[:, :3, 3] = rng.uniform((-0.2, -0.15, 0.5), (0.2, 0.15, 0.9), (n, 3))
    return X_CG


def pads_in_image(X_CG: Array, width: float) -> Array:
    """(N, 4, 2) images of the ends of the pads, around the grasp."""
    ends = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * (width / 2, JAW / 2)
    p_CQ = np.stack([X[:3, 3] + ends @ X[:3, :2].T for X in X_CG])
    return p_CQ[..., :2] / p_CQ[..., 2:] * 600.0 + (320.3, 239.1)


def off(found: Array, pads: Array) -> Array:
    """(N,) largest distance of corners, whichever finger comes first."""
    swapped = np.roll(found, 2, axis=1)
    apart = [np.linalg.norm(some - pads, axis=2).max(axis=1) for some in (found, swapped)]
    return np.minimum(*apart)


def test_along_the_optical_axis_it_is_the_image_of_the_pads() -> None:
    X_CG = random_grasps(50, 0.0)
    found = grasp_rectangles(grasps(X_CG), CAMERA, jaw=JAW)
    assert found.grasp.tolist() == list(range(50))
    assert off(found.corners, pads_in_image(X_CG, 0.06)).max() < 1e-9
    np.testing.assert_allclose(found.opening, 600.0 * 0.06 / X_CG[:, 2, 3])
    np.testing.assert_allclose(found.height, 600.0 * JAW / X_CG[:, 2, 3])
    np.testing.assert_array_equal(found.depth, X_CG[:, 2, 3])
    assert (np.abs(found.angle) <= np.pi / 2).all() and np.ptp(found.angle) > 2.5


def test_tilted_ones_deviate_by_a_little() -> None:
    X_CG = random_grasps(200, 0.99 * MAX_APPROACH_ANGLE)
    found = grasp_rectangles(grasps(X_CG), CAMERA, jaw=JAW)
    assert len(found) == 200
    away = off(found.corners, pads_in_image(X_CG, 0.06))
    assert away.max() < 0.06 * found.opening.min() and away.max() > 0.1


def test_an_opening_takes_the_place_of_widths() -> None:
    X_CG = random_grasps(5, 0.0)
    unknown = grasps(X_CG, np.nan)
    found = grasp_rectangles(unknown, CAMERA, opening=0.08, jaw=JAW)
    assert off(found.corners, pads_in_image(X_CG, 0.08)).max() < 1e-9
    with pytest.raises(InvalidInputError, match="width of grasp 0 is unknown"):
        grasp_rectangles(unknown, CAMERA)


def test_fingers_are_alike() -> None:
    X_CG = random_grasps(50, 0.1)
    one, other = (grasp_rectangles(grasps(X), CAMERA) for X in (X_CG, swap_fingers(X_CG)))
    np.testing.assert_allclose(one.angle, other.angle, atol=1e-9)
    np.testing.assert_allclose(one.center, other.center)


def test_only_what_looks_like_a_rectangle_in_the_image() -> None:
    X_CG = random_grasps(6, 0.0)
    X_CG[0] = random_grasps(1, MAX_APPROACH_ANGLE + 0.01)[0]
    X_CG[1, 2, 3] = -0.5  # behind the camera
    X_CG[3, 0, 3] = 1.0  # beside the image
    X_CG[4, :3, :3] = np.diag([1.0, -1.0, -1.0])  # towards the camera
    found = grasp_rectangles(grasps(X_CG), CAMERA)
    assert found.grasp.tolist() == [2, 5]
    assert len(grasp_rectangles(grasps(np.empty((0, 4, 4))), CAMERA)) == 0
    with pytest.raises(InvalidInputError, match="give less than pi / 2"):
        grasp_rectangles(grasps(X_CG), CAMERA, most_angle=2.0)


def test_a_lens_bends_them() -> None:
    lens = replace(CAMERA, distortion=(0.1, 0.0, 0.0, 0.0))
    X_CG = random_grasps(20, 0.0)
    found = grasp_rectangles(grasps(X_CG), lens)
    flat = X_CG[found.grasp, :2, 3] / X_CG[found.grasp, 2:3, 3]
    bent = flat * (1.0 + 0.1 * (flat**2).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(found.center, 600.0 * bent + (320.3, 239.1))
