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
    """How a surface reflects light.

    Attributes:
        color: red, green, blue, linear, and opacity; multiplies the texture.
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
        painted = _Painter(str(int(body.index())), _diffuse_color(properties), linear)
        X_BG = inspector.GetPoseInFrame(geometry).GetAsMatrix4()
        found += painted.surfaces(inspector.GetShape(geometry), X_BG)
    return tuple(found)


def _diffuse_color(properties: GeometryProperties) -> Color:
    rgba = properties.GetPropertyOrDefault("phong", "diffuse", Rgba(*DEFAULT_SURFACE_COLOR))
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
        for mesh, X_GM in _load_meshes(shape):
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
            return _gltf_material(found)
        if found is None or found.name is None:
            return self._plain(self.color)
        r, g, b, a = (np.asarray(found.diffuse, float) / 255.0).tolist()
        return self._plain((r, g, b, a), _encode_texture(found.image))

    def _plain(self, color: Color, texture: bytes = b"") -> Material:
        if not self.linear:
            r, g, b = linear_light(np.array(color[:3])).tolist()
            color = (r, g, b, color[3])
        return Material(color=color, texture=texture)


def _gltf_material(found: Any) -> Material:
    """The material of a glTF file, whose numbers are linear and default to 1."""
    color = (255,) * 4 if found.baseColorFactor is None else found.baseColorFactor
    r, g, b, a = (np.asarray(color, float) / 255.0).tolist()
    return Material(
        color=(r, g, b, a),
        metallic=1.0 if found.metallicFactor is None else float(found.metallicFactor),
        roughness=1.0 if found.roughnessFactor is None else float(found.roughnessFactor),
        texture=_encode_texture(found.baseColorTexture),
    )


def _load_meshes(shape: Mesh) -> Iterator[tuple[trimesh.Trimesh, Array]]:
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


def _encode_texture(image: Image.Image | None) -> bytes:
    if image is None:
        return b""
    file = io.BytesIO()
    image.convert("RGB").save(file, "png", compress_level=1)
    return file.getvalue()


@dataclass(frozen=True, kw_only=True)
class Lamp:
    """A light far away.

    Attributes:
        direction: that it shines in.
        frame: of the direction: the world, or that of the camera, as OpenCV has it.
        irradiance: of a surface that faces it [W/m^2]: one that is white and gets pi is white in
            the image.
        color: red, green, blue, linear.
        shadows: whether it casts them.
        angle: that its disc takes, which makes the edges of shadows soft [rad].
    """

    direction: Vector3
    frame: Literal["world", "camera"]
    irradiance: float
    color: Vector3
    shadows: bool
    angle: float


@dataclass(frozen=True, eq=False)
class BlenderScene:
    """What there is to be rendered.

    Attributes:
        surfaces: everything that can be seen; poses of their bodies come with each view.
        lamps: that shine on it.
        environment: light from all around, as the content of a Radiance file: the first row up, the
            middle of a row along x of the world, a quarter of the image to the left of it along y.
            There is none if empty.
        samples: paths of light a pixel; with 1 their noise stays.
    """

    surfaces: tuple[PaintedSurface, ...]
    lamps: tuple[Lamp, ...]
    environment: bytes = b""
    samples: int = 16

    def write(self, folder: Path, threads: int) -> None:
        """Writes `scene.json`, `meshes.npz` and images.

        Args:
            folder: that exists, and nothing else is in.
            threads: that shall render; as many as there are processors if 0.
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
    """A diagram as it is for Blender.

    Lights that stand in the world cast shadows whether or not they are asked to: without them
    things seem to float. One that goes with the camera stands for what walls scatter, and casts
    them only if it is asked to.

    Args:
        built: with the markers of its board, and the things of the appearance.
        appearance: has the lights; those of simulated cameras if it has none.
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
        irradiance=light.irradiance * np.pi,  # a white surface reflects the pi-th part
        color=light.color,
        shadows=light.shadows or light.frame == "world",
        angle=float(np.deg2rad(4.0)),  # a lamp of 20 cm seen from 3 m
    )
