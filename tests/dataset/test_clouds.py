"""Clouds of depth images made by formula, and points on spheres and boxes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from burg_drake.cameras import Intrinsics
from burg_drake.core import InvalidInputError, Pose
from burg_drake.dataset import depth_cloud, surface_cloud
from burg_drake.scene import Instance, Scene
from tests.dataset.shapes_scene import shapes_scene

CAMERA = Intrinsics(width=64, height=48, focal=(60.0, 61.0), center=(31.2, 24.9))
LENS = replace(CAMERA, distortion=(-0.2, 0.05, 1e-3, 2e-3))
NORMAL, OFFSET = np.array([0.3, -0.2, -0.9]), -0.8
"""A plane: the points with this inner product."""


def plane_depth() -> np.ndarray:
    v, u = np.mgrid[:48, :64]
    slope = NORMAL[0] * (u - 31.2) / 60.0 + NORMAL[1] * (v - 24.9) / 61.0 + NORMAL[2]
    return (OFFSET / slope).astype(np.float32)


def test_a_plane_is_flat() -> None:
    cloud = depth_cloud(plane_depth(), CAMERA)
    assert len(cloud) == 48 * 64 and cloud.color is None and cloud.labels is None
    assert np.ptp(cloud.points @ NORMAL / np.linalg.norm(NORMAL)) < 1e-6
    assert np.abs(cloud.points @ NORMAL - OFFSET).max() < 1e-6


def test_colors_and_labels_are_those_of_the_points() -> None:
    depth = plane_depth()
    depth[0, :5] = 0.0, np.nan, np.inf, -1.0, 0.5
    color = np.random.default_rng(0).integers(0, 255, (48, 64, 3)).astype(np.uint8)
    labels = np.arange(48 * 64, dtype=np.uint16).reshape(48, 64)
    cloud = depth_cloud(depth, CAMERA, color=color, labels=labels)
    assert cloud.color is not None and cloud.labels is not None
    assert cloud.labels.tolist() == list(range(4, 48 * 64))
    np.testing.assert_array_equal(cloud.color[0], color[0, 4])
    row, column = np.divmod(cloud.labels.astype(int), 64)
    p = cloud.points
    np.testing.assert_allclose(p[:, 0] / p[:, 2] * 60.0 + 31.2, column, atol=1e-4)
    np.testing.assert_allclose(p[:, 1] / p[:, 2] * 61.0 + 24.9, row, atol=1e-4)


def test_lens_distortion_is_taken_out() -> None:
    """OpenCV's projection of the points leads back to the pixels."""
    cloud = depth_cloud(np.full((48, 64), 0.7, np.float32), LENS)
    flat = cloud.points.astype(float).reshape(-1, 1, 3)
    pixels, _ = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), LENS.K, LENS.coefficients)
    v, u = np.mgrid[:48, :64]
    np.testing.assert_allclose(pixels[:, 0], np.stack([u, v], -1).reshape(-1, 2), atol=1e-3)
    straight = depth_cloud(np.full((48, 64), 0.7, np.float32), CAMERA)
    assert np.abs(cloud.points - straight.points).max() > 5e-3


def test_images_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="the depth image has 64 x 47 pixels"):
        depth_cloud(plane_depth()[1:], CAMERA)
    with pytest.raises(InvalidInputError, match="the labels image has 63 x 48 pixels"):
        depth_cloud(plane_depth(), CAMERA, labels=np.zeros((48, 63), np.uint16))
    with pytest.raises(InvalidInputError, match="type uint16; expected floats in metres"):
        depth_cloud(np.ones((48, 64), np.uint16), CAMERA)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """A ball, a turned box, and a box in the background."""
    meshes = {
        "ball": trimesh.creation.icosphere(subdivisions=4, radius=0.05),
        "box": trimesh.creation.box((0.1, 0.2, 0.4)),
    }
    turned = Pose((0.3, 0.1, 0.2), rpy_deg=(0.0, 0.0, 30.0))
    free = (
        Instance(object="box", X_SO=turned),
        Instance(object="ball", X_SO=Pose((0.1, 0.1, 0.05))),
    )
    return shapes_scene(
        tmp_path, meshes, free, (Instance(name="wall", object="box", X_SO=Pose((1.0, 0.0, 0.2))),)
    )


def test_points_lie_on_the_surfaces(scene: Scene) -> None:
    cloud = surface_cloud(scene, np.random.default_rng(0), per_object=600)
    assert np.bincount(cloud.number).tolist() == [0, 600, 600, 600]
    ball = cloud.points[cloud.number == 2] - (0.1, 0.1, 0.05)
    np.testing.assert_allclose(np.linalg.norm(ball, axis=1), 0.05, rtol=2e-3)
    assert (np.einsum("ij,ij->i", ball, cloud.normals[cloud.number == 2]) > 0.0499).all()
    turn = np.deg2rad(30.0)
    c, s = np.cos(turn), np.sin(turn)
    back = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    p = (cloud.points[cloud.number == 1] - (0.3, 0.1, 0.2)) @ back.T / (0.05, 0.1, 0.2)
    n = cloud.normals[cloud.number == 1] @ back.T
    np.testing.assert_allclose(np.abs(p).max(axis=1), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.einsum("ij,ij->i", p, n), 1.0, atol=1e-9)
    share = (np.abs(n[:, 0]) > 0.5).mean()  # 4 of 7 of the area
    assert share == pytest.approx(4 / 7, abs=0.07)
    assert (cloud.points[cloud.number == 3][:, 0] > 0.9).all()


def test_density_is_by_area(scene: Scene) -> None:
    cloud = surface_cloud(scene, np.random.default_rng(0), density=5000.0)
    counts = np.bincount(cloud.number)[1:]
    areas = [0.28, 4 * np.pi * 0.05**2, 0.28]
    np.testing.assert_allclose(counts, 5000.0 * np.array(areas), rtol=0.01)
    with pytest.raises(InvalidInputError, match="either per_object or density"):
        surface_cloud(scene, np.random.default_rng(0))
