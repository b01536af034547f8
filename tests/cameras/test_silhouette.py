from __future__ import annotations

import cv2
import numpy as np
import pytest
import trimesh

from burg_drake.cameras import MeshOutline
from burg_drake.core import inverse, make_pose, rotation_from_rpy, transform_points

RNG_SEED = 5


def outline(mesh: trimesh.Trimesh) -> MeshOutline:
    return MeshOutline(np.array(mesh.vertices), np.array(mesh.faces))


def distant(rng: np.random.Generator) -> np.ndarray:
    """X_CO of an object half a metre before a camera, turned at random."""
    return make_pose(rotation_from_rpy(rng.uniform(-3, 3, 3)), (0.02, -0.03, 0.5))


def contour_ends(mesh: MeshOutline, X_CO: np.ndarray) -> np.ndarray:
    """(N, 2, 3) ends of the contour's edges in the camera's frame, hidden ones as well."""
    contour = mesh.contour(inverse(X_CO)[:3, 3])
    return transform_points(X_CO, mesh.vertices[mesh.edges[contour.edges]])


def test_contour_of_a_box_is_a_hexagon_of_its_edges() -> None:
    box = outline(trimesh.creation.box((0.1, 0.2, 0.3)))
    contour = box.contour(np.array([1.0, 1.2, 0.9]))
    ends = box.vertices[box.edges[contour.edges]]
    lengths = np.sort(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
    np.testing.assert_allclose(lengths, [0.1, 0.1, 0.2, 0.2, 0.3, 0.3])
    hidden, nearest = np.array([-0.05, -0.1, -0.15]), np.array([0.05, 0.1, 0.15])
    assert not (np.isclose(ends, hidden).all(axis=2) | np.isclose(ends, nearest).all(axis=2)).any()


def test_contour_of_a_face_seen_straight_is_its_rim() -> None:
    box = outline(trimesh.creation.box((0.1, 0.2, 0.3)))
    ends = box.vertices[box.edges[box.contour(np.array([0.0, 0.0, 2.0])).edges]]
    assert len(ends) == 4 and (ends[..., 2] == 0.15).all()


def test_contour_of_a_convex_mesh_is_the_hull_of_its_image() -> None:
    rng = np.random.default_rng(RNG_SEED)
    for _ in range(20):
        hull = trimesh.convex.convex_hull(rng.normal(0.0, 0.05, (60, 3)))
        mesh, X_CO = outline(hull), distant(rng)
        p_CQ = contour_ends(mesh, X_CO)
        seen = p_CQ[..., :2] / p_CQ[..., 2:]
        p_CV = hull.vertices @ X_CO[:3, :3].T + X_CO[:3, 3]
        image = (p_CV[:, :2] / p_CV[:, 2:]).astype(np.float32)
        corners = cv2.convexHull(image).reshape(-1, 2)
        assert len(seen) == len(corners)
        length = np.linalg.norm(seen[:, 1] - seen[:, 0], axis=1).sum()
        assert length == pytest.approx(cv2.arcLength(corners, True), rel=1e-6)


def test_contour_of_a_ball_lies_on_the_cone_of_tangents() -> None:
    ball = outline(trimesh.creation.icosphere(subdivisions=5, radius=0.04))
    p_OC = np.array([0.1, -0.2, 0.3])
    ends = ball.vertices[ball.edges[ball.contour(p_OC).edges]]
    along = p_OC / np.linalg.norm(p_OC)
    height = ends.mean(axis=1) @ along
    assert np.abs(height - 0.04**2 / np.linalg.norm(p_OC)).max() < 0.04 * 0.04  # an edge's length
    assert abs(height.mean() - 0.04**2 / np.linalg.norm(p_OC)) < 2e-4


def test_contour_of_the_whole_closed_surface_is_closed() -> None:
    rng = np.random.default_rng(RNG_SEED)
    sphere = outline(trimesh.creation.icosphere(subdivisions=3, radius=0.05))
    for _ in range(10):
        contour = sphere.contour(rng.normal(0.0, 0.4, 3))
        degree = np.bincount(sphere.edges[contour.edges].ravel())
        assert (degree % 2 == 0).all()


def test_dents_have_no_contour() -> None:
    # From above an L-shaped solid, the edge in its corner is one of a front and a front face; from
    # behind it is one that the solid hides.
    profile = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], float)
    mesh = outline(_extruded(profile))
    dent = [i for i, e in enumerate(mesh.edges) if np.allclose(mesh.vertices[e][:, :2], (1.0, 1.0))]
    assert len(dent) == 1
    rng = np.random.default_rng(RNG_SEED)
    for _ in range(50):
        assert dent[0] not in mesh.contour(rng.normal(0.0, 5.0, 3)).edges


def test_moving_camera_and_object_together_changes_nothing() -> None:
    rng = np.random.default_rng(RNG_SEED)
    mesh = outline(trimesh.creation.torus(0.05, 0.02))
    X_CO, X_WC = distant(rng), distant(rng)
    X_WO = X_WC @ X_CO
    np.testing.assert_allclose(
        contour_ends(mesh, X_CO), contour_ends(mesh, inverse(X_WC) @ X_WO), atol=1e-12
    )


def test_rim_of_a_sheet_is_contour_from_both_sides() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    mesh = MeshOutline(square, np.array([[0, 1, 2], [0, 2, 3]]))
    for height in (1.0, -1.0):
        contour = mesh.contour(np.array([0.3, 0.4, height]))
        assert len(contour.edges) == 4 and (contour.faces >= 0).all()


def test_creases_are_edges_that_people_see() -> None:
    assert len(outline(trimesh.creation.box((0.1, 0.2, 0.3))).creases) == 12
    assert len(outline(trimesh.creation.icosphere(subdivisions=3, radius=0.05)).creases) == 0
    assert len(outline(trimesh.creation.box((1e-3, 1e-3, 1e-3))).creases) == 0  # a bump's size


def test_faces_without_area_do_not_count() -> None:
    box = trimesh.creation.box((0.1, 0.2, 0.3))
    faces = np.vstack([box.faces[:3], [[0, 0, 1]], box.faces[3:]])
    mesh = MeshOutline(np.array(box.vertices), faces)
    assert len(mesh.faces) == 12 and mesh.kept.tolist() == [0, 1, 2, *range(4, 13)]
    assert len(mesh.contour(np.array([1.0, 1.0, 1.0])).edges) == 6


def _extruded(profile: np.ndarray) -> trimesh.Trimesh:
    """A prism of height 1 over an L (corners counter-clockwise, the dent at index 3)."""
    n = len(profile)
    low = np.column_stack([profile, np.zeros(n)])
    vertices = np.vstack([low, low + np.array([0.0, 0.0, 1.0])])
    cap = [(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)]
    faces = [(a, c, b) for a, b, c in cap] + [(a + n, b + n, c + n) for a, b, c in cap]
    for i in range(n):
        k = (i + 1) % n
        faces += [(i, k, k + n), (i, k + n, i + n)]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight and mesh.volume == pytest.approx(3.0)
    return mesh
