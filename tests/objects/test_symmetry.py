"""Which turns take an object onto itself."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.objects.physics.symmetry import SymmetryTest, sample_surface

X, Y, Z = np.eye(3)


def test_a_box_is_the_same_upside_down_but_not_on_its_side() -> None:
    test = SymmetryTest(trimesh.creation.box((0.1, 0.06, 0.03)), np.zeros(3))
    for axis in (X, Y, Z):
        assert test.same(axis, -axis)
    assert not test.same(X, Y)
    assert not test.same(Y, Z)
    assert not test.same(Z, X)


def test_a_cylinder_may_roll() -> None:
    test = SymmetryTest(trimesh.creation.cylinder(0.03, 0.1, sections=48), np.zeros(3))
    for angle in (0.3, 1.0, 2.5):
        assert test.same(X, np.array([np.cos(angle), np.sin(angle), 0.0]))
    assert test.same(Z, -Z)
    assert not test.same(X, Z)


def test_a_cone_is_not_the_same_upside_down() -> None:
    cone = trimesh.creation.cone(0.03, 0.08, sections=48)
    assert not SymmetryTest(cone, cone.center_mass).same(Z, -Z)


def test_mirror_images_are_not_the_same() -> None:
    """Two cranks in space: a bent rod out of a plane is chiral."""
    rods = [
        trimesh.creation.box((0.10, 0.02, 0.02)),
        trimesh.creation.box((0.02, 0.06, 0.02)).apply_translation([0.04, 0.03, 0.0]),
        trimesh.creation.box((0.02, 0.02, 0.08)).apply_translation([-0.04, 0.0, 0.04]),
    ]
    crank = trimesh.util.concatenate(rods)
    test = SymmetryTest(crank, crank.center_mass)
    for axis in (X, Y, Z):
        assert not test.same(axis, -axis)
        assert test.same(axis, axis)


@pytest.mark.parametrize("lid", [0.0, 0.03])
def test_a_hollow_can_with_one_end_open_is_not_the_same_upside_down(lid: float) -> None:
    """The hulls are the same; what is inside tells. A disc within the tolerance does not."""
    outer = trimesh.creation.annulus(0.028, 0.03, 0.08, sections=48)
    disc = trimesh.creation.cylinder(0.028, 0.002, sections=48).apply_translation(
        [0, 0, lid - 0.039]
    )
    can = trimesh.util.concatenate([outer, disc])
    assert not SymmetryTest(can, np.zeros(3)).same(Z, -Z)


def test_the_answer_does_not_depend_on_the_frame() -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.05))
    X_WO = trimesh.transformations.rotation_matrix(1.1, [1, -2, 0.5], [0.3, 0.1, 0])
    moved = box.copy().apply_transform(X_WO)
    test = SymmetryTest(moved, X_WO[:3, 3])
    R = X_WO[:3, :3]
    assert test.same(R @ X, -R @ X)
    assert not test.same(R @ Y, R @ Z)


def test_samples_are_spread_by_area() -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.03))
    points, normals = sample_surface(box, 8000)
    top = points[:, 2] > 0.015 - 1e-12
    assert top.mean() == pytest.approx(0.1 * 0.06 / box.area, rel=0.01)
    np.testing.assert_allclose(normals[top], np.tile(Z, (top.sum(), 1)))
    np.testing.assert_allclose(points[top].mean(axis=0), [0, 0, 0.015], atol=5e-4)
    again, _ = sample_surface(box, 8000)
    np.testing.assert_array_equal(points, again)
