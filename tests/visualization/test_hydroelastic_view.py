"""What hydroelastic contact sees: Drake's meshes in the object frame; the cut by closed forms."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.objects import LibraryDocument, ObjectLibrary, load_library
from burg_drake.visualization import (
    HydroelasticMesh,
    boundary_faces,
    convex_depth,
    cut_open,
    hydroelastic_meshes,
    pressure_colors,
)

SIZE = np.array([0.06, 0.16, 0.21])
CENTER = np.array([0.1, -0.2, 0.3])

MODEL = """<?xml version="1.0"?>
<sdf version="1.9" xmlns:drake="http://drake.mit.edu"><model name="m"><link name="body">
<collision name="c"><pose>{pose} 0 0 0</pose><geometry>{geometry}</geometry>
<drake:proximity_properties>{properties}</drake:proximity_properties></collision>
</link></model></sdf>"""
SOFT = (
    "<drake:compliant_hydroelastic/><drake:hydroelastic_modulus>1e7</drake:hydroelastic_modulus>"
    "<drake:mesh_resolution_hint>0.01</drake:mesh_resolution_hint>"
)


def library_with(tmp_path: Path, geometry: str, properties: str) -> ObjectLibrary:
    pose = " ".join(str(v) for v in CENTER)
    model = MODEL.format(pose=pose, geometry=geometry, properties=properties)
    (tmp_path / "thing.sdf").write_text(model)
    entry = dataclasses.replace(load_library("household").entry("box"), sdf="thing.sdf")
    return ObjectLibrary(LibraryDocument(name="l", objects={"thing": entry}), tmp_path)


def soft_box(tmp_path: Path) -> HydroelasticMesh:
    size = " ".join(str(v) for v in SIZE)
    library = library_with(tmp_path, f"<box><size>{size}</size></box>", SOFT)
    (mesh,) = hydroelastic_meshes(library, ["thing"])["thing"]
    return mesh


def area(vertices: np.ndarray, faces: np.ndarray) -> float:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def test_rigid_pieces_are_the_files_pieces() -> None:
    library = load_library("household")
    meshes = hydroelastic_meshes(library, ["mug"])["mug"]
    paths = library.entry("mug").pieces
    assert len(meshes) == len(paths)
    for mesh, path in zip(meshes, paths, strict=True):
        piece = trimesh.load(library.path(path), process=False)
        assert not mesh.compliant
        assert area(mesh.vertices, mesh.faces) == pytest.approx(piece.area, rel=1e-6)
        assert mesh.vertices.mean(axis=0) == pytest.approx(piece.vertices.mean(axis=0), abs=1e-6)


def test_a_compliant_box_where_its_pose_says(tmp_path: Path) -> None:
    mesh = soft_box(tmp_path)
    assert mesh.compliant
    assert mesh.vertices.min(axis=0) == pytest.approx(CENTER - SIZE / 2)
    assert mesh.vertices.max(axis=0) == pytest.approx(CENTER + SIZE / 2)
    corners = mesh.vertices[mesh.tetrahedra]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])).sum() / 6
    assert volume == pytest.approx(SIZE.prod())
    assert area(mesh.vertices, mesh.faces) == pytest.approx(
        2 * (SIZE[0] * SIZE[1] + SIZE[1] * SIZE[2] + SIZE[2] * SIZE[0])
    )


def test_pressure_is_the_share_of_the_depth(tmp_path: Path) -> None:
    mesh = soft_box(tmp_path)
    depth = (SIZE / 2 - np.abs(mesh.vertices - CENTER)).min(axis=1) / (SIZE.min() / 2)
    assert mesh.pressure == pytest.approx(depth, abs=1e-9)
    assert mesh.pressure.max() == 1.0 and mesh.pressure.min() == 0.0


def test_the_cut_of_a_box(tmp_path: Path) -> None:
    mesh = soft_box(tmp_path)
    vertices, faces, pressure = cut_open(mesh, CENTER, np.array([0.0, -1.0, 0.0]))
    assert (vertices[:, 1] >= CENTER[1] - 1e-12).all()
    x, y, z = SIZE
    assert area(vertices, faces) == pytest.approx(2 * (x * z + x * y / 2 + y * z / 2))
    depth = (SIZE / 2 - np.abs(vertices - CENTER)).min(axis=1) / (SIZE.min() / 2)
    assert pressure == pytest.approx(depth, abs=1e-9)  # linear in each tetrahedron of a box


def test_a_cut_beside_the_body_leaves_all_or_nothing(tmp_path: Path) -> None:
    mesh = soft_box(tmp_path)
    away, normal = CENTER + np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    vertices, faces, _ = cut_open(mesh, away, normal)
    assert area(vertices, faces) == pytest.approx(area(mesh.vertices, mesh.faces))
    assert len(cut_open(mesh, away, -normal)[1]) == 0


def test_a_sphere_has_its_highest_pressure_in_the_middle(tmp_path: Path) -> None:
    library = library_with(tmp_path, "<sphere><radius>0.03</radius></sphere>", SOFT)
    (mesh,) = hydroelastic_meshes(library, ["thing"])["thing"]
    deepest = mesh.vertices[np.argmax(mesh.pressure)]
    assert deepest == pytest.approx(CENTER, abs=1e-3)


def test_point_contact_has_no_mesh(tmp_path: Path) -> None:
    library = library_with(tmp_path, "<sphere><radius>0.03</radius></sphere>", "")
    assert hydroelastic_meshes(library, ["thing"]) == {"thing": ()}


def test_a_damaged_model_is_named(tmp_path: Path) -> None:
    library = load_library("household")
    shutil.copytree(library.root / "box", tmp_path / "box")
    (tmp_path / "box" / "box.sdf").write_text("<sdf")
    damaged = ObjectLibrary(library.document, tmp_path)
    with pytest.raises(InvalidInputError, match=r"box\.sdf cannot be loaded"):
        hydroelastic_meshes(damaged, ["box"])


def test_boundary_of_two_tetrahedra() -> None:
    faces = boundary_faces(np.array([[0, 1, 2, 3], [1, 2, 3, 4]]))
    assert len(faces) == 6
    assert (1, 2, 3) not in {tuple(sorted(face)) for face in faces.tolist()}


def test_depth_in_a_tetrahedron() -> None:
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1], [0, 0, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    assert convex_depth(corners, faces) == pytest.approx([0, 0, 0, 0, 1])


def test_colours_are_linear_in_the_pressure() -> None:
    low, middle, high = pressure_colors(np.array([0.0, 0.5, 1.0]))
    assert middle == pytest.approx((low + high) / 2)
    assert high[0] - low[0] > 0.2 and low[2] - high[2] > 0.4
