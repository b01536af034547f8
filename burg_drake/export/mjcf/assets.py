"""Meshes, materials and textures of objects as assets of an MJCF file."""

from __future__ import annotations

import io
import shutil
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from burg_drake.core.files import atomic_write
from burg_drake.export.parts import VisualPart, collision_meshes, visual_parts
from burg_drake.objects.library import ObjectEntry, ObjectLibrary

OBJECTS = "objects"
"""Folder with one folder an object."""


class MjcfAssets:
    """Writes the files of objects and declares them, each object once.

    Names of assets are `OBJECT:visual_0`, `OBJECT:piece_000`, which no two objects share.
    """

    def __init__(self, asset: Element, library: ObjectLibrary, folder: Path | None) -> None:
        """
        Args:
            asset: element that the assets are declared in.
            library: has the objects.
            folder: of the MJCF file; if None nothing is written, pieces are read where they are,
                and there is nothing to look at.
        """
        self._asset = asset
        self._library = library
        self._folder = folder
        self._visuals: dict[str, list[tuple[str, str]]] = {}
        self._pieces: dict[str, list[str]] = {}

    def visuals(self, name: str, entry: ObjectEntry) -> list[tuple[str, str]]:
        """Meshes and materials of what is looked at of an object."""
        if name not in self._visuals:
            parts = visual_parts(self._library, entry)
            self._visuals[name] = [self._visual(name, i, part) for i, part in enumerate(parts)]
        return self._visuals[name]

    def pieces(self, name: str, entry: ObjectEntry) -> list[str]:
        """Meshes of the convex pieces of an object."""
        if name not in self._pieces:
            self._pieces[name] = [
                self._piece(name, i, piece) for i, piece in enumerate(collision_meshes(entry))
            ]
        return self._pieces[name]

    def _visual(self, name: str, i: int, part: VisualPart) -> tuple[str, str]:
        assert self._folder is not None
        mesh, file = f"{name}:visual_{i}", f"{OBJECTS}/{name}/visual_{i}.obj"
        atomic_write(self._folder / file, obj_text(part))
        # The walls of what is looked at may be open: no volume is needed, a surface is.
        SubElement(self._asset, "mesh", {"name": mesh, "file": file, "inertia": "shell"})
        appearance = {"rgba": " ".join(f"{v:g}" for v in part.rgba)}
        if part.image is not None:
            texture = f"{OBJECTS}/{name}/visual_{i}.png"
            data = io.BytesIO()
            part.image.convert("RGB").save(data, format="PNG")
            atomic_write(self._folder / texture, data.getvalue())
            SubElement(self._asset, "texture", {"name": mesh, "type": "2d", "file": texture})
            appearance = {"texture": mesh}
        SubElement(self._asset, "material", {"name": mesh, "specular": "0.1", **appearance})
        return mesh, mesh

    def _piece(self, name: str, i: int, piece: str) -> str:
        mesh, file = f"{name}:piece_{i:03d}", f"{OBJECTS}/{name}/pieces/{i:03d}.obj"
        if self._folder is None:
            file = str(self._library.path(piece).resolve())
        else:
            target = self._folder / file
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(self._library.path(piece), target)
        SubElement(self._asset, "mesh", {"name": mesh, "file": file, "inertia": "convex"})
        return mesh


def obj_text(part: VisualPart) -> str:
    """A part as OBJ, with normals, and with texture coordinates if it has them."""
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in part.vertices]
    rows += [f"vn {x:.5g} {y:.5g} {z:.5g}" for x, y, z in part.normals]
    if part.uv is not None:
        rows += [f"vt {u:.7g} {v:.7g}" for u, v in part.uv]
    corner = "{0}//{0}" if part.uv is None else "{0}/{0}/{0}"
    rows += ["f " + " ".join(corner.format(n) for n in face) for face in np.asarray(part.faces) + 1]
    return "\n".join(rows) + "\n"
