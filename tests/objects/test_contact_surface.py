"""The surface that pads touch: closed, near the object's, with its normals, and few faces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.core import Array, MeshError
from burg_drake.objects import (
    MAX_CONTACT_DISTANCE,
    MAX_NORMAL_ANGLE,
    MAX_TURNED_SHARE,
    SurfaceNormals,
    contact_surface,
    load_library,
    max_excess,
    min_face_height,
)
from tests.thorough import thorough

RADIUS, TUBE = 0.04, 0.012


def sphere(subdivisions: int = 5) -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions, RADIUS)


def torus() -> trimesh.Trimesh:
    return trimesh.creation.torus(RADIUS, TUBE, major_sections=96, minor_sections=48)


def cylinder() -> trimesh.Trimesh:
    return trimesh.creation.cylinder(RADIUS, 0.1, sections=256)


def tube(wall: float) -> trimesh.Trimesh:
    return trimesh.creation.annulus(RADIUS - wall, RADIUS, 0.1, sections=128)


def off_sphere(points: Array) -> tuple[Array, Array]:
    """Distances of points (N, 3) from the sphere, and its normals there."""
    length = np.linalg.norm(points, axis=1)
    return np.abs(length - RADIUS), points / length[:, None]


def off_torus(points: Array) -> tuple[Array, Array]:
    ring = points * (1.0, 1.0, 0.0)
    ring *= RADIUS / np.linalg.norm(ring, axis=1, keepdims=True)
    length = np.linalg.norm(points - ring, axis=1)
    return np.abs(length - TUBE), (points - ring) / length[:, None]


def off_cylinder(points: Array) -> tuple[Array, Array]:
    radius, height = np.linalg.norm(points[:, :2], axis=1), np.abs(points[:, 2])
    side = np.abs(radius - RADIUS) < np.abs(height - 0.05)
    away = np.where(side, np.abs(radius - RADIUS), np.abs(height - 0.05))
    normals = np.where(side[:, None], points * (1, 1, 0), points * (0, 0, 1))
    return away, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("surface", "off", "most_faces"),
    [
        (sphere(), off_sphere, 1500),
        thorough(torus(), off_torus, 2500),
        (cylinder(), off_cylinder, 250),
    ],
)
def test_distance_and_normals_are_those_of_the_closed_form(surface, off, most_faces) -> None:  # type: ignore[no-untyped-def]
    mesh, fit = contact_surface(surface, True)
    points, face = trimesh.sample.sample_surface(mesh, 20_000, seed=7)
    away, normals = off(points)
    given = off(surface.triangles_center)[0].max()  # the surface itself has faces
    assert away.max() <= MAX_CONTACT_DISTANCE + given
    assert fit.hausdorff <= MAX_CONTACT_DISTANCE
    cosine = (mesh.face_normals[face] * normals).sum(axis=1)
    assert (cosine < np.cos(MAX_NORMAL_ANGLE + 0.02)).mean() <= MAX_TURNED_SHARE + 0.01
    assert len(mesh.faces) <= most_faces


@pytest.mark.parametrize("name", ["mug", "banana", "screwdriver"])
def test_household_objects_keep_their_shape(name: str) -> None:
    library = load_library("household")
    entry = library.entry(name)
    assert entry.contact.kind == "surface" and entry.contact.fit is not None
    mesh, surface = trimesh.load_mesh(library.path(entry.contact.mesh)), library.surface(name)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0
    assert mesh.euler_number == surface.euler_number
    assert 500 <= len(mesh.faces) <= 3000
    assert min_face_height(mesh) > 1e-5
    for one, other in ((mesh, surface), (surface, mesh)):  # rays along the normal, both ways
        points, face = trimesh.sample.sample_surface(one, 1500, seed=3)
        step = one.face_normals[face]
        first = [nearest_hit(other, points, sign * step) for sign in (1.0, -1.0)]
        away = np.minimum(*first)
        assert np.quantile(away, 0.95) < MAX_CONTACT_DISTANCE  # at edges a ray may pass beside
    assert entry.contact.fit.hausdorff <= MAX_CONTACT_DISTANCE


def nearest_hit(mesh: trimesh.Trimesh, origins: Array, directions: Array) -> Array:
    """Distances (N,) along rays to the first hit; infinite where there is none."""
    back = 1e-9  # a ray that starts on a face hits it
    places, rays, _ = mesh.ray.intersects_location(
        origins - back * directions, directions, multiple_hits=False
    )
    found = np.full(len(origins), np.inf)
    found[rays] = np.linalg.norm(places - origins[rays], axis=1)
    return found


@pytest.mark.parametrize("wall", [thorough(2e-3), 5e-4])
def test_thin_walls_stay_closed_and_keep_their_sides(wall: float) -> None:
    mesh, fit = contact_surface(tube(wall), True)
    assert mesh.is_watertight and mesh.euler_number == 0
    assert fit.volume_ratio == pytest.approx(1.0, abs=0.03)
    radius = np.linalg.norm(mesh.vertices[:, :2], axis=1)
    assert np.minimum(np.abs(radius - RADIUS), np.abs(radius - RADIUS + wall)).max() < 3e-4


def test_flat_places_become_large_triangles() -> None:
    box = trimesh.creation.box((0.1, 0.05, 0.02))
    for _ in range(3):
        box = box.subdivide()
    mesh, fit = contact_surface(box, True)
    assert len(mesh.faces) <= 24 < len(box.faces)
    assert fit.hausdorff < 1e-6 and mesh.volume == pytest.approx(box.volume, rel=1e-5)


@pytest.mark.thorough
def test_noise_does_not_keep_the_faces_of_a_scan() -> None:
    scan, rng = sphere(), np.random.default_rng(0)
    scan.vertices += rng.normal(0.0, 5e-5, scan.vertices.shape)
    mesh, fit = contact_surface(scan, True)
    assert len(mesh.faces) < len(scan.faces) / 5 and fit.hausdorff <= MAX_CONTACT_DISTANCE
    away, _ = off_sphere(mesh.triangles_center)
    assert np.sqrt((away**2).mean()) < 1.5e-4


def test_a_turned_normal_is_seen_and_the_surface_itself_has_none() -> None:
    true = SurfaceNormals(sphere(4))
    assert true.turned_share(sphere(4)) == 0.0
    assert true.turned_share(trimesh.creation.icosphere(1, RADIUS)) > 0.3


def test_why_there_is_none() -> None:
    with pytest.raises(MeshError, match=r"^its surface is not closed$"):
        contact_surface(sphere(2), False)
    rough, rng = sphere(5), np.random.default_rng(0)
    rough.vertices += rng.normal(0.0, 4e-4, rough.vertices.shape)
    text = (
        r"^its surface cannot be reduced to 10000 faces without being more than 0.25 mm or 10"
        r" degrees off$"
    )
    with pytest.raises(MeshError, match=text):
        contact_surface(rough, True)


@pytest.mark.thorough
def test_a_mesh_of_a_million_faces() -> None:
    mesh, fit = contact_surface(sphere(8), True)
    assert len(mesh.faces) < 2_000
    assert fit.hausdorff <= MAX_CONTACT_DISTANCE


def test_of_bodies_that_were_united() -> None:
    bar = trimesh.creation.box((0.1, 0.01, 0.01))
    cross = trimesh.boolean.union([bar, trimesh.creation.cylinder(0.01, 0.1)])
    cross.vertices.flags.writeable = False  # as of a result of Manifold
    mesh, fit = contact_surface(cross, True)
    assert mesh.is_watertight
    assert fit.volume_ratio == pytest.approx(1.0, abs=0.02)


def test_the_same_surface_twice() -> None:
    one, other = (contact_surface(sphere(3), True)[0] for _ in range(2))
    assert one.vertices.tobytes() == other.vertices.tobytes()
    assert one.faces.tobytes() == other.faces.tobytes()


def test_excess_is_how_far_it_stands_out_of_the_pieces() -> None:
    inner = trimesh.creation.box((0.1, 0.1, 0.1))
    outer = trimesh.creation.box((0.1, 0.1, 0.106))
    assert max_excess(outer, [inner]) == pytest.approx(3e-3, rel=1e-6)
    assert max_excess(inner, [outer]) == 0.0
    halves = [
        trimesh.creation.box(bounds=[(-0.05, -0.05, -0.053), (0.01, 0.05, 0.053)]),
        trimesh.creation.box(bounds=[(-0.01, -0.05, -0.053), (0.048, 0.05, 0.053)]),
    ]
    assert max_excess(outer, halves) == pytest.approx(2e-3, rel=1e-6)
