"""Renders with Blender. This is the program of the process that `blender_process` starts."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
from pathlib import Path
from typing import Any


class LoadedScene:
    """Blender's scene, with bodies and a camera that move.

    Args:
        bpy: Blender's Python module.
        folder: folder with the description of the scene.
    """

    def __init__(self, bpy: Any, folder: Path) -> None:
        import numpy as np

        self._bpy = bpy
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self._scene = bpy.context.scene
        description = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
        self._set_renderer(description["samples"], description["threads"])
        self._bodies: dict[str, list[Any]] = {}
        with np.load(folder / "meshes.npz", allow_pickle=False) as arrays:
            for k, part in enumerate(description["parts"]):
                material = self._make_material(part["material"], folder)
                placed = self._add_mesh(f"part_{k}", arrays, material)
                self._bodies.setdefault(part["body"], []).append(placed)
        self._camera = self._add_object("camera", bpy.data.cameras.new("camera"))
        self._scene.camera = self._camera
        for lamp in description["lamps"]:
            self._add_lamp(lamp)
        self._set_world(description["environment"], folder)

    def render(self, task: dict[str, Any]) -> None:
        """Writes one image."""
        for body, pose in task["poses"].items():
            for placed in self._bodies.get(body, ()):
                placed.matrix_world = matrix_columns(pose)
        looking = [[x, -y, -z, p] for x, y, z, p in task["X_WC"]]  # along -z, with y up
        self._camera.matrix_world = matrix_columns(looking)
        self._set_lens(task)
        self._scene.render.filepath = task["output"]
        self._bpy.ops.render.render(write_still=True)

    def _set_lens(self, task: dict[str, Any]) -> None:
        """Blender has one focal length and pixels of any shape, its principal point is counted from
        the image's middle, in widths of the image."""
        sensor_width = 36.0  # Millimetres; only the ratio to the focal length matters.
        render, lens = self._scene.render, self._camera.data
        width, height = task["width"], task["height"]
        (fx, fy), (cx, cy) = task["focal"], task["center"]
        render.resolution_x, render.resolution_y = width, height
        render.pixel_aspect_x, render.pixel_aspect_y = max(1.0, fy / fx), max(1.0, fx / fy)
        lens.sensor_fit, lens.sensor_width = "HORIZONTAL", sensor_width
        lens.lens = fx * sensor_width / width
        lens.shift_x = ((width - 1) / 2 - cx) / width
        lens.shift_y = (cy - (height - 1) / 2) / width * fx / fy
        lens.clip_start, lens.clip_end = task["clip"]

    def _set_renderer(self, samples: int, threads: int) -> None:
        scene = self._scene
        render, cycles = scene.render, scene.cycles
        render.engine, cycles.device = "CYCLES", "CPU"
        render.resolution_percentage = 100
        render.film_transparent, render.use_persistent_data = True, True
        render.threads_mode, render.threads = ("FIXED", threads) if threads else ("AUTO", 1)
        render.dither_intensity = 0.0
        render.image_settings.file_format = "PNG"
        render.image_settings.color_mode = "RGBA"
        render.image_settings.compression = 0
        scene.view_settings.view_transform = "Standard"
        cycles.samples, cycles.seed = samples, 0
        cycles.use_adaptive_sampling = False
        cycles.pixel_filter_type = "BOX"  # a pixel collects the light that falls on it
        cycles.filter_width = 1.0
        cycles.max_bounces = 4
        cycles.caustics_reflective = cycles.caustics_refractive = False
        cycles.use_light_tree = False  # pays only with many lights
        cycles.use_denoising = samples > 1
        cycles.denoiser, cycles.denoising_prefilter = "OPENIMAGEDENOISE", "FAST"
        cycles.denoising_use_gpu = False

    def _add_object(self, name: str, data: Any) -> Any:
        placed = self._bpy.data.objects.new(name, data)
        self._scene.collection.objects.link(placed)
        return placed

    def _add_mesh(self, name: str, arrays: Any, material: Any) -> Any:
        mesh = self._bpy.data.meshes.new(name)
        faces = arrays[f"{name}.faces"]
        mesh.from_pydata(arrays[f"{name}.vertices"], (), faces)
        if f"{name}.uv" in arrays:
            layer = mesh.uv_layers.new()
            layer.data.foreach_set("uv", arrays[f"{name}.uv"][faces].ravel())
        mesh.shade_smooth()
        if f"{name}.normals" in arrays:
            mesh.normals_split_custom_set_from_vertices(arrays[f"{name}.normals"])
        else:
            mesh.set_sharp_from_angle(angle=math.radians(30.0))
        mesh.materials.append(material)
        return self._add_object(name, mesh)

    def _make_material(self, description: dict[str, Any], folder: Path) -> Any:
        material = self._bpy.data.materials.new("material")
        material.use_nodes = True
        nodes, links = material.node_tree.nodes, material.node_tree.links
        shader = nodes["Principled BSDF"].inputs
        *color, opacity = description["color"]
        shader["Base Color"].default_value = (*color, 1.0)
        shader["Alpha"].default_value = opacity
        shader["Metallic"].default_value = description["metallic"]
        shader["Roughness"].default_value = description["roughness"]
        if description["texture"]:
            image = nodes.new("ShaderNodeTexImage")
            image.image = self._load_image(folder / description["texture"])
            tinted = nodes.new("ShaderNodeVectorMath")
            tinted.operation = "MULTIPLY"
            tinted.inputs[1].default_value = color
            links.new(image.outputs["Color"], tinted.inputs[0])
            links.new(tinted.outputs[0], shader["Base Color"])
        return material

    def _add_lamp(self, description: dict[str, Any]) -> None:
        lamp = self._bpy.data.lights.new("lamp", "SUN")
        lamp.energy, lamp.color = description["irradiance"], description["color"]
        lamp.angle, lamp.use_shadow = description["angle"], description["shadows"]
        placed = self._add_object("lamp", lamp)
        x, y, z = description["direction"]
        if description["frame"] == "camera":
            placed.parent = self._camera
            y, z = -y, -z
        # It shines along its own -z, which is turned down from the zenith and then around it.
        placed.rotation_euler = (0.0, math.atan2(math.hypot(x, y), -z), math.atan2(-y, -x))

    def _set_world(self, file: str, folder: Path) -> None:
        world = self._bpy.data.worlds.new("world")
        self._scene.world = world
        world.use_nodes = True
        tree = world.node_tree
        background = tree.nodes["Background"]
        background.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        background.inputs["Strength"].default_value = 1.0
        if file:
            environment = tree.nodes.new("ShaderNodeTexEnvironment")
            environment.image = self._load_image(folder / file)
            tree.links.new(environment.outputs["Color"], background.inputs["Color"])

    def _load_image(self, path: Path) -> Any:
        image = self._bpy.data.images.load(str(path), check_existing=True)
        if not image.packed_file:
            image.pack()
        return image


def matrix_columns(rows: list[list[float]]) -> list[tuple[float, ...]]:
    """A matrix as the list of columns that Blender expects."""
    return list(zip(*rows, strict=True))


def main() -> None:
    """Answers requests from standard input until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process handles interrupts
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def answer(**values: str) -> None:
        print(json.dumps(values), file=answers, flush=True)

    try:
        import bpy
    except ImportError as error:
        answer(missing=str(error))
        return
    answer(version=bpy.app.version_string)
    scene = None
    for line in sys.stdin:
        task = json.loads(line)
        try:
            if task["do"] == "load":
                scene = None
                scene = LoadedScene(bpy, Path(task["folder"]))
            elif scene is not None:
                scene.render(task)
            answer()
        except Exception as error:
            answer(error=f"{type(error).__name__}: {error}")


if __name__ == "__main__":
    main()
