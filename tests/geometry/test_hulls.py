"""Convex hulls with few vertices."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import QhullError

from burg_drake.geometry import convex_hull, hull_mesh, reduced_hull, thickness


def test_box_is_exact() -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.03)).subdivide()
    hull = reduced_hull(np.asarray(box.vertices))
    assert len(hull.vertices) == 8
    assert hull.is_watertight
    assert hull.volume == pytest.approx(0.1 * 0.06 * 0.03)


def test_fine_spheres_get_few_vertices_inside_the_sphere() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    hull = reduced_hull(np.asarray(sphere.vertices), max_vertices=64, tolerance=1e-5)
    assert len(hull.vertices) <= 64
    assert hull.is_watertight
    assert hull.is_winding_consistent
    assert np.linalg.norm(hull.vertices, axis=1).max() <= 0.05 + 1e-9
    # a sphere with 64 vertices cannot be much closer than this to the sphere
    assert hull.volume > 0.85 * sphere.volume


def test_reduction_keeps_within_the_tolerance() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    hull = reduced_hull(np.asarray(sphere.vertices), max_vertices=1000, tolerance=1e-3)
    equations = convex_hull(hull.vertices).equations
    outside = (sphere.vertices @ equations[:, :3].T + equations[:, 3]).max(axis=1)
    assert outside.max() <= 1e-3
    assert len(hull.vertices) < 0.1 * len(sphere.vertices)


def test_winding_is_outward() -> None:
    points = np.random.default_rng(3).normal(size=(200, 3))
    hull = hull_mesh(points)
    assert hull.volume == pytest.approx(convex_hull(points).volume)
    assert hull.is_volume


def test_flat_points_are_refused() -> None:
    with pytest.raises(QhullError):
        convex_hull(np.column_stack([np.random.default_rng(0).random((20, 2)), np.zeros(20)]))


def test_thickness_is_that_of_a_plate() -> None:
    R = trimesh.transformations.rotation_matrix(0.4, [1, 1, 0])
    plate = trimesh.creation.box((0.1, 0.2, 0.003)).apply_transform(R)
    assert thickness(np.asarray(plate.vertices)) == pytest.approx(0.003)
    assert thickness(np.asarray(plate.vertices)[[0, 1, 2, 3]] * [1, 1, 0]) == 0.0
