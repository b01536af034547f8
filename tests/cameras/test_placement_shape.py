"""Shapes: reference point, symmetry about the vertical, displacements."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.cameras import target_shape, target_shapes
from burg_drake.core import make_pose, rot_z, transform_points
from burg_drake.scene import load_scene

X_SO = make_pose(rot_z(0.7), (0.2, 0.1, 0.05))


def test_the_reference_of_an_l_is_the_middle_of_its_outline_and_turns_with_it() -> None:
    vertices = np.array([[0, 0], [0.06, 0], [0.06, 0.02], [0.02, 0.02], [0.02, 0.04], [0, 0.04]])
    points = np.column_stack([np.vstack([vertices, vertices]), np.repeat([0.0, 0.01], 6)])
    mesh = trimesh.convex.convex_hull(points)
    # the hull is the rectangle of 60 x 40 without the triangle of 40 x 20 at its far corner
    area, missing = 0.06 * 0.04, 0.04 * 0.02 / 2
    middle = area * np.array([0.03, 0.02]) - missing * np.array([0.06 - 0.04 / 3, 0.04 - 0.02 / 3])
    middle /= area - missing
    for X in (np.eye(4), X_SO):
        shape = target_shape(mesh.vertices, mesh.faces, X)
        np.testing.assert_allclose(shape.p_OR[:2], middle, atol=1e-6)
        assert shape.p_SR[2] == 0.0


@pytest.mark.parametrize(
    ("mesh", "round_about_z"),
    [
        (trimesh.creation.cylinder(radius=0.03, height=0.1, sections=48), True),
        (trimesh.creation.icosphere(subdivisions=3, radius=0.03), True),
        (trimesh.creation.cone(radius=0.03, height=0.08, sections=48), True),
        (trimesh.creation.box((0.05, 0.05, 0.1)), False),
        (trimesh.creation.box((0.1, 0.05, 0.001)), False),
        (trimesh.creation.cylinder(radius=0.03, height=0.1, sections=6), False),
    ],
)
def test_round_objects_are_told(mesh: trimesh.Trimesh, round_about_z: bool) -> None:
    assert target_shape(mesh.vertices, mesh.faces, X_SO).symmetric == round_about_z
    lying = X_SO @ make_pose(np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
    sphere = len(mesh.vertices) == 642
    assert target_shape(mesh.vertices, mesh.faces, lying).symmetric == sphere


def test_of_the_household_objects_bowl_and_cans_are_round() -> None:
    shapes = target_shapes(load_scene("tabletop_twelve"))
    assert {name for name, shape in shapes.items() if shape.symmetric} == {"bowl", "can", "can_2"}


def test_a_displacement_moves_the_reference_and_turns_about_it() -> None:
    box = trimesh.creation.box((0.04, 0.06, 0.1))
    box.apply_translation((0.3, 0.0, 0.0))  # the mesh's origin is far away from the object
    shape = target_shape(box.vertices, box.faces, X_SO)
    q = np.array([0.01, -0.02, 0.3])
    X = shape.placed(q)
    moved = transform_points(X, shape.p_OR[None])[0]
    np.testing.assert_allclose(moved, shape.p_SR + np.array([0.01, -0.02, 0.0]), atol=1e-12)
    np.testing.assert_allclose(X[:3, :3], rot_z(0.3) @ X_SO[:3, :3], atol=1e-12)
