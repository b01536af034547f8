"""Outlines and how they move, against closed forms and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.cameras import ImageContour, PinholeView, TargetShape, target_shape, visible_outline
from burg_drake.core import make_pose, rot_z, transform_points
from tests.cameras.placement_views import INTRINSICS, NOTHING, VIEW, X_SC

Q = np.array([0.004, -0.003, 0.1])


@pytest.fixture(scope="module")
def box() -> TargetShape:
    mesh = trimesh.creation.box((0.05, 0.08, 0.06))
    return target_shape(mesh.vertices, mesh.faces, make_pose(rot_z(0.4), (0.3, 0.2, 0.03)))


def offsets(before: ImageContour, after: ImageContour) -> np.ndarray:
    """By how much an outline moved along the normals of its points: to the nearest of the lines
    through the other's points, of those with alike normals."""
    moved = np.full(len(before), np.nan)
    for i, (p, n) in enumerate(zip(before.pixels, before.normals, strict=True)):
        alike = np.flatnonzero(after.normals @ n > 0.99)
        if len(alike):
            j = alike[np.argmin(np.linalg.norm(after.pixels[alike] - p, axis=1))]
            moved[i] = after.normals[j] @ (after.pixels[j] - p)
    return moved


def test_outlines_move_as_the_derivatives_say(box: TargetShape) -> None:
    before = visible_outline(VIEW, box, Q, NOTHING)
    assert len(before) > 100
    for part, step in enumerate((2e-4, 2e-4, 2e-3)):
        q = Q.copy()
        q[part] += step
        moved = offsets(before, visible_outline(VIEW, box, q, NOTHING))
        expected = before.displacement_jacobian[:, part] * step
        assert np.abs(expected).max() > 0.03
        assert (np.abs(moved - expected) < 3e-4).mean() > 0.95


def test_outlines_move_with_the_camera_as_the_derivatives_say(box: TargetShape) -> None:
    before = visible_outline(VIEW, box, Q, NOTHING)
    for part in range(6):
        error = np.zeros(6)
        error[part] = 3e-4
        X = X_SC.copy()
        skew = np.cross(np.eye(3), error[:3])
        X[:3, :3] = (np.eye(3) + skew) @ X[:3, :3]
        u, _, vt = np.linalg.svd(X[:3, :3])
        X[:3, :3] = u @ vt
        X[:3, 3] += error[3:]
        moved = offsets(
            before, visible_outline(PinholeView(INTRINSICS.K, (640, 480), X), box, Q, NOTHING)
        )
        expected = before.camera_jacobian[:, part] * 3e-4
        assert np.abs(expected).max() > 0.03
        assert (np.abs(moved - expected) < 1e-3).mean() > 0.95


def test_the_outline_of_a_ball_touches_its_tangents() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=5, radius=0.04)
    X_SO = make_pose(p_AB=(0.3, 0.2, 0.04))
    ball = target_shape(mesh.vertices, mesh.faces, X_SO)
    contour = visible_outline(VIEW, ball, np.zeros(3), NOTHING)
    center = transform_points(VIEW.X_CS, X_SO[:3, 3][None])[0]
    rays = np.column_stack([(contour.pixels - VIEW.K[:2, 2]) / 600.0, np.ones(len(contour))])
    sine = np.linalg.norm(np.cross(rays, center), axis=1) / np.linalg.norm(rays, axis=1)
    np.testing.assert_allclose(sine, 0.04, atol=1e-4)
    outward = contour.pixels - contour.pixels.mean(axis=0)
    assert (np.einsum("ni,ni->n", outward, contour.normals) > 0.0).all()


def test_what_stands_before_an_outline_hides_it(box: TargetShape) -> None:
    whole = visible_outline(VIEW, box, Q, NOTHING)
    middle = float(np.median(whole.pixels[:, 0]))
    wall = NOTHING.copy()
    wall[:, : int(middle)] = 0.3
    half = visible_outline(VIEW, box, Q, wall)
    assert 0.2 * len(whole) < len(half) < 0.8 * len(whole)
    assert half.pixels[:, 0].min() > middle - 1.5
    wall[:] = 3.0
    assert len(visible_outline(VIEW, box, Q, wall)) == len(whole)


def test_an_object_out_of_the_image_has_no_outline(box: TargetShape) -> None:
    assert len(visible_outline(VIEW, box, np.array([3.0, 0.0, 0.0]), NOTHING)) == 0
