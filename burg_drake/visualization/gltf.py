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
from pydrake.geometry import InMemoryMesh, Mesh

from burg_drake.core import Array, Bytes, MeshError
from burg_drake.visualization.colors import linear_light

LABEL_LINE_PIXELS = 44
"""Height of a line of a label in its texture, in pixels."""


def gltf_mesh(path: Path, *, opacity: float = 1.0) -> Mesh:
    """A visual mesh file (.obj, with its materials and textures) as a glTF in memory.

    Args:
        path: the mesh [m].
        opacity: 0 to 1, on top of the materials'.

    Returns:
        Drake's shape; the same look at the same place as the file's.

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
        r, g, b, a = surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        linear = (float(linear_light(c)) for c in (r, g, b))
        surface["baseColorFactor"] = [*(albedo * c for c in linear), opacity * a]
        material["doubleSided"] = opacity == 1.0  # else backs would shine through
        if opacity < 1.0:
            material["alphaMode"] = "BLEND"
    buffers = [files[buffer["uri"]] for buffer in document["buffers"]]
    return _in_memory_shape(document, buffers, path.name)


def label_mesh(lines: tuple[str, ...], height: float, stretch: float = 1.0) -> tuple[Mesh, float]:
    """Text as a picture in the plane z = 0 that reads along +x from the origin, top line first.

    Args:
        lines: of text; the first is bold.
        height: from line to line, before stretching [m]; the last line's foot is at y = 0.
        stretch: of the letters along y.

    Returns:
        Drake's shape, seen from +z, and its width [m].
    """
    image = _text_image(lines)
    width = height * image.width / LABEL_LINE_PIXELS
    top = stretch * height * len(lines)
    corners = np.array([[0, top, 0], [width, top, 0], [width, 0, 0], [0, 0, 0]], dtype=float)
    return _textured_quadrangle(image, corners, "label"), width


def picture_mesh(image: Bytes, corners: ArrayLike) -> Mesh:
    """A picture in its own colours, whatever light falls on it; seen from both sides.

    Args:
        image: (H, W, 3) of sRGB bytes.
        corners: (4, 3) of a flat quadrangle [m]: where the picture's upper left corner is, then
            around it, clockwise as one sees the picture upright.

    Returns:
        Drake's shape.
    """
    return _textured_quadrangle(Image.fromarray(image), np.asarray(corners, dtype=float), "picture")


def _textured_quadrangle(image: Image.Image, corners: Array, name: str) -> Mesh:
    """A picture on a quadrangle (4, 3), without shading."""
    data = io.BytesIO()
    image.save(data, format="PNG", optimize=True)
    vertices = corners[[3, 2, 1, 0]].astype("<f4")
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype="<f4")
    faces = np.array([0, 1, 2, 0, 2, 3], dtype="<u2")
    buffers = [a.tobytes() for a in (vertices, uv, faces)]
    transparent = image.mode == "LA"
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
                ]
            }
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 4,
                "type": "VEC3",
                "min": vertices.min(axis=0).tolist(),
                "max": vertices.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": i, "byteLength": len(b)} for i, b in enumerate(buffers)],
        "buffers": [{"byteLength": len(b)} for b in buffers],
        "extensionsUsed": ["KHR_materials_unlit"],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                "alphaMode": "BLEND" if transparent else "OPAQUE",
                "doubleSided": not transparent,
                "extensions": {"KHR_materials_unlit": {}},
            }
        ],
        "textures": [{"source": 0}],
        "images": [{"uri": _data_uri("image/png", data.getvalue())}],
    }
    return _in_memory_shape(document, buffers, name)


def _in_memory_shape(document: dict[str, Any], buffers: list[bytes], name: str) -> Mesh:
    # From y up to z up, to undo Drake's turn of glTF.
    turn = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]], dtype=float)
    for buffer, data in zip(document["buffers"], buffers, strict=True):
        buffer["uri"] = _data_uri("application/octet-stream", data)
    root = {"matrix": turn.T.reshape(-1).tolist(), "children": document["scenes"][0]["nodes"]}
    document["scenes"][0]["nodes"] = [len(document["nodes"])]
    document["nodes"].append(root)
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(json.dumps(document), ".gltf", name)))


def _reduce_texture(image: Image.Image) -> Image.Image:
    """A texture for the gallery: reduced, and as a JPEG unless it is transparent."""
    max_size = 1024  # Pixels. Enough for a gallery.
    small = image.copy()
    small.thumbnail((max_size, max_size), reducing_gap=2.0)
    if small.mode in ("RGBA", "LA", "PA") or "transparency" in small.info:
        return small
    data = io.BytesIO()
    small.convert("RGB").save(data, format="JPEG", quality=85)
    return Image.open(data)


def _data_uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _text_image(lines: tuple[str, ...]) -> Image.Image:
    grey = 58  # Of labels, as an sRGB byte.
    font = ImageFont.load_default(0.76 * LABEL_LINE_PIXELS)
    width = max(2, *(int(np.ceil(font.getlength(line))) + 4 for line in lines))
    ink = Image.new("L", (width, LABEL_LINE_PIXELS * len(lines)))
    draw = ImageDraw.Draw(ink)
    for row, line in enumerate(lines):
        bold = int(row == 0)
        draw.text(
            (2, LABEL_LINE_PIXELS * (row + 0.8)), line, 255, font, anchor="ls", stroke_width=bold
        )
    image = Image.new("LA", ink.size, grey)
    image.putalpha(ink)
    return image
