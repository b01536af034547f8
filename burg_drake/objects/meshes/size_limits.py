"""How large mesh files may be: refused by their headers, before they fill time and memory.

A closed mesh of a million triangles takes 15 s and 1.5 GB to build, an open one, whose wall has
two sides, 3 GB.
"""

from __future__ import annotations

import base64
import io
import json
import re
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

from PIL import Image

from burg_drake.core import MeshError

MOST_BYTES = 2**29
"""Size of a mesh file, or of one that it refers to: 512 MB."""

MOST_TRIANGLES = 2_000_000
"""Triangles of a mesh; of an open one that becomes a wall half as many."""

MOST_PIXELS = 2**26
"""Of a texture: 8192 x 8192. Readers drop much larger ones without a word."""

HEADER = 65536
"""How far into a PLY or OFF file the number of its triangles is looked for [bytes]."""

LINES = {".obj": b"\nf ", ".stl": b"endfacet"}
"""What stands once a triangle in a text."""

COUNTS = {
    ".ply": re.compile(rb"^element +face +(\d{1,15})", re.MULTILINE),
    ".off": re.compile(rb"^\S*OFF\s+\d+\s+(\d{1,15})"),
}
"""Where a header says how many there are."""

STL_HEADER, STL_TRIANGLE = 84, 50
"""Bytes of a binary STL file's header with the number of triangles, and of a triangle."""

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".webp")


def check_bytes(path: Path) -> None:
    """Refuses a file that is too large to be read.

    Raises:
        MeshError: it has more than `MOST_BYTES`.
    """
    size = path.stat().st_size
    if size > MOST_BYTES:
        raise MeshError(
            f"{path}: the file has {size / 2**20:.0f} MB; at most "
            f"{MOST_BYTES / 2**20:.0f} MB are read: reduce the number of faces first"
        )


def check_triangles(count: int, name: str, *, wall: bool = False) -> None:
    """Refuses a mesh of too many triangles.

    Args:
        count: of its triangles or polygons.
        name: how messages call the mesh.
        wall: an open surface becomes a wall.

    Raises:
        MeshError: there are more than `MOST_TRIANGLES`, or half as many for a wall.
    """
    most = MOST_TRIANGLES // 2 if wall else MOST_TRIANGLES
    if count > most:
        what = "an open surface that becomes a wall" if wall else "a mesh"
        raise MeshError(
            f"{name}: {count:,} triangles; {what} may have {most:,}: reduce the number of"
            " faces first (100,000 are enough for contact, mass and stable poses)"
        )


def announced_triangles(path: Path) -> int:
    """How many triangles or polygons a file holds by its header or lines; 0 where that cannot be
    told without reading it whole."""
    suffix, size = path.suffix.lower(), path.stat().st_size
    with path.open("rb") as file:
        start = file.read(HEADER)
    if suffix == ".stl" and size >= STL_HEADER:
        count = int.from_bytes(start[STL_HEADER - 4 : STL_HEADER], "little")
        if STL_HEADER + STL_TRIANGLE * count <= size:
            return count
    if suffix in LINES:
        return path.read_bytes().count(LINES[suffix])
    found = COUNTS[suffix].search(start) if suffix in COUNTS else None
    return int(found[1]) if found else 0


def check_textures(path: Path, companions: Sequence[Path]) -> None:
    """Refuses textures that are too large.

    Args:
        path: the mesh file.
        companions: files that it refers to.

    Raises:
        MeshError: one has more than `MOST_PIXELS`.
    """
    for file in companions:
        if file.suffix.lower() in IMAGES:
            _check_picture(file, str(file))
    if path.suffix.lower() in (".glb", ".gltf"):
        for picture in _embedded(path):
            _check_picture(io.BytesIO(picture), f"{path}: a texture in it")


def _check_picture(picture: Any, name: str) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(picture) as image:  # its header alone
                width, height = image.size
    except Image.DecompressionBombError as error:
        raise MeshError(
            f"{name}: the image is too large for a texture: at most {_most()}"
        ) from error
    except (OSError, ValueError, SyntaxError):
        return  # no picture that anybody could read
    if width * height > MOST_PIXELS:
        raise MeshError(f"{name}: {width} x {height} pixels; a texture may have {_most()}")


def _most() -> str:
    side = int(MOST_PIXELS**0.5)
    return f"{side} x {side}: scale it down first"


def _embedded(path: Path) -> Iterator[bytes]:
    """The pictures of a glTF file; none of one that is damaged."""
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
                content = _content(path, buffer["uri"]) if "uri" in buffer else binary
                yield content[begin : begin + view["byteLength"]]
            elif "uri" in image:
                yield _content(path, image["uri"])
    except (AttributeError, LookupError, OSError, RecursionError, TypeError, ValueError) as error:
        if isinstance(error, MeshError):
            raise


def _content(path: Path, uri: str) -> bytes:
    """What a glTF file refers to: in the reference itself, or a file beside it."""
    if uri.startswith("data:"):
        return base64.b64decode(uri.partition(",")[2])
    file = path.parent / unquote(uri)
    if not file.is_file():
        return b""
    check_bytes(file)
    return file.read_bytes()
