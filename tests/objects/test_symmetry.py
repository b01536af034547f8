"""Which turns take an object onto itself."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array
from burg_drake.objects import Symmetries, SymmetrySearch, sample_surface
from tests.thorough import thorough

X, Y, Z = np.eye(3)


TURN = np.deg2rad(0.5)


def find(mesh: trimesh.Trimesh, center: Array | None = None) -> Symmetries:
    return SymmetrySearch(mesh, np.asarray(mesh.center_mass if center is None else center)).find()


def orders() -> dict[str, tuple[trimesh.Trimesh, int]]:
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) * 0.03
    return {
        "brick": (trimesh.creation.box((0.1, 0.06, 0.03)), 4),
        "square bar": (trimesh.creation.box((0.05, 0.05, 0.1)), 8),
        "hexagonal bar": (trimesh.creation.cylinder(0.02, 0.1, sections=6), 12),
        "pyramid": (trimesh.creation.cone(0.03, 0.08, sections=5), 5),
        "tetrahedron": (trimesh.convex.convex_hull(corners), 12),
        "cube": (trimesh.creation.box((0.05, 0.05, 0.05)), 24),
        "icosahedron": (trimesh.creation.icosahedron().apply_scale(0.05), 60),
    }


@pytest.mark.parametrize(
    "name",
    [
        "brick",
        "hexagonal bar",
        "cube",
        "icosahedron",
        *map(thorough, ("square bar", "pyramid", "tetrahedron")),
    ],
)
def test_the_number_of_rotations_is_that_of_the_group(name: str) -> None:
    """Of the rotation groups of prisms and regular polyhedra; each takes vertices to vertices."""
    mesh, order = orders()[name]
    X = trimesh.transformations.rotation_matrix(1.1, [1, -2, 0.5], [0.3, 0.1, 0])
    mesh = mesh.copy().apply_transform(X)
    found = find(mesh)
    assert (len(found.rotations), found.axis, found.sphere) == (order, None, False)
    about = mesh.vertices - mesh.center_mass
    for R in found.rotations:
        gaps = np.linalg.norm((about @ R.T)[:, None] - about[None], axis=2).min(axis=1)
        assert gaps.max() < 5e-4


def test_a_bar_is_not_the_same_on_its_narrow_side() -> None:
    """4 mm differ, which is little beside its length."""
    bar = trimesh.creation.box((0.3, 0.022, 0.014))
    found = find(bar)
    assert found.maps_close(Z, -Z, TURN) and found.maps_close(Y, -Y, TURN)
    assert not found.maps_close(Y, Z, TURN)


@pytest.mark.parametrize(("apart", "alike"), [(1e-4, True), (4e-4, False)])
def test_differences_count_from_tenths_of_a_millimetre(apart: float, alike: bool) -> None:
    found = find(trimesh.creation.box((0.1, 0.05, 0.05 + 2.0 * apart)))
    assert found.maps_close(Y, Z, TURN) == alike


def test_bodies_of_revolution_have_an_axis() -> None:
    cylinder = find(trimesh.creation.cylinder(0.03, 0.1, sections=64))
    cone = find(trimesh.creation.cone(0.03, 0.08, sections=64))
    for found, upside_down in ((cylinder, True), (cone, False)):
        assert found.axis is not None
        assert abs(found.axis[2]) == pytest.approx(1.0, abs=1e-6)
        assert found.maps_close(Z, -Z, TURN) == upside_down
        for angle in (0.3, 1.0, 2.5):
            assert found.maps_close(X, np.array([np.cos(angle), np.sin(angle), 0.0]), TURN)
        assert not found.maps_close(X, Z, TURN)


def test_a_cylinder_as_tall_as_its_moments_are_equal_has_an_axis() -> None:
    """Its second moments single out no direction."""
    search = [find(trimesh.creation.cylinder(0.03, h, sections=64)) for h in (0.053, 0.0545)]
    assert all(found.axis is not None for found in search)


def test_any_turn_takes_a_ball_onto_itself() -> None:
    found = find(trimesh.creation.icosphere(4, 0.02))
    assert found.sphere and found.maps_close(X, Y, TURN)


def test_lumpy_balls_are_not_tried_in_every_direction(monkeypatch: pytest.MonkeyPatch) -> None:
    """As scans of fruit are: no direction is singled out, and no turn fits."""
    tried = []
    refined = SymmetrySearch._refine_rotation

    def counted(search: SymmetrySearch, R: Array) -> Array | None:
        tried.append(R)
        return refined(search, R)

    monkeypatch.setattr(SymmetrySearch, "_refine_rotation", counted)
    ball = trimesh.creation.icosphere(4, 0.04)
    rng = np.random.default_rng(0)
    lumps = rng.normal(size=(60, 3))
    lumps /= np.linalg.norm(lumps, axis=1)[:, None]
    near = np.exp((ball.vertices @ lumps.T / 0.04 - 1.0) / 0.02)
    ball.vertices *= 1.0 + 0.02 * (near @ rng.uniform(-1.0, 1.0, 60))[:, None]
    search = SymmetrySearch(ball, np.asarray(ball.center_mass))
    found = search.find()
    assert (len(found.rotations), found.axis, found.sphere) == (1, None, False)
    assert len(tried) < 100
    before = len(tried)
    search.find()
    assert len(tried) == before


def test_mirror_images_are_not_the_same() -> None:
    """Two cranks in space: a bent rod out of a plane is chiral."""
    rods = [
        trimesh.creation.box((0.10, 0.02, 0.02)),
        trimesh.creation.box((0.02, 0.06, 0.02)).apply_translation([0.04, 0.03, 0.0]),
        trimesh.creation.box((0.02, 0.02, 0.08)).apply_translation([-0.04, 0.0, 0.04]),
    ]
    assert len(find(trimesh.util.concatenate(rods)).rotations) == 1


@pytest.mark.parametrize("lid", [0.0, thorough(0.03)])
def test_a_hollow_can_with_one_end_open_is_not_the_same_upside_down(lid: float) -> None:
    """The hulls are the same; what is inside tells."""
    outer = trimesh.creation.annulus(0.028, 0.03, 0.08, sections=48)
    disc = trimesh.creation.cylinder(0.028, 0.002, sections=48).apply_translation(
        [0, 0, lid - 0.039]
    )
    found = find(trimesh.util.concatenate([outer, disc]), np.zeros(3))
    assert found.axis is not None and not found.maps_close(Z, -Z, TURN)


def test_samples_are_spread_by_area() -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.03))
    points, normals = sample_surface(box, 8000)
    top = points[:, 2] > 0.015 - 1e-12
    assert top.mean() == pytest.approx(0.1 * 0.06 / box.area, rel=0.01)
    np.testing.assert_allclose(normals[top], np.tile(Z, (top.sum(), 1)))
    np.testing.assert_allclose(points[top].mean(axis=0), [0, 0, 0.015], atol=5e-4)
    again, _ = sample_surface(box, 8000)
    np.testing.assert_array_equal(points, again)
