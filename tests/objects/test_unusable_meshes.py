"""Broken meshes that no object can be made of, and the exact message of each.

Those that can be repaired are in `test_broken_meshes`.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from burg_drake.core.errors import MeshError
from burg_drake.objects.meshes import load_mesh

SIZE = np.array([0.1, 0.06, 0.04])


def _raw(vertices: np.ndarray, faces: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(np.array(vertices), np.array(faces), process=False, validate=False)


def _box(subdivisions: int = 2) -> trimesh.Trimesh:
    box = trimesh.creation.box(SIZE)
    for _ in range(subdivisions):
        box = box.subdivide()
    return _raw(box.vertices, box.faces)


def _with_vertex(index: int, value: float) -> trimesh.Trimesh:
    box = _box()
    vertices = np.array(box.vertices)
    vertices[index, 1] = value
    return _raw(vertices, box.faces)


def _doubled() -> trimesh.Trimesh:
    """A dome, closed by itself a hair below: a sheet with two sides and nothing between."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    vertices = np.array(ball.vertices)
    below = vertices[:, 2] < 0.0
    vertices[below, 2] = -vertices[below, 2] - 2e-8
    return _raw(vertices, ball.faces)


IN_MEMORY: dict[str, tuple[Callable[[], trimesh.Trimesh], str]] = {
    "no faces": (
        lambda: _raw(_box().vertices, np.zeros((0, 3), dtype=int)),
        "the mesh has no triangles",
    ),
    "NaN": (lambda: _with_vertex(3, np.nan), "1 of 98 vertices are NaN or infinite"),
    "infinite": (lambda: _with_vertex(3, -np.inf), "1 of 98 vertices are NaN or infinite"),
    "index out of range": (
        lambda: _raw(_box(0).vertices, [[0, 1, 2], [0, 8, 1], [2, 3, -1]]),
        "2 of 3 triangles refer to vertices that do not exist, such as [0, 8, 1] of 8 vertices"
        " (counted from 0)",
    ),
    "all at one point": (
        lambda: _raw(np.full((8, 3), 0.3), _box(0).faces),
        "all vertices are at one point",
    ),
    "on a line": (
        lambda: _raw(_box(0).vertices * [1, 0, 0], _box(0).faces),
        "the mesh is flat (0 x 0 x 0 mm); an object needs a volume: wall_thickness"
        " (--wall-thickness) makes a wall of it",
    ),
    "perfectly flat": (
        lambda: _raw([[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0]], [[0, 1, 2]]),
        "the mesh is flat (200 x 100 x 0 mm); an object needs a volume: wall_thickness"
        " (--wall-thickness) makes a wall of it",
    ),
    "closed sheet without thickness": (
        _doubled,
        "the closed surface encloses no volume (a sheet without thickness?); give one side of it"
        " as an open surface, which becomes a wall",
    ),
    "millimetres": (
        lambda: _raw(1e3 * _box().vertices, _box().faces),
        "largest extent is 100 m, but lengths are in metres; try --unit mm (scale=0.001 makes it"
        " 100 mm) or --unit cm (scale=0.01 makes it 1000 mm)",
    ),
    "kilometres": (
        lambda: _raw(1e-3 * _box().vertices, _box().faces),
        "largest extent is 0.1 mm, but lengths are in metres; try scale=1000 (--scale 1000)",
    ),
}


@pytest.mark.parametrize("kind", IN_MEMORY)
def test_errors(kind: str) -> None:
    make, expected = IN_MEMORY[kind]
    with pytest.raises(MeshError) as caught:
        load_mesh(make())
    assert str(caught.value) == f"mesh in memory: {expected}"


def _stl() -> bytes:
    return _box().export(file_type="stl")


STL = "not a readable .stl mesh (cut off or damaged?):"

FILES: dict[str, tuple[str, Callable[[], bytes], str]] = {
    "empty": ("a.stl", lambda: b"", "the mesh file is empty"),
    "not a mesh": (
        "a.obj",
        lambda: b"<html><body>404: not found</body></html>",
        "the mesh file has no triangles",
    ),
    "another format": (
        "a.step",
        lambda: b"ISO-10303-21;",
        ".step is not one of .obj, .ply, .stl, .off, .glb, .gltf",
    ),
    "truncated": ("a.stl", lambda: _stl()[:3000], f"{STL} it has 3000 of 9684 bytes"),
    "truncated header": (
        "a.ply",
        lambda: b"ply\nformat ascii 1.0\nelement vertex 3\n",
        "not a readable .ply mesh (cut off or damaged?): list index out of range",
    ),
    "no faces": ("a.obj", lambda: b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "the mesh file has no triangles"),
    "no triangles": (
        "a.stl",
        lambda: bytes(80) + struct.pack("<I", 0),
        "the mesh file has no triangles",
    ),
    "index out of range": (
        "a.obj",
        lambda: b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
        "not a readable .obj mesh (cut off or damaged?): index 3 is out of bounds for axis 0 with"
        " size 3",
    ),
}


@pytest.mark.parametrize("kind", FILES)
def test_files(tmp_path: Path, kind: str) -> None:
    name, content, expected = FILES[kind]
    path = tmp_path / name
    path.write_bytes(content())
    with pytest.raises(MeshError) as caught:
        load_mesh(path)
    assert str(caught.value) == f"{path}: {expected}"
