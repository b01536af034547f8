"""What a renderer sees of a diagram: triangles with normals, colours and textures."""

from __future__ import annotations

import io
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from pydrake.geometry import GeometryProperties, GeometrySet, Mesh, Rgba, Role, SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from burg_drake.core import Array, Indices, transform_points
from burg_drake.dataset.appearance import linear_from_srgb
from burg_drake.station.diagram import shape_triangles

UNPAINTED = (0.9, 0.7, 0.2, 1.0)
"""Colour of what has none, in Drake's renderer."""
ROUGHNESS = 0.5
"""Of surfaces that do not say: a plastic between mat and shiny."""
Color = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Material:
    """How a surface reflects light.

    Attributes:
        color: red, green, blue, linear, and opacity; multiplies the texture.
        metallic: 0 for a dielectric, 1 for a metal.
        roughness: 0 for a mirror, 1 for chalk.
        texture: PNG in sRGB; none if empty.
    """

    color: Color = UNPAINTED
    metallic: float = 0.0
    roughness: float = ROUGHNESS
    texture: bytes = b""


@dataclass(frozen=True, eq=False)
class PaintedSurface:
    """Triangles of one material.

    Attributes:
        body: number of the body that they belong to.
        vertices: (V, 3) in the body's frame [m].
        faces: (F, 3).
        material: of all of them.
        normals: (V, 3) of the vertices, in the body's frame, if they are known.
        uv: (V, 2) place in the texture, from its lower left corner, if it has one.
    """

    body: str
    vertices: Array
    faces: Indices
    material: Material
    normals: Array | None = None
    uv: Array | None = None


def painted_surfaces(
    plant: MultibodyPlant, scene_graph: SceneGraph, *, linear: bool
) -> tuple[PaintedSurface, ...]:
    """All that renderers see: the triangles of `visible_surfaces`.

    Args:
        plant: has the bodies.
        scene_graph: has the shapes.
        linear: whether colours of shapes and OBJ files are linear, as Drake's physically based
            shading takes them, or sRGB, as its simple shading does.
    """
    inspector = scene_graph.model_inspector()
    seen = inspector.GetGeometryIds(GeometrySet(inspector.GetAllGeometryIds()), Role.kPerception)
    found: list[PaintedSurface] = []
    for geometry in sorted(seen, key=lambda one: one.get_value()):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)) or plant.world_body()
        properties = inspector.GetPerceptionProperties(geometry)
        painted = _Painter(str(int(body.index())), _color(properties), linear)
        X_BG = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        found += painted.surfaces(inspector.GetShape(geometry), X_BG)
    return tuple(found)


def _color(properties: GeometryProperties) -> Color:
    rgba = properties.GetPropertyOrDefault("phong", "diffuse", Rgba(*UNPAINTED))
    return (rgba.r(), rgba.g(), rgba.b(), rgba.a())


@dataclass(frozen=True)
class _Painter:
    """Makes surfaces of one shape.

    Attributes:
        body: that has the shape.
        color: of the shape, if its file has none.
        linear: whether such colours, and those of OBJ files, are.
    """

    body: str
    color: Color
    linear: bool

    def surfaces(self, shape: Any, X_BG: Array) -> Iterator[PaintedSurface]:
        if not isinstance(shape, Mesh):
            vertices, faces = shape_triangles(shape)
            if len(faces):
                vertices = transform_points(X_BG, vertices)
                yield PaintedSurface(self.body, vertices, faces, self._plain(self.color))
            return
        scale = np.asarray(shape.scale3())
        for mesh, X_GM in _meshes(shape):
            vertices = transform_points(X_GM, np.asarray(mesh.vertices)) * scale
            normals = None
            if "vertex_normals" in mesh._cache:  # that the file has, and are not computed
                normals = mesh.vertex_normals @ X_GM[:3, :3].T / scale @ X_BG[:3, :3].T
            yield PaintedSurface(
                self.body,
                transform_points(X_BG, vertices),
                np.asarray(mesh.faces, np.int64),
                self._material(getattr(mesh.visual, "material", None)),
                normals,
                getattr(mesh.visual, "uv", None),
            )

    def _material(self, found: Any) -> Material:
        """That of a mesh file; of one that has none, the colour of the shape."""
        if isinstance(found, trimesh.visual.material.PBRMaterial):
            return _physical(found)
        if found is None or found.name is None:
            return self._plain(self.color)
        r, g, b, a = (np.asarray(found.diffuse, float) / 255.0).tolist()
        return self._plain((r, g, b, a), _png(found.image))

    def _plain(self, color: Color, texture: bytes = b"") -> Material:
        if not self.linear:
            r, g, b = linear_from_srgb(np.array(color[:3])).tolist()
            color = (r, g, b, color[3])
        return Material(color=color, texture=texture)


def _physical(found: Any) -> Material:
    """The material of a glTF file, whose numbers are linear and default to 1."""
    color = (255,) * 4 if found.baseColorFactor is None else found.baseColorFactor
    r, g, b, a = (np.asarray(color, float) / 255.0).tolist()
    return Material(
        color=(r, g, b, a),
        metallic=1.0 if found.metallicFactor is None else float(found.metallicFactor),
        roughness=1.0 if found.roughnessFactor is None else float(found.roughnessFactor),
        texture=_png(found.baseColorTexture),
    )


def _meshes(shape: Mesh) -> Iterator[tuple[trimesh.Trimesh, Array]]:
    """The meshes of a file, one a material, each with its pose and scale (4, 4) in the file."""
    source = shape.source()
    if source.is_path():
        loaded = trimesh.load_scene(source.path(), process=False)
    else:
        memory = source.in_memory()
        loaded = trimesh.load_scene(
            io.BytesIO(memory.mesh_file.contents()),
            file_type=memory.mesh_file.extension().lstrip("."),
            resolver={name: file.contents() for name, file in memory.supporting_files.items()},
            process=False,
        )
    for node in loaded.graph.nodes_geometry:
        X_GM, name = loaded.graph[node]
        yield loaded.geometry[name], X_GM


def _png(image: Image.Image | None) -> bytes:
    if image is None:
        return b""
    file = io.BytesIO()
    image.convert("RGB").save(file, "png", compress_level=1)
    return file.getvalue()
