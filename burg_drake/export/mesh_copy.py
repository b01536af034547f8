"""Copies mesh files with the materials and textures that they name."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from burg_drake.core import InvalidInputError
from burg_drake.core.files import IMAGE_SIZE, read_bytes

_MTL = re.compile(rb"^[ \t]*mtllib[ \t]+(.+?)[ \t\r]*$", re.MULTILINE)
_MAP = re.compile(rb"^[ \t]*(?:map_\w+|bump|disp|decal|norm)[ \t]+(.+?)[ \t\r]*$", re.MULTILINE)

_URI = re.compile(rb'"uri"[ \t\r\n]*:[ \t\r\n]*"([^"]*)"')
"""Buffers and images in glTF."""


class MeshCopies:
    """Copies of mesh files in one folder, with unique names."""

    def __init__(self, folder: Path) -> None:
        """
        Args:
            folder: for the copies; made when there is something to copy.
        """
        self.folder = folder
        self._copied: dict[Path, str] = {}

    def add(self, source: Path) -> str:
        """Copies a mesh, unless it is there already, and all that it names beside it.

        Args:
            source: obj, gltf, or a file that names no others.

        Returns:
            The copy, relative to the folder.

        Raises:
            InvalidInputError: the mesh names a file that is missing, or is not in its own folder.
        """
        source = source.resolve()
        if source not in self._copied:
            self._copied[source] = self._place(source)
        return self._copied[source]

    def _place(self, source: Path) -> str:
        """Copies to the folder itself, or to one of its own if another mesh has a name there."""
        named = [source.name, *_named(source)]
        for name in named:
            if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
                raise InvalidInputError(
                    f"{source} names {name}, which is not in its folder; export needs it there"
                )
            if not (source.parent / name).is_file():
                raise InvalidInputError(
                    f"{source} names {name}, which is missing; put it there, or build the library"
                    " again"
                )
        place, number = Path(), 1
        while any(self._differs(place / name, source.parent / name) for name in named):
            number += 1
            place = Path(f"{source.stem}_{number}")
        for name in named:
            target = self.folder / place / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source.parent / name, target)
        return (place / source.name).as_posix()

    def _differs(self, relative: Path, source: Path) -> bool:
        """Whether there is something else by the name already."""
        target = self.folder / relative
        return target.exists() and target.read_bytes() != source.read_bytes()


def _named(mesh: Path) -> Iterator[str]:
    """Files that a mesh file names, relative to it; those of materials, too."""
    suffix = mesh.suffix.lower()
    if suffix == ".obj":
        for library in _names(_MTL, mesh):
            yield library
            if (mesh.parent / library).is_file():
                for texture in _names(_MAP, mesh.parent / library):
                    yield texture.split()[-1] if texture.startswith("-") else texture
    elif suffix == ".gltf":
        for uri in _URI.findall(read_bytes(mesh, IMAGE_SIZE)):
            if not uri.startswith(b"data:"):
                yield unquote(uri.decode(errors="replace"))


def _names(pattern: re.Pattern[bytes], file: Path) -> list[str]:
    """What a pattern finds in a file, each once."""
    found = pattern.findall(read_bytes(file, IMAGE_SIZE))
    return list(dict.fromkeys(name.decode(errors="replace") for name in found))
