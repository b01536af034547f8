"""The object library document: what is known of each object, and where its files are.

A library is a folder with a `library.yaml` and one folder an object; all paths in the document are
relative to the library's folder, so that it can be moved or zipped as it is.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from burg_drake.core import DocumentError, MeshError, UnknownNameError, content_hash, nearest
from burg_drake.core.documents import load_document, save_document
from burg_drake.core.files import atomic_write
from burg_drake.core.paths import (
    NO_PACKAGES,
    may_name_packages,
    named_files,
    require_name,
    require_names,
    resolve,
)
from burg_drake.objects.library.entry import (
    ObjectEntry,
)

if TYPE_CHECKING:
    import trimesh

LIBRARY_FILE = "library.yaml"

PACKAGE_FILE = "package.xml"


@dataclass(frozen=True, kw_only=True)
class LibraryDocument:
    """An object library (`library.yaml`), written by `burg-drake library build`.

    Attributes:
        name: name of the library.
        description: text for people.
        objects: the objects by name.
    """

    version: int = 1
    name: str
    description: str = ""
    objects: dict[str, ObjectEntry] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_name(self.name, "name")
        require_names(self.objects, "objects")


@dataclass(frozen=True)
class ObjectLibrary:
    """A library on disk.

    Attributes:
        document: contents of `library.yaml`.
        root: the library's folder.
    """

    document: LibraryDocument
    root: Path

    def __repr__(self) -> str:
        return f"ObjectLibrary({self.name!r}, {len(self.objects)} objects, {str(self.root)!r})"

    @property
    def name(self) -> str:
        """The library's name."""
        return self.document.name

    @property
    def objects(self) -> dict[str, ObjectEntry]:
        """Entries by object name."""
        return self.document.objects

    def entry(self, name: str) -> ObjectEntry:
        """The entry of an object.

        Raises:
            UnknownNameError: no such object; the message lists the nearest and all names.
        """
        if name not in self.objects:
            raise UnknownNameError(
                f"object {name!r} is not in library {self.root}; {nearest(name, self.objects)}"
            )
        return self.objects[name]

    def path(self, relative: str) -> Path:
        """Absolute path of a file of the library.

        Raises:
            UnknownNameError: the file is missing.
        """
        path = self.root / relative
        if not path.is_file():
            what = "is missing" if not path.exists() else "is not a file"
            raise UnknownNameError(f"{path} {what}; build library {self.name!r} again")
        return path

    def surface(self, name: str) -> trimesh.Trimesh:
        """The surface of an object, to sample on and measure.

        Args:
            name: of the object.

        Returns:
            Its mesh in the object frame O [m], without colours; vertices that the file repeats for
            their normals and texture coordinates are merged.

        Raises:
            UnknownNameError: no such object, or its mesh file is missing.
            MeshError: the mesh file is damaged.
        """
        entry = self.entry(name)
        mesh = self.mesh(entry.surface or entry.mesh)
        mesh.merge_vertices(merge_tex=True, merge_norm=True)
        return mesh

    def mesh(self, relative: str) -> trimesh.Trimesh:
        """A mesh file of the library, such as a convex piece, as it is [m], without colours.

        Raises:
            UnknownNameError: the file is missing.
            MeshError: it is damaged.
        """
        import trimesh

        path = self.path(relative)
        try:
            mesh = trimesh.load(path, force="mesh", process=False, skip_materials=True)
            corners = np.asarray(mesh.vertices)[mesh.faces]  # fails for faces of no vertices
        except Exception as error:  # the reader raises whatever it stumbles over
            raise self.damaged(path) from error
        if not len(corners) or not np.isfinite(corners).all():
            raise self.damaged(path)
        return mesh

    def damaged(self, path: Path) -> MeshError:
        """The error of a mesh file that is not as it was built."""
        return MeshError(f"{path} is damaged or not a mesh; build library {self.name!r} again")

    @cached_property
    def content(self) -> dict[str, str]:
        """Build hash by object name, with the files of packages that an object's model names."""
        return {name: self._content(entry) for name, entry in self.objects.items()}

    def _content(self, entry: ObjectEntry) -> str:
        model = self.root / entry.sdf
        if not model.is_file() or not may_name_packages(model):
            return entry.build
        return content_hash(entry.build, named_files(model, NO_PACKAGES))

    def save(self) -> None:
        """Writes `library.yaml`, and `package.xml`, by which Drake's Parser and ROS know the folder
        as a package: `package://NAME/mug/mug.sdf`."""
        manifest, package = (
            self.root / PACKAGE_FILE,
            package_manifest(package_name(self.name), "Object library"),
        )
        if not manifest.is_file() or manifest.read_text() != package:
            atomic_write(manifest, package)
        save_document(self.document, self.root / LIBRARY_FILE)


def load_library(reference: str | Path, base: Path | None = None) -> ObjectLibrary:
    """Loads a library.

    Example::

        library = burg.load_library("household")
        mug = library.entry("mug")
        print(mug.mass, [pose.probability for pose in mug.stable_poses])

    Args:
        reference: the library's folder or its `library.yaml`; a bare name such as `household` for
            a built-in one; or `package://burg_drake/models/...`.
        base: folder that relative references start from.

    Raises:
        UnknownNameError: there is no such library.
        DocumentError: its document does not fit the schema.
    """
    path = resolve(reference, "models", base)
    file = path / LIBRARY_FILE if path.is_dir() else path
    if file is not path and not file.exists():
        raise DocumentError(
            f"{path} is not an object library ({LIBRARY_FILE} is missing); `burg-drake"
            " library build` makes a library from meshes"
        )
    return ObjectLibrary(load_document(file, LibraryDocument), file.parent)


def package_name(name: str) -> str:
    """A name as packages of ROS and Drake may have it, made of a document's name."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "library"


def package_manifest(package: str, description: str) -> str:
    """A ROS package manifest (format 3, REP 149) with nothing but what it must have."""
    return f"""<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>1.0.0</version>
  <description>{description}</description>
  <maintainer email="nobody@example.com">nobody</maintainer>
  <license>unknown</license>
</package>
"""
