"""Drawings of solids and grasps: closed forms for outlines, a symmetry, lengths that are kept."""

from __future__ import annotations

import re

import cv2
import numpy as np
import pytest
import trimesh

from burg_drake.core import Array, make_pose, rot_z
from burg_drake.visualization import (
    FINGER_LENGTH,
    PIXELS_PER_UNIT,
    STEM_LENGTH,
    TONE_COUNT,
    FlatView,
    SolidMesh,
    camera_rotation,
    fit_view,
    footprint,
    grasp_corners,
    grasp_strokes,
    path_data,
    shaded_outline,
)

DOWN = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
"""A camera that looks straight down, with x to the right."""


def solid(mesh: trimesh.Trimesh) -> SolidMesh:
    return SolidMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def polygons(d: str) -> list[Array]:
    """Corners of the parts of a path."""
    parts = [p for p in d.split("M") if p]
    return [np.array(re.findall(r"(-?[\d.]+) (-?[\d.]+)", p), dtype=float) for p in parts]


def even_odd_area(d: str) -> float:
    """Area of a path of outer borders and holes; OpenCV turns them in opposite ways."""
    areas = [cv2.contourArea(p.astype(np.float32), oriented=True) for p in polygons(d)]
    return abs(sum(areas))


@pytest.mark.parametrize(
    ("mesh", "area"),
    [
        (trimesh.creation.box((0.1, 0.06, 0.02)), 0.1 * 0.06),
        (trimesh.creation.icosphere(subdivisions=4, radius=0.05), np.pi * 0.05**2),
        (trimesh.creation.annulus(0.02, 0.05, 0.03), np.pi * (0.05**2 - 0.02**2)),
    ],
)
def test_an_outline_covers_what_the_solid_covers(mesh: trimesh.Trimesh, area: float) -> None:
    shown = solid(mesh)
    view = fit_view(shown.vertices, DOWN, 300.0)
    outline, *_ = paths = shaded_outline([shown], view)
    assert len(paths) == TONE_COUNT
    # contours run through the middles of the pixels at the border, half a pixel inside
    length = sum(cv2.arcLength(p.astype(np.float32), True) for p in polygons(outline))
    found = even_odd_area(outline) + length * 0.5 / PIXELS_PER_UNIT
    assert found == pytest.approx(area * view.scale**2, rel=0.01)


def test_the_nearer_solid_hides_the_other() -> None:
    low = solid(trimesh.creation.box((0.1, 0.1, 0.02)))
    top = solid(trimesh.creation.box((0.2, 0.2, 0.02)).apply_translation((0, 0, 0.1)))
    view = fit_view(top.vertices, DOWN, 200.0)
    assert shaded_outline([low, top], view) == shaded_outline([top], view)
    assert shaded_outline([top, low], view) == shaded_outline([top], view)


def test_a_drawing_does_not_depend_on_where_things_are() -> None:
    shown = solid(trimesh.creation.annulus(0.02, 0.05, 0.03))
    R_WC = camera_rotation(0.5)
    moved = SolidMesh(shown.vertices + np.array([1.0, -2.0, 0.5]), shown.faces)
    here = fit_view(shown.vertices, R_WC, 200.0, 200.0)
    there = fit_view(moved.vertices, R_WC, 200.0, 200.0)
    np.testing.assert_allclose(
        here.project(shown.vertices), there.project(moved.vertices), atol=1e-9
    )
    corners = polygons(footprint(shown, here))[0], polygons(footprint(moved, there))[0]
    np.testing.assert_allclose(corners[0], corners[1], atol=0.11)


def test_a_view_holds_all_points_in_its_middle() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    for size in ((200.0, 80.0), (80.0, 200.0)):
        places = fit_view(points, camera_rotation(0.6), *size, margin=5.0).project(points)
        low, high = places.min(axis=0), places.max(axis=0)
        np.testing.assert_allclose(low + high, size, atol=1e-6)
        assert low.min() == pytest.approx(5.0)
    free = fit_view(points, camera_rotation(0.6), 200.0)
    assert free.project(points).max(axis=0)[1] <= free.size[1]


def test_strokes_of_a_grasp_keep_their_lengths_in_a_plane() -> None:
    """Seen along the hand's y axis nothing is foreshortened."""
    R_WC = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    view = FlatView(R_WC.T, 1000.0, np.zeros(2), (100.0, 100.0))
    X_WG = make_pose(np.eye(3), [0.2, 0.7, 0.1])
    corners = grasp_corners(X_WG[None], np.array([0.06]))
    assert corners.shape == (1, 6, 3)
    (d,) = grasp_strokes(corners, view)
    fork, stem = polygons(d)
    lengths = np.linalg.norm(np.diff(fork, axis=0), axis=1) / 1000.0
    np.testing.assert_allclose(lengths, [FINGER_LENGTH, 0.06, FINGER_LENGTH], atol=2e-4)
    assert np.linalg.norm(stem[1] - stem[0]) == pytest.approx(1e3 * STEM_LENGTH, abs=0.2)
    np.testing.assert_allclose(stem[0], fork[1:3].mean(axis=0), atol=0.11)
    turned = grasp_corners((make_pose(rot_z(np.pi)) @ X_WG)[None], np.array([0.06]))
    np.testing.assert_allclose(turned[..., :2], -corners[..., :2], atol=1e-12)


def test_path_data_is_short() -> None:
    assert path_data(np.array([[1.0, -0.04], [2.25, 3.0]])) == "M1 0L2.2 3Z"
    assert path_data(np.array([[10.0, 100.0]]), closed=False, decimals=0) == "M10 100"
