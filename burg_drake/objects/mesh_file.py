"""Mesh files: size limits, reading as one mesh in the file's unit, content hash and textures."""

from __future__ import annotations

import base64
import io
import json
import logging
import os
import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
import trimesh
from PIL import Image

from burg_drake.core import MeshError, content_hash, one_line, suppress_numpy_warnings
from burg_drake.objects.model_files import face_palette

MAX_MESH_TRIANGLES = 2_000_000
"""Triangles per mesh; half as many for an open mesh that becomes a wall."""

MAX_TEXTURE_PIXELS = 2**26
"""Pixels of a texture, 8192 x 8192; readers ignore larger ones silently."""


TRIANGLE_MARKERS = {".obj": b"\nf ", ".stl": b"endfacet"}
"""Bytes that occur once per triangle in a text file."""

FACE_COUNT_PATTERNS = {
    ".ply": re.compile(rb"^element +face +(\d{1,15})", re.MULTILINE),
    ".off": re.compile(rb"^\S*OFF\s+\d+\s+(\d{1,15})"),
}
"""Patterns of the number of faces in a header."""

STL_HEADER_BYTES = 84  # Bytes of a binary STL header with the number of triangles.
STL_TRIANGLE_BYTES = 50  # Bytes of a triangle in a binary STL file.

IMAGE_FORMATS = (".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp")
"""Suffixes of textures."""


def check_bytes(path: Path) -> None:
    """Refuses a file that is too large to be read.

    Raises:
        MeshError: the file has more than 512 MB.
    """
    max_bytes = 2**29  # 512 MB.
    size = path.stat().st_size
    if size > max_bytes:
        raise MeshError(
            f"{path}: the file has {size / 2**20:.0f} MB; at most "
            f"{max_bytes / 2**20:.0f} MB are read: reduce the number of faces first"
        )


def check_triangles(count: int, name: str, *, wall: bool = False) -> None:
    """Refuses a mesh with too many triangles.

    Args:
        count: number of triangles or polygons.
        name: name of the mesh in messages.
        wall: the surface is open and becomes a wall.

    Raises:
        MeshError: there are more than `MAX_MESH_TRIANGLES`, or half as many for a wall.
    """
    max_count = MAX_MESH_TRIANGLES // 2 if wall else MAX_MESH_TRIANGLES
    if count > max_count:
        what = "an open surface that becomes a wall" if wall else "a mesh"
        raise MeshError(
            f"{name}: {count:,} triangles; {what} may have {max_count:,}: reduce the number of"
            " faces first (100,000 are enough for contact, mass and stable poses)"
        )


def announced_triangle_count(path: Path) -> int:
    """Number of triangles or polygons according to the file's header or lines; 0 if only reading
    the whole file would tell."""
    header_bytes = 65536  # Bytes of a PLY or OFF file that are searched for the count.
    suffix, size = path.suffix.lower(), path.stat().st_size
    with path.open("rb") as file:
        start = file.read(header_bytes)
    if suffix == ".stl" and size >= STL_HEADER_BYTES:
        count = int.from_bytes(start[STL_HEADER_BYTES - 4 : STL_HEADER_BYTES], "little")
        if STL_HEADER_BYTES + STL_TRIANGLE_BYTES * count <= size:
            return count
    if suffix in TRIANGLE_MARKERS:
        return path.read_bytes().count(TRIANGLE_MARKERS[suffix])
    found = FACE_COUNT_PATTERNS[suffix].search(start) if suffix in FACE_COUNT_PATTERNS else None
    return int(found[1]) if found else 0


def check_textures(path: Path, companions: Sequence[Path]) -> None:
    """Refuses textures that are too large.

    Args:
        path: the mesh file.
        companions: files that the mesh file refers to.

    Raises:
        MeshError: a texture has more than `MAX_TEXTURE_PIXELS`.
    """
    for file in companions:
        if file.suffix.lower() in IMAGE_FORMATS:
            _check_image_size(file, str(file))
    if path.suffix.lower() in (".glb", ".gltf"):
        for picture in _gltf_images(path):
            _check_image_size(io.BytesIO(picture), f"{path}: a texture in it")


def _check_image_size(picture: Any, name: str) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(picture) as image:  # reads only the header
                width, height = image.size
    except Image.DecompressionBombError as error:
        raise MeshError(
            f"{name}: the image is too large for a texture: at most {_max_texture_text()}"
        ) from error
    except (OSError, ValueError, SyntaxError):
        return  # not a readable image
    if width * height > MAX_TEXTURE_PIXELS:
        raise MeshError(
            f"{name}: {width} x {height} pixels; a texture may have {_max_texture_text()}"
        )


def _max_texture_text() -> str:
    side = int(MAX_TEXTURE_PIXELS**0.5)
    return f"{side} x {side}: scale it down first"


def _gltf_images(path: Path) -> Iterator[bytes]:
    """The images of a glTF file; empty for a damaged file."""
    data, binary = path.read_bytes(), b""
    if path.suffix.lower() == ".glb":
        length = int.from_bytes(data[12:16], "little")
        data, binary = data[20 : 20 + length], data[20 + length + 8 :]
    try:
        document = json.loads(data)
        for image in document.get("images", ()):
            if "bufferView" in image:
                view = document["bufferViews"][image["bufferView"]]
                begin = view.get("byteOffset", 0)
                buffer = document["buffers"][view["buffer"]]
                content = _gltf_content(path, buffer["uri"]) if "uri" in buffer else binary
                yield content[begin : begin + view["byteLength"]]
            elif "uri" in image:
                yield _gltf_content(path, image["uri"])
    except (AttributeError, LookupError, OSError, RecursionError, TypeError, ValueError) as error:
        if isinstance(error, MeshError):
            raise


def _gltf_content(path: Path, uri: str) -> bytes:
    """Content that a glTF URI refers to: embedded in the URI, or a file beside the glTF file."""
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    file = path.parent / unquote(uri)
    if not file.is_file():
        return b""
    check_bytes(file)
    return file.read_bytes()


MESH_FORMATS = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
"""Suffixes of mesh files that can be read."""


UNKNOWN_CONTENT_MESSAGE = "its contents are neither text nor a known binary format"
"""Reason why a file of unknown content cannot be read."""


def mesh_name(mesh: str | Path | trimesh.Trimesh) -> str:
    """Name of a mesh in messages."""
    return "mesh in memory" if isinstance(mesh, trimesh.Trimesh) else str(mesh)


def mesh_hash(mesh: str | Path | trimesh.Trimesh) -> str:
    """Content hash of a mesh in memory, or of a file and the textures beside it.

    Raises:
        MeshError: the file cannot be read.
    """
    if isinstance(mesh, trimesh.Trimesh):
        image = texture_image(mesh)
        appearance: list[Any] = [face_palette(mesh), source_rgba(mesh)]
        if image is not None:
            appearance += [np.asarray(mesh.visual.uv), np.asarray(image)]
        return content_hash(np.asarray(mesh.vertices), np.asarray(mesh.faces), appearance)
    path = Path(mesh)
    _check_file(path)
    try:
        return content_hash(path, *((p.name, p) for p in find_companion_files(path)))
    except OSError as error:
        raise MeshError(f"{path}: cannot read the mesh: {error.strerror or error}") from error


def texture_image(mesh: trimesh.Trimesh):  # type: ignore[no-untyped-def]
    """The colour image (PIL) of a textured mesh, or None."""
    visual = mesh.visual
    if visual.kind != "texture" or visual.uv is None or len(visual.uv) != len(mesh.vertices):
        return None
    material = visual.material
    return getattr(material, "image", None) or getattr(material, "baseColorTexture", None)


def source_rgba(mesh: trimesh.Trimesh) -> tuple[float, float, float, float] | None:
    """Main colour of a coloured mesh without a texture (mean over faces or vertices), or None."""
    visual = mesh.visual
    if visual is None or not visual.defined:
        return None
    if visual.kind == "texture":
        colour = getattr(visual.material, "main_color", None)
    else:
        colour = np.asarray(visual.face_colors, dtype=float).mean(axis=0)
    if colour is None:
        return None
    r, g, b, a = (np.round(np.asarray(colour, dtype=float) / 255.0, 4)).tolist()
    return r, g, b, a


def make_opaque(mesh: trimesh.Trimesh) -> float | None:
    """Makes the colours of a mesh opaque, in place; the alpha of images is ignored anyway.

    Exporters leave meaningless alpha values in colours: glTF ignores the alpha of materials that do
    not blend, and scanners write arbitrary values for vertices. Transparency comes from the
    source's `rgba`.

    Returns:
        The lowest alpha that was removed, 0 to 1; None if the mesh was opaque.
    """
    visual = mesh.visual
    if visual is None or not visual.defined or texture_image(mesh) is not None:
        return None
    if visual.kind == "texture":
        name = "baseColorFactor" if hasattr(visual.material, "baseColorFactor") else "diffuse"
        colours = getattr(visual.material, name, None)
        holder: Any = visual.material
    else:
        name, holder = f"{visual.kind}_colors", visual
        colours = getattr(visual, name)
    if colours is None or np.shape(colours)[-1] < 4:
        return None
    opaque = np.array(colours)
    lowest = float(opaque[..., 3].min()) / 255.0
    if lowest == 1.0:
        return None
    opaque[..., 3] = 255
    setattr(holder, name, opaque)
    return lowest


def find_companion_files(path: Path) -> list[Path]:
    """Material, texture and buffer files of a mesh, in its folder or a subfolder, that the mesh
    file or one of these files names.

    Args:
        path: path of the mesh.

    Raises:
        MeshError: a file is too large.
        OSError: a file cannot be read.
    """
    referring_formats = (".obj", ".gltf", ".ply")  # Formats that refer to materials and textures.
    # Suffixes of materials, buffers and images.
    referred_suffixes = (".mtl", ".bin", *IMAGE_FORMATS)
    if path.suffix.lower() not in referring_formats:
        return []
    folder = path.parent
    files = (*folder.glob("*"), *folder.glob("*/*"))
    beside = sorted(p for p in files if p.suffix.lower() in referred_suffixes and p.is_file())
    found: list[Path] = []
    queue = [path]
    while queue:
        text = queue.pop().read_bytes()
        named = [p for p in beside if p.name.encode() in text or quote(p.name).encode() in text]
        fresh = [p for p in named if p not in found]
        for file in fresh:
            check_bytes(file)
        found += fresh
        queue += [p for p in fresh if p.suffix.lower() == ".mtl"]
    return sorted(found)


def missing_textures(path: Path) -> list[str]:
    """A sentence for each missing image or material file of a mesh.

    Args:
        path: path of the mesh.
    """
    suffix = path.suffix.lower()
    found: list[tuple[Path, str]] = []
    if suffix == ".obj":
        for library in _material_files(path):
            file = path.parent / library
            found.append((path, library))
            if file.is_file():
                found += [
                    (file, _texture_name(file, text))
                    for text in _lines_with_keyword(file, "map_Kd")
                ]
    elif suffix == ".ply":
        found += [
            (path, name)
            for name in _lines_with_keyword(path, "comment TextureFile", until="end_header")
        ]
    elif suffix == ".gltf":
        found += [(path, uri) for uri in _image_uris(path)]
    return [
        f"{file.name} names {name}, which is missing, so the object is shown without its"
        f" texture; put the file beside {file.name} and build again"
        for file, name in dict.fromkeys(found)
        if not (file.parent / name.replace("\\", "/")).is_file()
    ]


def _material_files(path: Path) -> list[str]:
    """Material files of an OBJ file; a line may name several."""
    names: list[str] = []
    for text in _lines_with_keyword(path, "mtllib"):
        names += [text] if (path.parent / text).is_file() else text.split()
    return names


def _texture_name(materials: Path, text: str) -> str:
    """The file that `map_Kd` names; options such as `-s 1 1 1` may stand before it."""
    return text if (materials.parent / text).is_file() else text.split()[-1]


def _image_uris(path: Path) -> list[str]:
    """URIs of image files of a glTF file; empty for a damaged file."""
    try:
        images = json.loads(path.read_bytes()).get("images", ())
        uris = [str(image.get("uri", "data:")) for image in images]
    except (AttributeError, RecursionError, TypeError, ValueError):
        return []
    return [unquote(uri) for uri in uris if not uri.startswith("data:")]


def _lines_with_keyword(path: Path, keyword: str, until: str = "") -> list[str]:
    """Rest of each line of a text file that begins with a keyword."""
    max_bytes = 65536  # Bytes of a line that are searched for a file name.
    names = []
    words = keyword.lower().split()
    with path.open("rb") as file:
        while raw := file.readline(max_bytes):
            line = raw.decode("utf-8", errors="replace").partition(" #")[0].split(None, len(words))
            if until and line == [until]:
                break
            if len(line) > len(words) and [w.lower() for w in line[: len(words)]] == words:
                names.append(line[-1].strip())
    return names


def _check_file(path: Path) -> None:
    name = os.fsencode(path)
    if name.decode(errors="replace") != str(path):  # its readers could not open a file of this name
        shown = name.decode(errors="backslashreplace")
        raise MeshError(f"{shown}: the path is not valid UTF-8; rename the file or its folder")
    if path.is_symlink() and not path.exists():
        raise MeshError(f"{path}: this link points to a file that does not exist, or to itself")
    if path.is_fifo():
        raise MeshError(f"{path}: it is a pipe; save it to a file first")
    if not path.is_file():
        raise MeshError(f"{path}: the mesh file does not exist")
    if path.suffix.lower() not in MESH_FORMATS:
        raise MeshError(
            (
                f"{path}: {path.suffix} is not a mesh format that can be read; those are "
                f"{', '.join(MESH_FORMATS)}"
            )
            if path.suffix
            else f"{path}: the file name has no suffix; give one of {', '.join(MESH_FORMATS)}"
        )
    if path.stat().st_size == 0:
        raise MeshError(f"{path}: the mesh file is empty")
    check_bytes(path)


def read_mesh(path: Path) -> trimesh.Trimesh:
    """Reads the triangles of a file; a scene with several bodies becomes one mesh.

    Raises:
        MeshError: file missing, unreadable, without triangles, or too large.
    """
    _check_file(path)
    check_triangles(announced_triangle_count(path), str(path))
    check_textures(path, find_companion_files(path))
    log = logging.getLogger("trimesh")
    if not log.handlers:  # otherwise remarks on materials go to standard error
        log.addHandler(logging.NullHandler())
    try:
        with suppress_numpy_warnings():  # of numbers that overflow
            scene = trimesh.load_scene(path, process=False)
        parts = [g for g in scene.dump() if isinstance(g, trimesh.Trimesh) and len(g.faces)]
        mesh = _join_meshes(parts) if parts else None
    except Exception as error:  # the readers raise errors of any type
        reason = one_line(error)
        if isinstance(error, ImportError):  # of a package that guesses the encoding of a text
            reason = UNKNOWN_CONTENT_MESSAGE
        raise _unreadable_error(path, _missing_stl_bytes(path) or reason) from error
    if mesh is None:
        # With a package installed that guesses encodings, trimesh reads any bytes as text.
        damage = _missing_stl_bytes(path) or _binary_content_error(path)
        if damage:
            raise _unreadable_error(path, damage)
        raise MeshError(f"{path}: the mesh file has no triangles")
    return mesh


def _unreadable_error(path: Path, reason: str) -> MeshError:
    return MeshError(f"{path}: not a readable {path.suffix} mesh (cut off or damaged?): {reason}")


def _binary_content_error(path: Path) -> str:
    """Error message if a file of a text format has binary content, else empty."""
    text_formats = (".obj", ".off")  # Formats that have no binary form.
    binary = path.suffix.lower() in text_formats and b"\0" in path.read_bytes()
    return UNKNOWN_CONTENT_MESSAGE if binary else ""


def _missing_stl_bytes(path: Path) -> str:
    """Error message if a binary STL file is shorter than its triangle count requires, else
    empty."""
    size = path.stat().st_size
    if path.suffix.lower() != ".stl" or size < STL_HEADER_BYTES:
        return ""
    with path.open("rb") as file:
        count = int.from_bytes(file.read(STL_HEADER_BYTES)[-4:], "little")
    whole = STL_HEADER_BYTES + STL_TRIANGLE_BYTES * count
    return f"it has {size} of {whole} bytes" if size < whole else ""


def _join_meshes(parts: list[trimesh.Trimesh]) -> trimesh.Trimesh:
    """Joins several meshes. Textures are packed into one; if a part has no texture, each part gets
    its main colour instead."""
    # Colour of parts without one, beside parts that have one.
    default_colour = (204, 204, 204, 255)
    if len(parts) == 1:
        return parts[0]
    if any(texture_image(part) is None for part in parts):
        colours = [_mesh_colours(part) for part in parts]
        if any(colour is not None for colour in colours):
            for part, colour in zip(parts, colours, strict=True):
                visual = trimesh.visual.ColorVisuals(part)
                visual.face_colors = default_colour if colour is None else colour
                part.visual = visual
    return trimesh.util.concatenate(parts)


def _mesh_colours(part: trimesh.Trimesh) -> Any:
    """(4,) or (F, 4) colours of a mesh as bytes, or None."""
    if not part.visual.defined:
        return None
    if part.visual.kind != "texture":
        return part.visual.face_colors
    image = texture_image(part)
    if image is not None:
        return np.append(np.asarray(image.convert("RGB")).mean(axis=(0, 1)), 255).astype(np.uint8)
    return part.visual.material.main_color
