"""A Drake diagram as a scene for Blender: triangles with materials, lamps and environment."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import trimesh
from PIL import Image
from pydrake.geometry import GeometryProperties, GeometrySet, Mesh, Rgba, Role, SceneGraph
from pydrake.multibody.plant import MultibodyPlant

from burg_drake.core import Array, Indices, Vector3, transform_points
from burg_drake.dataset.appearance import Appearance, DirectedLight
from burg_drake.dataset.appearance_rendering import environment_file
from burg_drake.station import DEFAULT_LIGHTS, StationDiagram, shape_triangles
from burg_drake.visualization import linear_light

DEFAULT_SURFACE_COLOR = (0.9, 0.7, 0.2, 1.0)
"""RGBA of surfaces without a colour, as in Drake's renderer."""
Color = tuple[float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Material:
    """Reflection of light by a surface.

    Attributes:
        color: linear red, green, blue, and opacity; multiplied with the texture.
        metallic: 0 for a dielectric, 1 for a metal.
        roughness: 0 for a mirror, 1 for chalk.
        texture: PNG in sRGB; none if empty.
    """

    color: Color = DEFAULT_SURFACE_COLOR
    metallic: float = 0.0
    roughness: float = 0.5
    texture: bytes = b""


@dataclass(frozen=True, eq=False)
class PaintedSurface:
    """Triangles of one material.

    Attributes:
        body: number of the body.
        vertices: (V, 3) vertices in the body's frame [m].
        faces: (F, 3) triangles.
        material: material of all triangles.
        normals: (V, 3) vertex normals in the body's frame, if the file has them.
        uv: (V, 2) texture coordinates, from the lower left corner, if there is a texture.
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
    """The triangles of `visible_surfaces`, with their materials.

    Args:
        plant: plant with the bodies.
        scene_graph: scene graph with the shapes.
        linear: whether colours of shapes and OBJ files are linear, as in Drake's physically based
            shading, or sRGB, as in its simple shading.
    """
    inspector = scene_graph.model_inspector()
    seen = inspector.GetGeometryIds(GeometrySet(inspector.GetAllGeometryIds()), Role.kPerception)
    found: list[PaintedSurface] = []
    for geometry in sorted(seen, key=lambda one: one.get_value()):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)) or plant.world_body()
        properties = inspector.GetPerceptionProperties(geometry)
        painter = _Painter(str(int(body.index())), _diffuse_color(properties), linear)
        X_BG = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        found += painter.surfaces(inspector.GetShape(geometry), X_BG)
    return tuple(found)


def _diffuse_color(properties: GeometryProperties) -> Color:
    rgba = properties.GetPropertyOrDefault("phong", "diffuse", Rgba(*DEFAULT_SURFACE_COLOR))
    return (rgba.r(), rgba.g(), rgba.b(), rgba.a())


@dataclass(frozen=True)
class _Painter:
    """Makes the surfaces of one shape.

    Attributes:
        body: number of the shape's body.
        color: colour of the shape, for files without colours.
        linear: whether the colours of the shape and of OBJ files are linear.
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
        for mesh, X_GM in _load_meshes(shape):
            vertices = transform_points(X_GM, np.asarray(mesh.vertices)) * scale
            normals = None
            if "vertex_normals" in mesh._cache:  # normals of the file, not computed ones
                normals = mesh.vertex_normals @ X_GM[:3, :3].T / scale @ X_BG[:3, :3].T
            yield PaintedSurface(
                self.body,
                transform_points(X_BG, vertices),
                np.asarray(mesh.faces, np.int64),
                self._material(getattr(mesh.visual, "material", None)),
                normals,
                getattr(mesh.visual, "uv", None),
            )

    def _material(self, material: Any) -> Material:
        """Material from a mesh file; without one, from the colour of the shape."""
        if isinstance(material, trimesh.visual.material.PBRMaterial):
            return _gltf_material(material)
        if material is None or material.name is None:
            return self._plain(self.color)
        r, g, b, a = (np.asarray(material.diffuse, float) / 255.0).tolist()
        return self._plain((r, g, b, a), _encode_texture(material.image))

    def _plain(self, color: Color, texture: bytes = b"") -> Material:
        if not self.linear:
            r, g, b = linear_light(np.array(color[:3])).tolist()
            color = (r, g, b, color[3])
        return Material(color=color, texture=texture)


def _gltf_material(material: Any) -> Material:
    """Material from a glTF file, whose values are linear and default to 1."""
    color = (255,) * 4 if material.baseColorFactor is None else material.baseColorFactor
    r, g, b, a = (np.asarray(color, float) / 255.0).tolist()
    return Material(
        color=(r, g, b, a),
        metallic=1.0 if material.metallicFactor is None else float(material.metallicFactor),
        roughness=1.0 if material.roughnessFactor is None else float(material.roughnessFactor),
        texture=_encode_texture(material.baseColorTexture),
    )


def _load_meshes(shape: Mesh) -> Iterator[tuple[trimesh.Trimesh, Array]]:
    """Meshes of a file, one per material, each with its pose and scale (4, 4) in the file."""
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


def _encode_texture(image: Image.Image | None) -> bytes:
    if image is None:
        return b""
    file = io.BytesIO()
    image.convert("RGB").save(file, "png", compress_level=1)
    return file.getvalue()


@dataclass(frozen=True, kw_only=True)
class Lamp:
    """A directional light in Blender.

    Attributes:
        direction: direction in which the lamp shines.
        frame: frame of the direction: the world, or the camera's optical frame.
        irradiance: irradiance of a surface that faces the lamp [W/m^2]; pi makes a white surface
            white in the image.
        color: linear red, green, blue.
        shadows: whether it casts shadows.
        angle: angular diameter of its disc, which softens the edges of shadows [rad].
    """

    direction: Vector3
    frame: Literal["world", "camera"]
    irradiance: float
    color: Vector3
    shadows: bool
    angle: float


@dataclass(frozen=True, eq=False)
class BlenderScene:
    """A scene for Blender.

    Attributes:
        surfaces: visible surfaces; the poses of their bodies come with each view.
        lamps: directional lights.
        environment: environment map, as the content of a Radiance file: the first row points up,
            the middle of a row along x of the world, a quarter of the image to the left of it along
            y. No environment if empty.
        samples: light paths per pixel; at 1 the image is not denoised.
    """

    surfaces: tuple[PaintedSurface, ...]
    lamps: tuple[Lamp, ...]
    environment: bytes = b""
    samples: int = 16

    def write(self, folder: Path, threads: int) -> None:
        """Writes `scene.json`, `meshes.npz` and images.

        Args:
            folder: existing empty folder.
            threads: number of rendering threads; one per processor if 0.
        """
        textures = {one.material.texture for one in self.surfaces} - {b""}
        names = {png: f"texture_{k}.png" for k, png in enumerate(sorted(textures))}
        files = {name: png for png, name in names.items()}
        if self.environment:
            files["environment.hdr"] = self.environment
        parts = [
            {
                "body": one.body,
                "material": asdict(one.material) | {"texture": names.get(one.material.texture, "")},
            }
            for one in self.surfaces
        ]
        described = {
            "version": 1,
            "samples": self.samples,
            "threads": threads,
            "parts": parts,
            "lamps": [asdict(lamp) for lamp in self.lamps],
            "environment": "environment.hdr" if self.environment else "",
        }
        files["scene.json"] = json.dumps(described).encode()
        arrays = io.BytesIO()
        np.savez(arrays, **dict(self._arrays()))  # type: ignore[arg-type]
        files["meshes.npz"] = arrays.getvalue()
        for name, content in files.items():
            (folder / name).write_bytes(content)

    def _arrays(self) -> Iterator[tuple[str, Array]]:
        for k, one in enumerate(self.surfaces):
            yield f"part_{k}.vertices", one.vertices.astype(np.float32)
            yield f"part_{k}.faces", one.faces.astype(np.int32)
            if one.normals is not None:
                yield f"part_{k}.normals", one.normals.astype(np.float32)
            if one.uv is not None:
                yield f"part_{k}.uv", one.uv.astype(np.float32)


def make_blender_scene(built: StationDiagram, appearance: Appearance | None = None) -> BlenderScene:
    """Converts a diagram for Blender.

    Lights in the world always cast shadows: without them, objects seem to float. A light that moves
    with the camera stands for light scattered by walls, and casts shadows only if its `shadows` is
    set.

    Args:
        built: diagram with the markers of its board, and the distractors of the appearance.
        appearance: appearance with the lights; those of simulated cameras if it has none.
    """
    lights = () if appearance is None else appearance.lights
    environment = b""
    if appearance is not None and appearance.room is not None and appearance.room_light:
        environment = environment_file(appearance).read_bytes()
    surfaces = painted_surfaces(built.plant, built.scene_graph, linear=bool(lights))
    lamps = [_lamp_of_light(light) for light in lights or _default_lights()]
    return BlenderScene(surfaces, tuple(lamps), environment)


def _default_lights() -> list[DirectedLight]:
    found = []
    for light in DEFAULT_LIGHTS:
        x, y, z = np.asarray(light.direction, float).tolist()
        intensity = float(light.intensity)
        found.append(DirectedLight(direction=(x, y, z), frame=light.frame, irradiance=intensity))
    return found


def _lamp_of_light(light: DirectedLight) -> Lamp:
    return Lamp(
        direction=light.direction,
        frame=light.frame,
        irradiance=light.irradiance * np.pi,  # a white surface reflects 1 / pi of it
        color=light.color,
        shadows=light.shadows or light.frame == "world",
        angle=float(np.deg2rad(4.0)),  # a lamp of 20 cm seen from 3 m
    )
