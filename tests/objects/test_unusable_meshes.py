"""Broken meshes that no object can be made of, and the exact message of each.

Those that can be repaired are in `test_broken_meshes`.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from burg_drake.core import MeshError
from burg_drake.objects import (
    STL_HEADER_BYTES,
    STL_TRIANGLE_BYTES,
    announced_triangle_count,
    load_mesh,
    mesh_file,
    texture_image,
)

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
        (
            "the mesh is flat (0 x 0 x 0 mm), but an object needs a volume: wall_thickness"
            " makes it a wall"
        ),
    ),
    "perfectly flat": (
        lambda: _raw([[0, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0]], [[0, 1, 2]]),
        (
            "the mesh is flat (200 x 100 x 0 mm), but an object needs a volume:"
            " wall_thickness makes it a wall"
        ),
    ),
    "closed sheet without thickness": (
        _doubled,
        (
            "the closed surface encloses no volume (is it a sheet without thickness?); give"
            " only one side of it, as an open surface, and it becomes a wall"
        ),
    ),
    "millimetres": (
        lambda: _raw(1e3 * _box().vertices, _box().faces),
        (
            "taken as metres, the mesh is 100 m long; try unit mm (scale=0.001 makes it 100"
            " mm) or unit cm (scale=0.01 makes it 1000 mm)"
        ),
    ),
    "kilometres": (
        lambda: _raw(1e-3 * _box().vertices, _box().faces),
        "taken as metres, the mesh is 0.1 mm long; try scale=1000",
    ),
}


@pytest.mark.parametrize("kind", IN_MEMORY)
def test_errors(kind: str) -> None:
    make, expected = IN_MEMORY[kind]
    with pytest.raises(MeshError) as caught:
        load_mesh(make())
    assert str(caught.value) == f"mesh in memory: {expected}"
    assert caught.value.units == (("mm", "cm") if kind == "millimetres" else ())


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
        (
            ".step is not a mesh format that can be read; those are .obj, .ply, .stl, .off,"
            " .glb, .gltf"
        ),
    ),
    "truncated": ("a.stl", lambda: _stl()[:3000], f"{STL} it has 3000 of 9684 bytes"),
    "truncated header": (
        "a.ply",
        lambda: b"ply\nformat ascii 1.0\nelement vertex 3\n",
        "not a readable .ply mesh (cut off or damaged?): IndexError: list index out of range",
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
        "not a readable .obj mesh (cut off or damaged?): IndexError: index 3 is out of bounds"
        " for axis 0 with size 3",
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


def test_a_name_that_is_not_utf_8(tmp_path: Path) -> None:
    with pytest.raises(MeshError) as caught:
        load_mesh(tmp_path / os.fsdecode(b"b\xe4r.obj"))
    assert str(caught.value) == (
        f"{tmp_path}/b\\xe4r.obj: the path is not valid UTF-8; rename the file or its folder"
    )


HEADERS = {
    "a.stl": bytes(80) + struct.pack("<I", 12),
    "b.stl": b"solid\n" + 12 * b"facet\nendfacet\n",
    "a.ply": b"ply\nformat binary 1.0\ncomment face 99\nelement vertex 9\nelement face 12\n",
    "a.off": b"OFF\n9 12 0\n",
    "a.obj": 9 * b"v 0 0 0\n" + 12 * b"f 1 2 3\n",
    "a.glb": b"glTF",
}


@pytest.mark.parametrize("name", HEADERS)
def test_triangles_are_counted_before_a_file_is_read(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(HEADERS[name].ljust(STL_HEADER_BYTES + 12 * STL_TRIANGLE_BYTES))
    assert announced_triangle_count(path) == (0 if name == "a.glb" else 12)


def test_meshes_of_too_many_triangles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_file, "MAX_MESH_TRIANGLES", 100)
    _box(2).export(tmp_path / "box.ply")
    with pytest.raises(MeshError, match=r"box.ply: 192 triangles; .* 100"):
        load_mesh(tmp_path / "box.ply")
    sheet = _raw(_box(2).vertices, _box(2).faces[:80])
    with pytest.raises(MeshError, match=r"80 triangles; .* wall may have 50"):
        load_mesh(sheet)


def _with_texture(folder: Path, suffix: str) -> Path:
    """A box with a texture of 40 x 30 pixels, beside the file or in it."""
    box = trimesh.creation.box(SIZE)
    material = trimesh.visual.material.SimpleMaterial(image=Image.new("RGB", (40, 30)))
    box.visual = trimesh.visual.TextureVisuals(np.zeros((8, 2)), material)
    box.export(folder / f"box{suffix}")
    return folder / f"box{suffix}"


@pytest.mark.parametrize("suffix", [".obj", ".glb", ".gltf"])
def test_textures_of_too_many_pixels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    mesh = _with_texture(tmp_path, suffix)
    assert texture_image(load_mesh(mesh).visual) is not None
    monkeypatch.setattr(mesh_file, "MAX_TEXTURE_PIXELS", 1000)
    with pytest.raises(MeshError, match=r": 40 x 30 pixels; .* 31 x 31"):
        load_mesh(mesh)


def test_the_whole_of_what_a_reader_says_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stumble(*_: object, **__: object) -> None:
        raise TypeError("incompatible arguments, supported are:\n  1. (int) -> str")

    monkeypatch.setattr(trimesh, "load_scene", stumble)
    (tmp_path / "a.obj").write_text("v 0 0 0\n")
    with pytest.raises(MeshError) as caught:
        load_mesh(tmp_path / "a.obj")
    assert str(caught.value) == (
        f"{tmp_path / 'a.obj'}: not a readable .obj mesh (cut off or damaged?): TypeError:"
        " incompatible arguments, supported are: 1. (int) -> str"
    )
