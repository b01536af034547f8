"""The board's pose, and where objects stand, in pictures that Blender's Cycles renders.

    pip install burg-drake[blender]
    python benchmarks/room_blender.py [--views N] [--samples N] [--lamp RADIUS] [--keep FOLDER]

A second world beside `benchmarks/room`, from which it takes the printed page, the sensor and the
objects' meshes, but another program traces the light. The scene `tabletop_six` stands on a printed
board of A2, lit by a lamp and by light from everywhere, its objects 0 to 20 mm and up to 15 degrees
off their places. Pictures have 640 x 480 pixels, each of 64 paths, or `--samples`; a minute a view.

Columns: error of the camera's position [mm] and rotation [deg], the same by OpenCV; then of each
object that was `measured`, its displacement's error [mm] over what was said (`sd`).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray
from room.exposure import INK, PAPER
from room.lens import CAMERAS, Camera
from room.objects import Thing, arranged
from room.rows import BOARD, WEBCAM, sheet
from room.sensor import image_of
from room.sheet import AS_MEANT, TEXELS, Sheet
from room.views import look_at
from room_board import Answer, opencv, ours
from scipy.spatial.transform import Rotation

import burg_drake as burg

Array = NDArray[np.float64]

SIZE = "640x480"
SENSOR = 36.0
"""Width of Blender's sensor [mm]; only its ratio to the focal length matters."""
LAMP = (0.9, -0.4, 1.5)
"""Where the lamp is in S [m]."""
AMBIENT = 0.4
"""Light from everywhere, over that of the lamp in the middle of the board."""
TABLE = 0.25
"""Reflectance of the table."""


class Studio:
    """Blender's scene with a board on a table.

    Args:
        bpy: Blender's module.
        lying: the sheet.
        lamp: its radius [m].
        samples: paths of a pixel.
    """

    def __init__(self, bpy: Any, lying: Sheet, lamp: float, samples: int) -> None:
        self._bpy = bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._scene = scene = bpy.context.scene
        scene.render.engine = "CYCLES"
        scene.cycles.device, scene.cycles.samples = "CPU", samples
        scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        self._camera = self._placed("camera", bpy.data.cameras.new("camera"))
        scene.camera = self._camera
        self._lamp(lamp)
        self._table(lying)
        self._things: list[Any] = []

    def render(self, camera: Camera, X_SC: Array, things: list[Thing], file: Path) -> Array:
        """(H, W, 3) light that reaches the pixels."""
        for placed in self._things:
            self._bpy.data.objects.remove(placed)
        self._things = [self._thing(thing) for thing in things]
        width, height = camera.size
        render, lens = self._scene.render, self._camera.data
        render.resolution_x, render.resolution_y = width, height
        lens.sensor_fit, lens.sensor_width = "HORIZONTAL", SENSOR
        lens.lens = camera.focal[0] * SENSOR / width
        lens.shift_x = ((width - 1) / 2 - camera.center[0]) / width
        lens.shift_y = (camera.center[1] - (height - 1) / 2) / width
        self._camera.matrix_world = _matrix(X_SC @ np.diag([1.0, -1.0, -1.0, 1.0]))
        render.filepath = str(file)
        self._bpy.ops.render.render(write_still=True)
        image = self._bpy.data.images.load(str(file))
        pixels = np.array(image.pixels[:], dtype=float).reshape(height, width, -1)
        self._bpy.data.images.remove(image)
        return pixels[::-1, :, :3]

    def _placed(self, name: str, data: Any) -> Any:
        placed = self._bpy.data.objects.new(name, data)
        self._scene.collection.objects.link(placed)
        return placed

    def _lamp(self, radius: float) -> None:
        data = self._bpy.data.lights.new("lamp", "POINT")
        data.shadow_soft_size = radius
        data.energy = 4.0 * np.pi**2 * 2.0  # irradiance of about pi on the board: radiance of 1
        self._placed("lamp", data).location = LAMP
        world = self._bpy.data.worlds.new("room")
        self._scene.world = world
        world.use_nodes = True
        world.node_tree.nodes["Background"].inputs["Strength"].default_value = AMBIENT

    def _table(self, lying: Sheet) -> None:
        width, height = (int(each[0]) for each in (lying.texture.width, lying.texture.height))
        texels = lying.texture.texels[: width * height].reshape(height, width, 4) / 255.0
        color = np.ones((height, width, 4), np.float32)
        paper = texels[..., 3:]
        color[..., :3] = INK * paper + (PAPER - INK) * texels[..., :3] + TABLE * (1.0 - paper)
        image = self._bpy.data.images.new("sheet", width, height, float_buffer=True)
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.ascontiguousarray(color[::-1]).ravel())
        left, top = lying.texture.left, lying.texture.top
        right, bottom = left + width / TEXELS, top - height / TEXELS
        corners = [(left, bottom, 0), (right, bottom, 0), (right, top, 0), (left, top, 0)]
        mesh = self._bpy.data.meshes.new("sheet")
        mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
        mesh.uv_layers.new().data.foreach_set("uv", [0, 0, 1, 0, 1, 1, 0, 1])
        material = self._matt("sheet", (1.0, 1.0, 1.0))
        tree = material.node_tree
        looked_up = tree.nodes.new("ShaderNodeTexImage")
        looked_up.image, looked_up.extension = image, "EXTEND"
        tree.links.new(looked_up.outputs["Color"], tree.nodes["Diffuse BSDF"].inputs["Color"])
        mesh.materials.append(material)
        self._placed("sheet", mesh)
        ground = self._bpy.data.meshes.new("table")
        far = 3.0
        ground.from_pydata(
            [(-far, -far, -1e-4), (far, -far, -1e-4), (far, far, -1e-4), (-far, far, -1e-4)],
            [],
            [(0, 1, 2, 3)],
        )
        ground.materials.append(self._matt("table", (TABLE, TABLE, TABLE)))
        self._placed("table", ground)

    def _thing(self, thing: Thing) -> Any:
        mesh = self._bpy.data.meshes.new("thing")
        mesh.from_pydata(thing.mesh.vertices.tolist(), [], thing.mesh.faces.tolist())
        mesh.materials.append(self._matt("thing", _reflectance(thing.mesh)))
        placed = self._placed("thing", mesh)
        placed.matrix_world = _matrix(thing.X_SO)
        return placed

    def _matt(self, name: str, color: tuple[float, float, float]) -> Any:
        material = self._bpy.data.materials.new(name)
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
        diffuse.inputs["Color"].default_value = (*color, 1.0)
        out = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(diffuse.outputs["BSDF"], out.inputs["Surface"])
        return material


def _matrix(X: Array) -> list[list[float]]:
    """Columns, as Blender assigns them."""
    return [list(map(float, row)) for row in X.T]


def _reflectance(mesh: trimesh.Trimesh) -> tuple[float, float, float]:
    """Linear reflectance, one color of the whole mesh."""
    visual = mesh.visual.to_color() if mesh.visual.kind == "texture" else mesh.visual
    srgb = np.median(np.asarray(visual.vertex_colors)[:, :3], axis=0) / 255.0
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return tuple(map(float, linear))  # type: ignore[return-value]


def displaced(things: dict[str, Thing], rng: np.random.Generator) -> dict[str, Thing]:
    """Objects off their places, turned about their own middles."""
    moved = {}
    for name, thing in things.items():
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_euler("z", rng.uniform(-15, 15), degrees=True).as_matrix()
        middle = np.eye(4)
        middle[:2, 3] = trimesh.transform_points(thing.mesh.vertices, thing.X_SO)[:, :2].mean(0)
        shift = np.eye(4)
        direction = rng.uniform(-np.pi, np.pi)
        shift[:2, 3] = rng.uniform(0, 0.02) * np.array([np.cos(direction), np.sin(direction)])
        X = shift @ middle @ turn @ np.linalg.inv(middle) @ thing.X_SO
        moved[name] = Thing(thing.mesh, X)
    return moved


def _printed(k: int, us: Answer, them: Answer) -> None:
    columns = f"{k:4} {us.position:8.3f}{us.rotation:8.3f}"
    print(f"{columns} | OpenCV {them.position:8.3f}{them.rotation:8.3f}", flush=True)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--views", type=int, default=6)
    parser.add_argument("--samples", type=int, default=64, help="paths of a pixel")
    parser.add_argument("--lamp", type=float, default=0.03, help="its radius [m]")
    parser.add_argument("--keep", type=Path, help="folder for the pictures")
    arguments = parser.parse_args()
    try:
        import bpy
    except ImportError:
        sys.exit("Blender is not installed: pip install burg-drake[blender]")
    camera = CAMERAS[SIZE]
    camera = Camera(camera.size, camera.focal[:1] * 2, camera.center)  # Blender's pixels are square
    studio = Studio(bpy, sheet(BOARD, "A2", AS_MEANT, 0), arguments.lamp, arguments.samples)
    scene = burg.load_scene("tabletop_six")
    intrinsics = burg.cameras.Intrinsics(
        width=camera.size[0], height=camera.size[1], focal=camera.focal, center=camera.center
    )
    errors: list[tuple[float, float]] = []
    found = 0
    with tempfile.TemporaryDirectory() as folder:
        for k in range(arguments.views):
            rng = np.random.default_rng([1, k])
            direction = rng.uniform(-np.pi, np.pi)
            target = np.array(BOARD.size) / 2
            X_SC = look_at(
                target, rng.uniform(0.6, 0.9), np.radians(rng.uniform(20, 50)), direction, 0.0
            )
            things = displaced(arranged("tabletop_six"), rng)
            light = studio.render(camera, X_SC, list(things.values()), Path(folder) / "view.exr")
            image = image_of(light, float(np.quantile(light, 0.95)), WEBCAM, rng)
            if arguments.keep:
                arguments.keep.mkdir(parents=True, exist_ok=True)
                cv2.imwrite(str(arguments.keep / f"view_{k}.png"), image[..., ::-1])
            us, them = ours(image, camera, X_SC), opencv(image, camera, X_SC)
            _printed(k, us, them)
            check = burg.cameras.check_placement(scene, image, intrinsics)
            for name, placement in check.instances.items():
                if placement.status != "measured":
                    print(f"      {name:10} {placement.status}: {placement.reason}")
                    continue
                true = trimesh.transform_points([placement.reference], things[name].X_SO)
                meant = trimesh.transform_points([placement.reference], placement.target.matrix())
                off = np.array(placement.displacement) - (true - meant)[0, :2]
                sd = float(np.linalg.norm(placement.displacement_sd))
                errors.append((1e3 * float(np.linalg.norm(off)), float(np.linalg.norm(off)) / sd))
                print(f"      {name:10} {errors[-1][0]:6.2f} mm, {errors[-1][1]:5.1f} sd")
                found += 1
    off, over = np.array(errors).reshape(-1, 2).T
    if found:
        print(
            f"{found} of {len(scene.instances) * arguments.views} objects measured:"
            f" {np.median(off):.2f} mm median, {off.max():.2f} at most;"
            f" {np.median(over):.1f} sd median, {over.max():.1f} at most"
        )


if __name__ == "__main__":
    main()
