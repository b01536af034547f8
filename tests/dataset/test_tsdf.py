"""Signed distances: of one image and of surfaces by formula, and both against each other."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.cameras import Intrinsics
from burg_drake.core import InvalidInputError, Pose, make_pose, rotation_from_rpy
from burg_drake.dataset import Tsdf, exact_tsdf, fuse_tsdf, mesh_distance
from burg_drake.station import Obstacle, load_station
from tests.dataset.shapes_scene import SphereAndBox, looking_at

CAMERA = Intrinsics(width=320, height=240, focal=(300.0, 300.0), center=(159.5, 119.5))
WORLD = SphereAndBox((0.10, 0.12, 0.05), 0.05, (0.21, 0.17, 0.03), (0.03, 0.05, 0.03))
X_SV = make_pose(p_AB=(0.0, 0.0, -0.05))
VOXEL = 0.3 / 40


def centers(n: int = 40, voxel: float = VOXEL) -> np.ndarray:
    """(n^3, 3) in S."""
    grid = np.stack(np.meshgrid(*3 * [np.arange(n)], indexing="ij"), axis=-1).reshape(-1, 3)
    return (grid + 0.5) * voxel + (0.0, 0.0, -0.05)


def all_around() -> list[np.ndarray]:
    target = (0.15, 0.15, 0.03)
    places = [(h, r, a) for h, r in ((0.2, 0.5), (0.45, 0.35)) for a in np.arange(12) * np.pi / 6]
    eyes = [(0.15 + r * np.cos(a), 0.15 + r * np.sin(a), h) for h, r, a in places]
    return [looking_at(eye, target) for eye in [*eyes, (0.15, 0.15, 0.6)]]


@pytest.fixture(scope="module")
def fused() -> Tsdf:
    views = all_around()
    return fuse_tsdf([WORLD.depth(CAMERA, X) for X in views], CAMERA, views, X_SV)


def test_one_image_of_the_table() -> None:
    """Straight down: the height, along the ray; beyond the truncation nothing is known below."""
    X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (0.15, 0.15, 1.0))
    found = fuse_tsdf(np.full((1, 240, 320), 1.0, np.float32), CAMERA, X_SC[None], X_SV)
    p = centers()
    ray = np.linalg.norm(p - (0.15, 0.15, 1.0), axis=1) / (1.0 - p[:, 2])
    along, depth = ray * p[:, 2], 4 * VOXEL
    expected = np.where(along > -depth, np.minimum(along, depth), np.nan)
    np.testing.assert_allclose(found.distance.reshape(-1), expected, atol=1e-6)
    np.testing.assert_array_equal(found.weight.reshape(-1), along > -depth)
    assert found.truncation == pytest.approx(0.03) and 0.0 < found.weight.mean() < 1.0
    value = np.array(
        [0.0 if d >= 0.98 or not d >= -0.98 else (d + 1) / 2 for d in expected / depth]
    )
    np.testing.assert_allclose(found.values.reshape(-1), value, atol=1e-4)


def test_pixels_are_the_nearest_ones() -> None:
    """Two halves of an image at different depths part in the middle between two columns: 0.12 and
    0.36 pixels from there, each voxel is on its side."""
    depth = np.full((240, 320), 0.5, np.float32)
    depth[:, 160:] = 0.6
    X_SV = make_pose(p_AB=(-0.0008, -0.0008, 0.5))
    found = fuse_tsdf([depth], CAMERA, [np.eye(4)], X_SV, size=0.0016, voxels=4, truncation=1.0)
    x = 0.0004 * (np.arange(4) - 1.5)
    expected = np.where(x < 0.0, -0.0002, 0.0998)
    np.testing.assert_allclose(found.distance[:, 1, 0], expected, atol=1e-6)


def test_true_distances_of_ball_box_and_table(tmp_path: Path) -> None:
    found = exact_tsdf(WORLD.scene(tmp_path), X_SV)
    expected = np.clip(WORLD.distance(centers()), -0.03, 0.03)
    assert np.abs(found.distance.reshape(-1) - expected).max() < 2e-4  # the ball is a polyhedron
    assert (found.weight == 1.0).all()
    without = exact_tsdf(WORLD.scene(tmp_path), X_SV, table=False)
    below = centers()[:, 2] < -0.031
    assert (without.distance.reshape(-1)[below] == np.float32(0.03)).all()


def test_true_distances_of_obstacles(tmp_path: Path) -> None:
    """A turned one on a station whose board is elsewhere, in the frame of the scene."""
    station = load_station("panda_tabletop")
    X_SB = make_pose(rotation_from_rpy((0.2, 0.1, 0.7)), (0.12, 0.2, 0.12))
    X_WB = Pose.from_matrix(station.document.X_WS.matrix() @ X_SB)
    wall = Obstacle(X_WB=X_WB, size=(0.2, 0.02, 0.12))
    station = replace(station, document=replace(station.document, background={"wall": wall}))
    found = exact_tsdf(WORLD.scene(tmp_path), X_SV, station=station).distance.reshape(-1)
    p_BQ = (centers() - X_SB[:3, 3]) @ X_SB[:3, :3]
    beside = mesh_distance(trimesh.creation.box((0.2, 0.02, 0.12)), p_BQ, 0.03)
    assert (beside < 0.0).sum() > 500
    expected = np.minimum(np.clip(WORLD.distance(centers()), -0.03, 0.03), beside)
    assert np.abs(found - expected).max() < 2e-4


def test_objects_beside_the_volume_do_not_matter(tmp_path: Path) -> None:
    scene = WORLD.scene(tmp_path)
    found = exact_tsdf(scene, make_pose(p_AB=(1.0, 1.0, 0.0)), size=0.08, voxels=4)
    height = 0.02 * (np.arange(4) + 0.5)
    np.testing.assert_allclose(found.distance, np.broadcast_to(height, (4, 4, 4)), rtol=1e-6)


def test_distances_of_a_box_are_exact() -> None:
    """Large faces and small ones, among which there are slivers; inside and outside."""
    box = trimesh.creation.box((0.06, 0.1, 0.06))
    fine = box.subdivide().subdivide().subdivide()
    small = trimesh.creation.box((0.06e-2, 0.1e-2, 0.06e-2))
    p = np.random.default_rng(1).uniform(-0.07, 0.07, (3000, 3))
    high = SphereAndBox((9.0, 9.0, 9.0), 0.05, (0.0, 0.0, 5.0), (0.03, 0.05, 0.03))
    truth = np.clip(high.distance(p + np.array([0.0, 0.0, 5.0])), -0.05, 0.05)
    assert (truth < 0.0).sum() > 100
    for mesh, scale in ((box, 1.0), (fine, 1.0), (small, 0.01)):
        found = mesh_distance(mesh, p * scale, 0.05 * scale)
        np.testing.assert_allclose(found, truth * scale, atol=1e-9)


def test_fused_surfaces_are_the_true_ones(fused: Tsdf) -> None:
    """Where the sign changes from one voxel to the next, the surface is within half a voxel. Only
    at edges of the box, that images from its other side see less than the truncation away, is it
    up to two thirds of a voxel off."""
    p = centers().reshape(40, 40, 40, 3)
    crossings = []
    for axis in range(3):
        a, b = (np.take(fused.distance, r, axis) for r in (range(39), range(1, 40)))
        pa, pb = (np.take(p, r, axis) for r in (range(39), range(1, 40)))
        cross = ((a > 0.0) != (b > 0.0)) & ~np.isnan(a) & ~np.isnan(b)
        share = (a[cross] / (a[cross] - b[cross]))[:, None]
        crossings.append((1.0 - share) * pa[cross] + share * pb[cross])
    apart = np.abs(WORLD.distance(np.concatenate(crossings))) / VOXEL
    assert len(apart) > 2500
    assert (apart < 0.5).mean() > 0.99 and apart.max() < 0.75


def test_fused_distances_near_surfaces_are_the_true_ones(fused: Tsdf) -> None:
    true = WORLD.distance(centers()).reshape(40, 40, 40)
    near = (fused.weight > 0.0) & (np.abs(true) < 0.5 * VOXEL)
    assert near.sum() > 2000
    assert np.median(np.abs(fused.distance - true)[near]) < 0.25 * VOXEL
    wrong = (np.abs(true) > 0.5 * VOXEL) & (fused.distance * true < 0.0)
    assert wrong.sum() < 10


def test_the_place_of_the_scene_does_not_matter(fused: Tsdf) -> None:
    X_NS = make_pose(rotation_from_rpy((0.3, -0.8, 2.0)), (1.0, -2.0, 0.5))
    views = all_around()
    moved = fuse_tsdf(
        [WORLD.depth(CAMERA, X) for X in views], [CAMERA] * len(views), X_NS @ views, X_NS @ X_SV
    )
    same = fused.weight == moved.weight
    assert same.mean() > 0.999  # at the border of two pixels rounding decides
    np.testing.assert_allclose(moved.distance[same], fused.distance[same], atol=2e-3)


def test_what_does_not_fit_is_refused() -> None:
    depth = np.ones((240, 320), np.float32)
    with pytest.raises(InvalidInputError, match="1 depth images, 2 poses and 1 intrinsics"):
        fuse_tsdf([depth], CAMERA, np.tile(np.eye(4), (2, 1, 1)), X_SV)
    with pytest.raises(InvalidInputError, match="depth image 1 has 320 x 239 pixels"):
        fuse_tsdf([depth, depth[1:]], CAMERA, np.tile(np.eye(4), (2, 1, 1)), X_SV)
    with pytest.raises(InvalidInputError, match="0 voxels per edge; give 1 to 512"):
        fuse_tsdf([depth], CAMERA, [np.eye(4)], X_SV, voxels=0)
