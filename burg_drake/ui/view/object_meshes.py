"""Shapes of a library's objects as the browser takes them, each read once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from burg_drake.core import Array, MeshError
from burg_drake.core.files import without_warnings
from burg_drake.objects.library import ObjectLibrary
from burg_drake.visualization.style import linear_light

ROUGHNESS = 0.75
"""Of all surfaces: paper, paint and plastic."""
MAX_TEXTURE = 1024
"""Larger textures are reduced to this width and height [pixel]."""


@dataclass(frozen=True, eq=False)
class ObjectMesh:
    """An object to look at.

    Attributes:
        glb: it looks, as a binary glTF whose axes are those of the object frame.
        vertices: (N, 3) of its plain shape in the object frame [m].
        faces: (M, 3) of its plain shape.
    """

    glb: bytes
    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]

    @property
    def bounds(self) -> Array:
        """(2, 3) lower and upper corner in the object frame [m]."""
        return np.array([self.vertices.min(axis=0), self.vertices.max(axis=0)], dtype=float)


class ObjectMeshes:
    """Shapes by object.

    Args:
        library: where the objects are.
    """

    def __init__(self, library: ObjectLibrary) -> None:
        self.library = library
        self._known: dict[str, ObjectMesh] = {}

    def __getitem__(self, name: str) -> ObjectMesh:
        """The shape of an object.

        Raises:
            UnknownNameError: no such object, or its file is missing.
            MeshError: its file is damaged.
        """
        if name not in self._known:
            self._known[name] = _read(self.library, name)
        return self._known[name]


def _read(library: ObjectLibrary, name: str) -> ObjectMesh:
    path = library.path(library.entry(name).mesh)
    try:
        with without_warnings():
            scene = trimesh.load_scene(path, process=False)
            parts = [g for g in scene.geometry.values() if isinstance(g, trimesh.Trimesh)]
            for part in parts:
                _make_matte(part)
            glb = scene.export(file_type="glb", include_normals=True)
        plain = trimesh.util.concatenate([_geometry_only(part) for part in parts])
    except Exception as error:  # the reader raises whatever it stumbles over
        raise library.damaged(path) from error
    if not len(plain.faces):
        raise MeshError(f"{path} has no faces")
    plain.merge_vertices(merge_tex=True, merge_norm=True)
    return ObjectMesh(
        bytes(glb),
        np.asarray(plain.vertices, dtype=np.float32),
        np.asarray(plain.faces, dtype=np.uint32),
    )


def _make_matte(part: trimesh.Trimesh) -> None:
    """Gives a part a surface that does not shine like metal, which glTF takes for the default."""
    material = getattr(part.visual, "material", None)
    if material is None:
        return
    if hasattr(material, "to_pbr"):
        material = material.to_pbr()
    material.metallicFactor, material.roughnessFactor = 0.0, ROUGHNESS
    if material.baseColorFactor is not None:  # of colours as files have them; glTF has light
        r, g, b, a = np.asarray(material.baseColorFactor, dtype=float) / 255.0
        material.baseColorFactor = [*(float(linear_light(c)) for c in (r, g, b)), a]
    image = material.baseColorTexture
    if image is not None and max(image.size) > MAX_TEXTURE:
        small = image.copy()
        small.thumbnail((MAX_TEXTURE, MAX_TEXTURE), reducing_gap=2.0)
        material.baseColorTexture = small
    part.visual.material = material


def _geometry_only(part: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(np.asarray(part.vertices), np.asarray(part.faces), process=False)
