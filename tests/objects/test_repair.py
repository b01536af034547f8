"""Repairs: each restores the volume of a solid whose volume is known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from burg_drake.objects import boundary_loops, connected_bodies, repair

BOX = (0.1, 0.06, 0.04)
VOLUME = 0.1 * 0.06 * 0.04


@pytest.fixture
def box() -> trimesh.Trimesh:
    return trimesh.creation.box(BOX).subdivide().subdivide()


def _raw(vertices: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)


def test_sound_meshes_are_left_alone(box: trimesh.Trimesh) -> None:
    result = repair(box)
    assert result.sentences == []
    np.testing.assert_array_equal(result.mesh.faces, box.faces)


def test_soup_is_merged(box: trimesh.Trimesh) -> None:
    soup = _raw(box.triangles.reshape(-1, 3), np.arange(3 * len(box.faces)).reshape(-1, 3))
    result = repair(soup)
    assert result.mesh.is_watertight
    assert len(result.mesh.vertices) == len(box.vertices)
    merged = 3 * len(box.faces) - len(box.vertices)
    assert result.sentences == [f"merged {merged} duplicate vertices"]


def test_nearly_coincident_vertices_are_sewn(box: trimesh.Trimesh) -> None:
    corners = box.triangles.reshape(-1, 3)
    noise = np.random.default_rng(1).uniform(-1, 1, corners.shape) * 1e-8
    result = repair(_raw(corners + noise, np.arange(len(corners)).reshape(-1, 3)))
    assert result.mesh.is_watertight
    assert result.mesh.volume == pytest.approx(VOLUME, rel=1e-5)


def test_inverted_surfaces_are_turned(box: trimesh.Trimesh) -> None:
    result = repair(_raw(box.vertices, box.faces[:, ::-1]))
    assert result.mesh.volume == pytest.approx(VOLUME)
    assert result.inverted


def test_mixed_winding_is_made_consistent(box: trimesh.Trimesh) -> None:
    faces = np.array(box.faces)
    faces[::3] = faces[::3, ::-1]
    result = repair(_raw(box.vertices, faces))
    assert result.mesh.is_winding_consistent
    assert result.mesh.volume == pytest.approx(VOLUME)
    assert "to a consistent winding" in result.sentences[0]


def test_small_holes_are_filled(box: trimesh.Trimesh) -> None:
    fine = box.subdivide().subdivide()
    around = np.nonzero((fine.faces == fine.faces[7, 0]).any(axis=1))[0]
    result = repair(_raw(fine.vertices, np.delete(fine.faces, around, axis=0)))
    assert result.mesh.is_watertight
    assert result.mesh.is_winding_consistent
    assert result.mesh.volume == pytest.approx(VOLUME, rel=0.02)
    assert "filled 1 small holes" in result.sentences


def test_large_holes_stay_open(box: trimesh.Trimesh) -> None:
    open_box = _raw(box.vertices, box.faces[box.triangles_center[:, 2] < 0.0199])
    result = repair(open_box)
    assert not result.mesh.is_watertight
    assert len(boundary_loops(result.mesh)) == 1


def test_specks_are_dropped(box: trimesh.Trimesh) -> None:
    speck = trimesh.creation.icosphere(subdivisions=1, radius=2e-4).apply_translation([0, 0, 0.1])
    result = repair(trimesh.util.concatenate([box, speck]))
    assert result.mesh.volume == pytest.approx(VOLUME)
    assert result.sentences == ["dropped 1 tiny separate parts (80 faces)"]


def test_degenerate_and_duplicate_faces_are_dropped(box: trimesh.Trimesh) -> None:
    more = [[3, 3, 5], *box.faces[:4].tolist(), box.faces[9, [1, 2, 0]].tolist()]
    result = repair(_raw(box.vertices, np.vstack([box.faces, more])))
    assert len(result.mesh.faces) == len(box.faces)
    assert result.mesh.is_watertight
    assert "dropped 1 degenerate faces" in result.sentences
    assert "dropped 5 duplicate faces" in result.sentences


def test_fins_without_thickness_are_dropped(box: trimesh.Trimesh) -> None:
    """A face and its back on one edge of a closed surface, as scanners leave them."""
    a, b = box.edges[0]
    vertices = np.vstack([box.vertices, box.vertices[a] * 1.2])
    n = len(box.vertices)
    result = repair(_raw(vertices, np.vstack([box.faces, [[a, b, n], [b, a, n]]])))
    assert result.mesh.is_watertight
    assert result.mesh.volume == pytest.approx(VOLUME)


def _hollow(outer: int, inner: int) -> trimesh.Trimesh:
    """Spherical shell; `outer` and `inner` are 1 for normals away from the centre."""
    parts = []
    for radius, sign in ((0.05, outer), (0.04, inner)):
        part = trimesh.creation.icosphere(subdivisions=3, radius=radius)
        if sign < 0:
            part.invert()
        parts.append(part)
    return trimesh.util.concatenate(parts)


def test_cavities_stay_cavities() -> None:
    shell = 4.0 / 3.0 * np.pi * (0.05**3 - 0.04**3)
    assert repair(_hollow(1, -1)).mesh.volume == pytest.approx(shell, rel=0.01)
    assert repair(_hollow(1, -1)).sentences == []


def test_hollow_things_inside_out_are_turned_as_a_whole() -> None:
    shell = 4.0 / 3.0 * np.pi * (0.05**3 - 0.04**3)
    assert repair(_hollow(-1, 1)).mesh.volume == pytest.approx(shell, rel=0.01)


def test_one_inverted_body_of_two_is_turned(box: trimesh.Trimesh) -> None:
    other = box.copy().apply_translation([0.3, 0, 0])
    other.invert()
    result = repair(trimesh.util.concatenate([box, other]))
    assert result.mesh.volume == pytest.approx(2 * VOLUME)
    assert not result.inverted


def test_bodies_are_found_by_their_edges(box: trimesh.Trimesh) -> None:
    other = trimesh.creation.icosphere(subdivisions=1).apply_translation([3, 0, 0])
    groups = connected_bodies(trimesh.util.concatenate([box, other]))
    assert [len(g) for g in groups] == [len(box.faces), 80]
