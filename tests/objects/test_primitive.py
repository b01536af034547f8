"""Primitives: shapes that are built are found again, wherever they are and however they are cut."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import inverse, make_pose, transform_points
from burg_drake.objects import (
    Primitive,
    fit_primitive,
    load_library,
    nearest_primitive,
    primitive_mesh,
    primitive_volume,
    surface_distance,
)


def random_pose(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    R = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    return make_pose(R, rng.uniform(-0.3, 0.3, 3))


def recovered(mesh: trimesh.Trimesh, seed: int) -> tuple[Primitive, np.ndarray]:
    """The primitive of a mesh that is moved, and its pose in the mesh's own frame."""
    X = random_pose(seed)
    found = fit_primitive(mesh.copy().apply_transform(X), float(mesh.volume))
    assert found is not None
    return found[0], inverse(X) @ found[0].X_OP.matrix()


@pytest.mark.parametrize(
    ("size", "seed"), [((0.05, 0.08, 0.11), 0), ((0.06, 0.06, 0.06), 3), ((0.2, 0.15, 0.004), 1)]
)
def test_boxes_are_found(size: tuple[float, ...], seed: int) -> None:
    mesh = trimesh.creation.box(size)
    for _ in range(seed):  # few and many triangles
        mesh = mesh.subdivide()
    primitive, X = recovered(mesh, seed)
    assert primitive.shape == "box"
    corners = transform_points(X, trimesh.creation.box(primitive.size).vertices)
    apart = np.linalg.norm(corners[:, None] - mesh.bounding_box.vertices[None], axis=-1)
    assert apart.min(axis=1).max() < 1e-7


@pytest.mark.parametrize(
    ("size", "sections"),
    [((0.034, 0.102), 24), ((0.03, 0.06), 33), ((0.05, 0.004), 200), ((0.004, 0.2), 24)],
)
def test_cylinders_are_found(size: tuple[float, float], sections: int) -> None:
    mesh = trimesh.creation.cylinder(*size, sections=sections)
    primitive, X = recovered(mesh, sections)
    assert primitive.shape == "cylinder"
    assert primitive.size == pytest.approx(size, rel=1e-5)
    assert abs(X[2, 2]) == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(X[:3, 3], 0.0, atol=1e-7)


def test_spheres_are_found() -> None:
    for mesh in (
        trimesh.creation.icosphere(subdivisions=3, radius=0.02),
        trimesh.creation.uv_sphere(0.02, count=[48, 48]),
    ):
        primitive, X = recovered(mesh, 5)
        assert primitive.shape == "sphere"
        assert primitive.size[0] == pytest.approx(0.02, rel=1e-6)
        np.testing.assert_allclose(X[:3, 3], 0.0, atol=1e-7)


def test_noise_of_a_scan_is_forgiven() -> None:
    """A cylinder with 0.2 mm of noise: the primitive is that much larger at most."""
    mesh = trimesh.creation.cylinder(0.034, 0.1, sections=64).subdivide().subdivide()
    rng = np.random.default_rng(0)
    mesh.vertices += rng.uniform(-2e-4, 2e-4, mesh.vertices.shape)
    primitive, X = recovered(mesh, 1)
    assert primitive.shape == "cylinder"
    assert primitive.size == pytest.approx((0.034, 0.1), abs=5e-4)
    assert abs(X[2, 2]) > np.cos(np.deg2rad(0.5))


@pytest.mark.thorough
def test_household_objects_that_are_primitives_and_that_are_not() -> None:
    library = load_library("household")
    expected = {"box": "box", "can": "cylinder", "marble": "sphere"}
    for name in library.objects:
        surface = library.surface(name)
        found = fit_primitive(surface, float(surface.volume))
        assert (found[0].shape if found else None) == expected.get(name), name


def test_near_misses_are_refused() -> None:
    cup = trimesh.creation.annulus(0.03, 0.04, 0.08)
    cone = trimesh.creation.cone(0.04, 0.08, sections=64)
    egg = trimesh.creation.icosphere(subdivisions=4, radius=0.03)
    egg.apply_scale((1.0, 1.0, 1.12))
    rounded = trimesh.creation.capsule(0.06, 0.02)
    for mesh in (cup, cone, egg, rounded):
        assert fit_primitive(mesh, float(mesh.volume)) is None


def test_the_nearest_is_told_even_if_it_is_too_far() -> None:
    """A box with its twelve edges cut off: 8 mm of the corner are gone."""
    size = np.array([0.1, 0.1, 0.1])
    corners = trimesh.creation.box(size).vertices
    cut = np.vstack([c - np.diag(np.sign(c) * 0.012) for c in corners])
    mesh = trimesh.convex.convex_hull(cut)
    assert fit_primitive(mesh, float(mesh.volume)) is None
    nearest = nearest_primitive(mesh, float(mesh.volume))
    assert nearest is not None and nearest[0].shape == "box"
    assert nearest[1].hausdorff == pytest.approx(0.012 / np.sqrt(3), rel=0.02)


def test_volume_and_mesh_agree() -> None:
    for primitive in (
        Primitive(shape="box", size=(0.1, 0.2, 0.3)),
        Primitive(shape="cylinder", size=(0.1, 0.3)),
        Primitive(shape="sphere", size=(0.1,)),
    ):
        mesh = primitive_mesh(primitive)
        assert mesh.volume == pytest.approx(primitive_volume(primitive), rel=4e-3)
        finer = primitive_mesh(primitive, segments=192)
        assert surface_distance(mesh, finer) < 1e-4
