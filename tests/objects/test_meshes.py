"""Meshes as they come: formats, units, and one clear line for what cannot be used."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from burg_drake.core import MeshError, UnknownNameError
from burg_drake.objects import (
    Preparation,
    load_mesh,
    mesh_hash,
    texture_image,
    unit_scale,
    write_visual,
)

SIZE = (0.10, 0.06, 0.03)


@pytest.fixture
def box() -> trimesh.Trimesh:
    return trimesh.creation.box(SIZE).apply_translation([0.01, 0.02, 0.03])


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "off"])
def test_formats_keep_the_frame(tmp_path: Path, box: trimesh.Trimesh, suffix: str) -> None:
    box.export(tmp_path / f"box.{suffix}")
    mesh = load_mesh(tmp_path / f"box.{suffix}")
    assert mesh.closed
    assert len(mesh.surface.vertices) == 8
    np.testing.assert_allclose(mesh.surface.bounds, box.bounds, atol=1e-7)


def test_gltf_is_turned_from_y_up_to_z_up(tmp_path: Path) -> None:
    # A thing 0.3 m tall, upright in glTF's convention, stands upright in O.
    tall = trimesh.creation.box((0.1, 0.3, 0.05)).apply_translation([0.0, 0.15, 0.2])
    tall.export(tmp_path / "tall.glb")
    mesh = load_mesh(tmp_path / "tall.glb")
    np.testing.assert_allclose(
        mesh.surface.bounds, [[-0.05, -0.225, 0.0], [0.05, -0.175, 0.3]], atol=1e-7
    )
    assert mesh.surface.volume == pytest.approx(0.1 * 0.3 * 0.05)
    assert "turned from glTF's y-up to z-up" in mesh.repairs


def test_scene_graphs_are_joined_with_their_transforms(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    part = trimesh.creation.box((0.02, 0.02, 0.02))
    scene.add_geometry(part, transform=trimesh.transformations.translation_matrix([0.1, 0, 0]))
    scene.add_geometry(part, transform=trimesh.transformations.translation_matrix([-0.1, 0, 0]))
    scene.export(tmp_path / "two.glb")
    surface = load_mesh(tmp_path / "two.glb").surface
    np.testing.assert_allclose(surface.extents, [0.22, 0.02, 0.02], atol=1e-7)
    assert surface.volume == pytest.approx(2 * 0.02**3)


def test_scale_is_to_metres(tmp_path: Path, box: trimesh.Trimesh) -> None:
    box.copy().apply_scale(1000.0).export(tmp_path / "mm.stl")
    mesh = load_mesh(tmp_path / "mm.stl", scale=0.001)
    np.testing.assert_allclose(mesh.surface.extents, SIZE, atol=1e-7)
    assert "scaled by 0.001" in mesh.repairs


def test_texture_survives_with_its_coordinates(tmp_path: Path, box: trimesh.Trimesh) -> None:
    uv = np.random.default_rng(0).random((8, 2))
    image = Image.new("RGB", (8, 8), (10, 200, 30))
    visual = trimesh.visual.TextureVisuals(uv=uv, image=image)
    trimesh.Trimesh(box.vertices, box.faces, visual=visual, process=False).export(
        tmp_path / "textured.glb"
    )
    mesh = load_mesh(tmp_path / "textured.glb")
    assert texture_image(mesh.visual).getpixel((3, 3))[:3] == (10, 200, 30)
    assert mesh.visual.visual.uv.shape == (len(mesh.visual.vertices), 2)
    assert mesh.rgba is None


def test_vertex_colours_become_the_main_colour(tmp_path: Path, box: trimesh.Trimesh) -> None:
    box.visual.vertex_colors = [255, 51, 0, 255]
    box.export(tmp_path / "red.ply")
    assert load_mesh(tmp_path / "red.ply").rgba == (1.0, 0.2, 0.0, 1.0)


def test_parts_keep_their_colours(tmp_path: Path) -> None:
    red, blue = trimesh.creation.box((0.02,) * 3), trimesh.creation.box((0.02,) * 3)
    for part, colour in ((red, [255, 0, 0, 255]), (blue, [0, 0, 255, 255])):
        part.visual = trimesh.visual.TextureVisuals(
            material=trimesh.visual.material.PBRMaterial(baseColorFactor=colour)
        )
    scene = trimesh.Scene([red, blue.apply_translation([0.1, 0, 0])])
    scene.export(tmp_path / "parts.glb")
    visual = load_mesh(tmp_path / "parts.glb").visual
    left = visual.triangles_center[:, 0] < 0.05
    assert {tuple(c) for c in visual.visual.face_colors[left].tolist()} == {(255, 0, 0, 255)}
    assert {tuple(c) for c in visual.visual.face_colors[~left].tolist()} == {(0, 0, 255, 255)}


def _message(source: Path | trimesh.Trimesh, scale: float = 1.0) -> str:
    with pytest.raises(MeshError) as caught:
        load_mesh(source, scale)
    text = str(caught.value)
    assert "\n" not in text
    return text


MM, CM, M, INCH = (
    f"unit {unit} (scale={scale} makes it"
    for unit, scale in (("mm", "0.001"), ("cm", "0.01"), ("m", "1"), ("in", "0.0254"))
)


@pytest.mark.parametrize(
    ("extent", "scale", "expected"),
    [
        (200.0, 1.0, f"is 200 m long; try {MM} 200 mm)"),
        (2000.0, 1.0, f"is 2000 m long; try {MM} 2 m)"),
        (20.0, 1.0, f"try {MM} 20 mm) or {CM} 200 mm) or {INCH} 508 mm)"),
        (5.0, 1.0, f"is 5 m long; try {CM} 50 mm) or {INCH} 127 mm)"),
        (0.1, 1000.0, f"is 100 m long; try {M} 100 mm)"),
        (0.1, 0.001, f"is 0.1 mm long; try {M} 100 mm)"),
        (1e-4, 1.0, "is 0.1 mm long; try scale=1000"),
    ],
)
def test_a_wrong_unit_is_recognised(extent: float, scale: float, expected: str) -> None:
    message = _message(trimesh.creation.box((0.6 * extent, extent, 0.5 * extent)), scale)
    assert message.startswith("mesh in memory: taken as metres, the mesh is ") and message.endswith(
        expected
    )


@pytest.mark.parametrize("extent", [7e6, 3e-7])
def test_extents_far_from_any_unit_get_a_scale_that_fits(extent: float) -> None:
    box = trimesh.creation.box((extent, extent, extent))
    scale = float(_message(box).rpartition("=")[2])
    np.testing.assert_allclose(load_mesh(box, scale).surface.extents, scale * extent, rtol=1e-5)
    assert 0.01 <= scale * extent <= 0.1


def test_missing_file(tmp_path: Path) -> None:
    assert _message(tmp_path / "no.obj") == f"{tmp_path / 'no.obj'}: the mesh file does not exist"


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.obj", b"", "the mesh file is empty"),
        ("a.obj", b"# nothing here\n", "the mesh file has no triangles"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "the mesh file has no triangles"),
        ("a.obj", b"v 0 0 0\nf 1 2 3\n", "not a readable .obj mesh"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 3\n", "not a readable .ply mesh"),
        ("a.stl", b"\x00\x01\x02 this is no mesh", "the mesh file has no triangles"),
        ("a.glb", b"glTF but not really", "not a readable .glb mesh"),
        ("a.gltf", b"{]", "not a readable .gltf mesh"),
        ("a", b"v", "the file name has no suffix; give one of .obj, .ply,"),
        (
            "a.dae",
            b"<x/>",
            (
                ".dae is not a mesh format that can be read; those are .obj, .ply, .stl, .off,"
                " .glb, .gltf"
            ),
        ),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 0), "the mesh"),
    ],
)
def test_files_that_are_no_meshes(tmp_path: Path, name: str, content: bytes, expected: str) -> None:
    (tmp_path / name).write_bytes(content)
    message = _message(tmp_path / name)
    assert message.startswith(f"{tmp_path / name}: ")
    assert expected in message


def test_nan_vertices(box: trimesh.Trimesh) -> None:
    vertices = np.array(box.vertices)
    vertices[3, 1] = np.nan
    broken = trimesh.Trimesh(vertices, box.faces, process=False, validate=False)
    assert _message(broken) == "mesh in memory: 1 of 8 vertices are NaN or infinite"


def test_unit_names() -> None:
    assert [unit_scale(u) for u in ("mm", "cm", "m", "in")] == [0.001, 0.01, 1.0, 0.0254]
    with pytest.raises(UnknownNameError) as caught:
        unit_scale("inch")
    assert str(caught.value) == "unit 'inch' is not known; did you mean 'in'? Known: cm, in, m, mm"


def test_a_texture_stays_on_the_given_sheet() -> None:
    """A textured towel: the wall is for physics, the sheet with its picture for display."""
    dome = trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    dome.update_faces(dome.triangles_center[:, 2] > 0.03)
    dome.remove_unreferenced_vertices()
    uv = np.random.default_rng(0).random((len(dome.vertices), 2))
    image = Image.new("RGB", (8, 8), (10, 200, 30))
    dome.visual = trimesh.visual.TextureVisuals(uv=uv, image=image)
    mesh = load_mesh(dome)
    assert mesh.closed and mesh.surface.volume > 0.0
    np.testing.assert_array_equal(mesh.visual.faces, dome.faces)
    assert texture_image(mesh.visual) is not None


@pytest.mark.parametrize("thickness", [0.0, -1.0, float("nan"), float("inf")])
def test_walls_that_are_none(thickness: float) -> None:
    with pytest.raises(MeshError, match=r"wall_thickness is .* m; it must be above 0"):
        Preparation(wall_thickness=thickness)


def test_ways_to_close_that_are_none() -> None:
    with pytest.raises(MeshError, match=r"'cap'; .* 'wall' or 'close'"):
        Preparation(openings="cap")  # type: ignore[arg-type]


def test_flat_meshes(box: trimesh.Trimesh) -> None:
    assert "is flat (100 x 60 x 0 mm)" in _message(box.apply_transform(np.diag([1, 1, 0, 1.0])))


def test_single_triangles_are_flat() -> None:
    triangle = trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]], process=False)
    assert "is flat" in _message(triangle)


def test_sheets_with_a_face_on_both_sides_become_a_wall() -> None:
    bent = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    half = bent.faces[bent.triangles_center[:, 2] > 0]
    mesh = load_mesh(
        trimesh.Trimesh(bent.vertices, np.vstack([half, half[:, ::-1]]), process=False)
    )
    assert mesh.closed
    assert mesh.wall == 0.002
    assert mesh.repairs[1] == f"dropped {len(half)} duplicate faces"
    assert mesh.repairs[2].startswith("made the open surface (largest opening 100 mm wide) a wall")


def test_closed_sheets_without_thickness() -> None:
    bent = trimesh.creation.icosphere(subdivisions=2, radius=0.05)
    below = bent.vertices[:, 2] < 0
    bent.vertices[below, 2] = -bent.vertices[below, 2] - 2e-8
    assert "encloses no volume (is it a sheet without thickness?)" in _message(bent)


def test_all_vertices_at_one_point() -> None:
    point = trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False)
    assert _message(point) == "mesh in memory: all vertices are at one point"


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan")])
def test_scales_that_are_none(box: trimesh.Trimesh, scale: float) -> None:
    assert "scale is" in _message(box, scale)


def test_hash_follows_the_files_that_a_mesh_refers_to(tmp_path: Path, box: trimesh.Trimesh) -> None:
    visual = trimesh.visual.TextureVisuals(
        uv=np.zeros((8, 2)), image=Image.new("RGB", (4, 4), (1, 2, 3))
    )
    trimesh.Trimesh(box.vertices, box.faces, visual=visual, process=False).export(
        tmp_path / "box.obj"
    )
    (picture,) = tmp_path.glob("*.png")
    first = mesh_hash(tmp_path / "box.obj")
    (tmp_path / "unrelated.png").write_bytes(b"other")
    assert mesh_hash(tmp_path / "box.obj") == first
    Image.new("RGB", (4, 4), (9, 9, 9)).save(picture)
    assert mesh_hash(tmp_path / "box.obj") != first


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".ply", ".glb"])
def test_random_bytes_are_no_mesh(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"noise{suffix}"
    path.write_bytes(np.random.default_rng(1).bytes(3000))
    with pytest.raises(MeshError, match=f"not a readable {suffix} mesh") as caught:
        load_mesh(path)
    assert "No module" not in str(caught.value)


def coloured(kind: str, alpha: int) -> trimesh.Trimesh:
    """A ball whose red has an alpha, in one of the ways in which meshes have colours."""
    ball = trimesh.creation.icosphere(1, 0.05)
    if kind in ("OPAQUE", "MASK", "BLEND"):
        material = trimesh.visual.material.PBRMaterial(
            baseColorFactor=[200, 0, 0, alpha], alphaMode=kind
        )
        uv = np.zeros((len(ball.vertices), 2))
        ball.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    elif kind == "vertex":
        ball.visual.vertex_colors = np.tile([200, 0, 0, alpha], (len(ball.vertices), 1))
    else:
        ball.visual.face_colors = np.tile([200, 0, 0, alpha], (len(ball.faces), 1))
        ball.visual.face_colors[:3, 1] = 90
    return ball


@pytest.mark.parametrize("kind", ["OPAQUE", "MASK", "BLEND", "vertex", "face"])
def test_an_alpha_in_the_colours_does_not_make_a_mesh_translucent(
    tmp_path: Path, kind: str
) -> None:
    for alpha, told in ((90, True), (255, False)):
        mesh: str | Path | trimesh.Trimesh = coloured(kind, alpha)
        if kind != "face":  # which glTF does not have
            mesh = tmp_path / f"{alpha}.glb"
            coloured(kind, alpha).export(mesh)
        loaded = load_mesh(mesh)
        assert any("colours opaque" in line for line in loaded.repairs) is told
        write_visual(loaded.visual, tmp_path / "mesh.obj", rgba=loaded.rgba)
        material = (tmp_path / "mesh.mtl").read_text()
        assert set(re.findall(r"^d (.*)$", material, flags=re.MULTILINE)) == {"1"}
        assert "Kd 0.7843 0" in material
