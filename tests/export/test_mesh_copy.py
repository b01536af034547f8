"""Copies of meshes with what they name."""

from __future__ import annotations

from pathlib import Path

import pytest

from burg_drake.core import InvalidInputError
from burg_drake.export import MeshCopies

TEXTURED = {
    "mesh.obj": "mtllib mesh.mtl\nv 0 0 0\n",
    "mesh.mtl": "newmtl a\nKd 1 1 1\nmap_Kd -s 1 1 1 pictures/wood.png\n",
    "pictures/wood.png": "png",
}


def write(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return folder


def present(folder: Path) -> dict[str, str]:
    files = (p for p in folder.rglob("*") if p.is_file())
    return {p.relative_to(folder).as_posix(): p.read_text() for p in files}


def test_materials_and_textures_come_along(tmp_path: Path) -> None:
    source = write(tmp_path / "source", TEXTURED)
    assert MeshCopies(tmp_path / "copy").add(source / "mesh.obj") == "mesh.obj"
    assert present(tmp_path / "copy") == TEXTURED


def test_buffers_and_images_of_gltf_come_along(tmp_path: Path) -> None:
    buffers = '[{"uri": "a%20b.bin"}, {"uri": "data:x;base64,AA"}]'
    gltf = f'{{"buffers": {buffers}, "images": [{{"uri":"c.png"}}]}}'
    files = {"mesh.gltf": gltf, "a b.bin": "1", "c.png": "2"}
    MeshCopies(tmp_path / "copy").add(write(tmp_path / "source", files) / "mesh.gltf")
    assert present(tmp_path / "copy") == files


def test_meshes_of_one_name_do_not_meet(tmp_path: Path) -> None:
    copies = MeshCopies(tmp_path / "copy")
    first = write(tmp_path / "a", {"mesh.obj": "v 0 0 0\n"}) / "mesh.obj"
    second = write(tmp_path / "b", {"mesh.obj": "v 1 0 0\n"}) / "mesh.obj"
    assert [copies.add(p) for p in (first, second, first)] == [
        *("mesh.obj", "mesh_2/mesh.obj", "mesh.obj")
    ]
    assert present(tmp_path / "copy") == {
        "mesh.obj": "v 0 0 0\n",
        "mesh_2/mesh.obj": "v 1 0 0\n",
    }


@pytest.mark.parametrize(
    ("library", "expected"),
    [
        ("gone.mtl", "mesh.obj names gone.mtl, which is missing"),
        ("../other.mtl", "names ../other.mtl, which is not in its folder"),
        ("/etc/passwd", "names /etc/passwd, which is not in its folder"),
    ],
)
def test_what_cannot_come_along_is_told(tmp_path: Path, library: str, expected: str) -> None:
    write(tmp_path, {"other.mtl": ""})
    source = write(tmp_path / "source", {"mesh.obj": f"mtllib {library}\n"})
    with pytest.raises(InvalidInputError, match=expected):
        MeshCopies(tmp_path / "copy").add(source / "mesh.obj")
    assert not (tmp_path / "copy").exists()
