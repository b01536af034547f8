"""OBJ files: read back by another reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from burg_drake.objects import corner_normals, write_piece, write_visual


def test_pieces_come_back(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(2, 0.05)
    ball.vertices = np.round(ball.vertices, 7)
    write_piece(ball, tmp_path / "a.obj")
    back = trimesh.load_mesh(tmp_path / "a.obj", process=False)
    np.testing.assert_array_equal(back.vertices, ball.vertices)
    np.testing.assert_array_equal(back.faces, ball.faces)


def test_boxes_have_flat_faces() -> None:
    box = trimesh.creation.box((0.1, 0.06, 0.03))
    normals = corner_normals(box)
    np.testing.assert_allclose(normals, np.repeat(box.face_normals[:, None], 3, axis=1), atol=1e-12)


def test_spheres_are_smooth() -> None:
    ball = trimesh.creation.icosphere(3, 1.0)
    angle = (corner_normals(ball) * ball.triangles).sum(axis=2)
    assert angle.min() > np.cos(np.deg2rad(1.0))


def test_seams_of_textures_do_not_show() -> None:
    ball = trimesh.creation.icosphere(3, 1.0)
    soup = trimesh.Trimesh(
        ball.triangles.reshape(-1, 3), np.arange(3 * len(ball.faces)).reshape(-1, 3), process=False
    )
    np.testing.assert_allclose(corner_normals(soup), corner_normals(ball), atol=1e-12)


def test_faces_without_area_have_finite_normals() -> None:
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]], process=False)
    assert np.isfinite(corner_normals(mesh)).all()


def test_colour(tmp_path: Path) -> None:
    write_visual(trimesh.creation.box(), tmp_path / "mesh.obj", rgba=(1.0, 0.2, 0.0, 1.0))
    text = (tmp_path / "mesh.obj").read_text()
    assert text.startswith("mtllib mesh.mtl\n")
    assert text.count("\nvn ") == 6
    back = trimesh.load_mesh(tmp_path / "mesh.obj", process=False)
    np.testing.assert_array_equal(back.visual.material.main_color, [255, 51, 0, 255])


def test_face_colours_become_materials(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    box.visual.face_colors = np.where(
        box.face_normals[:, 2:] > 0.5, [[255, 0, 0, 255]], [[0, 0, 255, 255]]
    )
    write_visual(box, tmp_path / "mesh.obj")
    parts = trimesh.load_scene(tmp_path / "mesh.obj", process=False).geometry.values()
    found = {tuple(p.visual.material.main_color.tolist()): len(p.faces) for p in parts}
    assert found == {(255, 0, 0, 255): 2, (0, 0, 255, 255): 10}


def test_texture(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    uv = np.random.default_rng(0).random((8, 2))
    box = trimesh.Trimesh(
        box.vertices, box.faces, visual=trimesh.visual.TextureVisuals(uv=uv), process=False
    )
    write_visual(box, tmp_path / "mesh.obj", image=Image.new("RGBA", (4, 4), (9, 8, 7, 255)))
    assert Image.open(tmp_path / "mesh.png").getpixel((0, 0)) == (9, 8, 7)
    back = trimesh.load_mesh(tmp_path / "mesh.obj", process=False)
    corners = back.visual.uv[back.faces]
    np.testing.assert_allclose(corners, uv[box.faces], atol=1e-6)


@pytest.mark.parametrize("subdivisions", [1, 3])
def test_the_same_mesh_gives_the_same_bytes(tmp_path: Path, subdivisions: int) -> None:
    ball = trimesh.creation.icosphere(subdivisions, 0.05)
    write_visual(ball, tmp_path / "a" / "mesh.obj")
    write_visual(ball.copy(), tmp_path / "b" / "mesh.obj")
    assert (tmp_path / "a/mesh.obj").read_bytes() == (tmp_path / "b/mesh.obj").read_bytes()
