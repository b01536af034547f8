"""Meshes, labels and pictures as glTF in memory. Meshcat stores each of them once."""

from __future__ import annotations

import base64
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont
from pydrake.common import MemoryFile
from pydrake.geometry import InMemoryMesh, Mesh, Meshcat
from pydrake.math import RigidTransform
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from burg_drake.core import Array, Bytes, MeshError, Rgb, make_pose
from burg_drake.visualization.colors import linear_light

LABEL_LINE_PIXELS = 32
"""Height of a line of a label in its texture, in pixels."""


def gltf_mesh(path: Path, *, opacity: float = 1.0) -> Mesh:
    """A visual mesh file (.obj, with its materials and textures) as a glTF in memory.

    Args:
        path: the mesh [m].
        opacity: 0 to 1, on top of the materials'.

    Returns:
        Drake's shape, with the look and the pose of the file's mesh.

    Raises:
        MeshError: the file is damaged.
    """
    roughness = 0.65  # The gloss of paint and plastic.
    albedo = 0.44  # Meshcat also lights glTF by the bright background.
    try:
        scene = trimesh.load(path, force="scene", process=False)
    except Exception as error:  # the reader raises whatever it stumbles over
        raise MeshError(f"{path} is damaged or no mesh") from error
    if scene.is_empty:
        raise MeshError(f"{path} is damaged or no mesh")
    for part in scene.geometry.values():
        material = getattr(part.visual, "material", None)
        if material is not None and getattr(material, "image", None) is not None:
            material.image = _reduce_texture(material.image)
    files = scene.export(file_type="gltf", include_normals=True)
    document = json.loads(files["model.gltf"])
    for material in document.get("materials", ()):
        surface = material.setdefault("pbrMetallicRoughness", {})
        surface |= {"metallicFactor": 0.0, "roughnessFactor": roughness}
        *rgb, a = surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        surface["baseColorFactor"] = [*(albedo * linear_light(rgb)).tolist(), opacity * a]
        material["doubleSided"] = opacity == 1.0  # else backs would shine through
        if opacity < 1.0:
            material["alphaMode"] = "BLEND"
    return _in_memory_shape(document, files, path.name)


def label_mesh(
    lines: tuple[str, ...],
    height: float,
    stretch: float = 1.0,
    color: Rgb = (0.227, 0.227, 0.227),
) -> tuple[Mesh, float]:
    """Text as a textured quadrangle in the plane z = 0, along +x from the origin, top line first.

    Args:
        lines: lines of text; the first is bold.
        height: line spacing before stretching [m]; the last line's foot is at y = 0.
        stretch: factor for the letters along y.
        color: red, green, blue in [0, 1] (sRGB).

    Returns:
        Drake's shape, seen from +z, and its width [m].
    """
    image = _text_image(lines, color)
    width = height * image.width / LABEL_LINE_PIXELS
    top = stretch * height * len(lines)
    corners = np.array([[0, top, 0], [width, top, 0], [width, 0, 0], [0, 0, 0]], dtype=float)
    return _textured_quadrangle(image, corners, "label"), width


def draw_label(meshcat: Meshcat, path: str, label: tuple[Mesh, float], X_WT: Array) -> None:
    """Draws a text of `label_mesh` with the middle of its foot at the origin of T (4, 4)."""
    text, width = label
    meshcat.SetObject(path, text)
    meshcat.SetTransform(path, RigidTransform(X_WT @ make_pose(p_AB=(-0.5 * width, 0.0, 0.0))))


def picture_mesh(image: Bytes, corners: ArrayLike) -> Mesh:
    """A picture without shading, visible from both sides.

    Args:
        image: (H, W, 3) of sRGB bytes.
        corners: (4, 3) corners of a flat quadrangle [m], clockwise from the upper left of the
            upright picture.

    Returns:
        Drake's shape.
    """
    return _textured_quadrangle(Image.fromarray(image), np.asarray(corners, dtype=float), "picture")


def _textured_quadrangle(image: Image.Image, corners: Array, name: str) -> Mesh:
    """A picture on a quadrangle (4, 3) without shading; if transparent, visible from the front."""
    transparent = "A" in image.mode
    material = PBRMaterial(
        baseColorTexture=image,
        alphaMode="BLEND" if transparent else "OPAQUE",
        doubleSided=not transparent,
    )
    visual = TextureVisuals(uv=np.array([[0, 1], [1, 1], [1, 0], [0, 0]]), material=material)
    faces = [[3, 2, 1], [3, 1, 0]]
    mesh = trimesh.Trimesh(corners, faces, visual=visual, process=False)
    files = mesh.scene().export(file_type="gltf", include_normals=False)
    document = json.loads(files["model.gltf"])
    document["samplers"] = [{"minFilter": 9729}]  # linear: sharp where seen at a slant
    document["textures"][0]["sampler"] = 0
    document["extensionsUsed"] = ["KHR_materials_unlit"]
    document["materials"][0]["extensions"] = {"KHR_materials_unlit": {}}
    return _in_memory_shape(document, files, name)


def _in_memory_shape(document: dict[str, Any], files: dict[str, bytes], name: str) -> Mesh:
    """Drake's shape of a glTF document of trimesh and its buffers, which become part of it."""
    for buffer in document["buffers"]:
        data = base64.b64encode(files[buffer["uri"]]).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{data}"
    # From y up to z up, to undo Drake's turn of glTF.
    turn = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=float)
    root = {"matrix": turn.T.reshape(-1).tolist(), "children": document["scenes"][0]["nodes"]}
    document["scenes"][0]["nodes"] = [len(document["nodes"])]
    document["nodes"].append(root)
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(json.dumps(document), ".gltf", name)))


def _reduce_texture(image: Image.Image) -> Image.Image:
    """Reduces a texture for the gallery, and makes it a JPEG unless it is transparent."""
    max_size = 1024  # Pixels.
    small = image.copy()
    small.thumbnail((max_size, max_size), reducing_gap=2.0)
    if small.mode in ("RGBA", "LA", "PA") or "transparency" in small.info:
        return small
    data = io.BytesIO()
    small.convert("RGB").save(data, format="JPEG", quality=85)
    return Image.open(data)


def _text_image(lines: tuple[str, ...], color: Rgb) -> Image.Image:
    """Image of lines of text in a colour on a transparent background."""
    font = ImageFont.load_default(0.76 * LABEL_LINE_PIXELS)
    width = max(2, *(int(np.ceil(font.getlength(line))) + 4 for line in lines))
    ink = Image.new("L", (width, LABEL_LINE_PIXELS * len(lines)))
    draw = ImageDraw.Draw(ink)
    for row, line in enumerate(lines):
        foot = (2, LABEL_LINE_PIXELS * (row + 0.8))
        draw.text(foot, line, 255, font, anchor="ls", stroke_width=int(row == 0))
    image = Image.new("RGB", ink.size, tuple(round(255 * c) for c in color))
    image.putalpha(ink.point(lambda opacity: opacity // 51 * 51))  # for a small file
    return image
