"""glTF in memory: the same points as the file, z up again after Drake's turn; and labels."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from pydrake.geometry import Mesh

from burg_drake.objects import load_library
from burg_drake.visualization import gltf_mesh, label_mesh


def document(mesh: Mesh) -> dict:
    return json.loads(mesh.source().in_memory().mesh_file.contents())


def data_of(uri: str) -> bytes:
    return base64.b64decode(uri.split(",", 1)[1])


def positions(mesh: Mesh) -> np.ndarray:
    """All corners (N, 3) as Drake has them: the root's matrix, then its turn from y up to z up."""
    gltf = document(mesh)
    (root,) = (gltf["nodes"][k] for k in gltf["scenes"][0]["nodes"])
    matrix = np.reshape(root["matrix"], (4, 4)).T
    found = []
    for primitive in (p for part in gltf["meshes"] for p in part["primitives"]):
        accessor = gltf["accessors"][primitive["attributes"]["POSITION"]]
        buffer = gltf["buffers"][gltf["bufferViews"][accessor["bufferView"]]["buffer"]]
        found.append(np.frombuffer(data_of(buffer["uri"]), "<f4").reshape(-1, 3))
    x, y, z = (np.vstack(found) @ matrix[:3, :3].T).T
    return np.stack([x, -z, y], axis=1)


@pytest.mark.parametrize("name", ["mug", "box"])
def test_the_mesh_is_where_it_was(name: str) -> None:
    library = load_library("household")
    found = positions(gltf_mesh(library.path(library.entry(name).mesh)))
    known = trimesh.load(library.root / name / "mesh.obj", force="mesh").vertices
    assert found.min(axis=0) == pytest.approx(known.min(axis=0), abs=1e-6)
    assert found.max(axis=0) == pytest.approx(known.max(axis=0), abs=1e-6)


def test_materials_are_kept_apart() -> None:
    library = load_library("household")
    gltf = document(gltf_mesh(library.path("mug/mesh.obj")))
    colors = [m["pbrMetallicRoughness"]["baseColorFactor"] for m in gltf["materials"]]
    assert len(colors) == 2 and colors[0] != colors[1]
    assert all(m["pbrMetallicRoughness"]["metallicFactor"] == 0.0 for m in gltf["materials"])


def test_a_texture_travels_inside(tmp_path: Path) -> None:
    Image.new("RGB", (4, 4), (200, 30, 30)).save(tmp_path / "t.png")
    (tmp_path / "m.mtl").write_text("newmtl s\nKd 1 1 1\nmap_Kd t.png\n")
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n"
        "usemtl s\nf 1/1/1 2/2/1 3/3/1\n"
    )
    gltf = document(gltf_mesh(tmp_path / "m.obj"))
    assert len(gltf["images"]) == len(gltf["textures"]) == 1
    uris = [b["uri"] for b in gltf["buffers"]] + [i.get("uri", "data:") for i in gltf["images"]]
    assert all(uri.startswith("data:") for uri in uris)


def test_large_textures_are_reduced(tmp_path: Path) -> None:
    shade = np.linspace(0, 255, 3000).astype(np.uint8)
    texture = np.stack([np.tile(shade, (1500, 1))] * 3, axis=-1)
    Image.fromarray(texture).save(tmp_path / "t.png")
    (tmp_path / "m.mtl").write_text("newmtl s\nKd 1 1 1\nmap_Kd t.png\n")
    (tmp_path / "m.obj").write_text(
        "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvn 0 0 1\n"
        "usemtl s\nf 1/1/1 2/2/1 3/3/1\n"
    )
    gltf = document(gltf_mesh(tmp_path / "m.obj"))
    view = gltf["bufferViews"][gltf["images"][0]["bufferView"]]
    data = data_of(gltf["buffers"][view["buffer"]]["uri"])
    image = Image.open(io.BytesIO(data[view.get("byteOffset", 0) :]))
    assert image.size == (1024, 512) and image.format == "JPEG"
    assert np.asarray(image)[:, [0, -1], 0].mean(axis=0) == pytest.approx([0, 255], abs=4)


def test_a_label_is_as_wide_as_its_text() -> None:
    one, width = label_mesh(("HHHH",), 0.02)
    _, twice = label_mesh(("HHHHHHHH",), 0.02)
    assert twice == pytest.approx(2 * width, rel=0.06)
    points = positions(one)
    assert points.min(axis=0) == pytest.approx([0, 0, 0], abs=1e-7)
    assert points.max(axis=0) == pytest.approx([width, 0.02, 0], abs=1e-7)
    assert positions(label_mesh(("a", "b"), 0.02, 1.5)[0])[:, 1].max() == pytest.approx(0.06)


def test_a_label_reads_upright() -> None:
    gltf = document(label_mesh(("L",), 0.02)[0])
    view = gltf["bufferViews"][gltf["images"][0]["bufferView"]]
    data = data_of(gltf["buffers"][view["buffer"]]["uri"])
    image = Image.open(io.BytesIO(data)).convert("LA")
    ink = np.asarray(image)[..., 1].astype(float)
    rows, columns = np.nonzero(ink > 100)
    assert ink[rows.max()].sum() > 2 * ink[rows.min()].sum()  # the foot of the L is below
    assert ink[:, columns.min()].sum() > 2 * ink[:, columns.max()].sum()
