"""What tests of Blender give it: a camera, surfaces and lamps."""

from __future__ import annotations

import numpy as np
import trimesh

from burg_drake.cameras import Intrinsics
from burg_drake.core import make_pose
from burg_drake.dataset import Blender, BlenderScene, Lamp, Material, PaintedSurface

CAMERA = Intrinsics(width=160, height=120, focal=(210.0, 170.0), center=(61.3, 70.8))
"""With pixels that are not square, and an axis that is not in the middle."""
DOWN = make_pose(np.diag([1.0, -1.0, -1.0]), (0.0, 0.0, 0.6))
"""A camera above the origin that looks down."""
WHITE_CHALK = Material(color=(1.0, 1.0, 1.0, 1.0), roughness=1.0)


def surface(mesh: trimesh.Trimesh, material: Material) -> PaintedSurface:
    return PaintedSurface("0", np.asarray(mesh.vertices), np.asarray(mesh.faces), material)


def lamp(direction: tuple[float, float, float], **options: object) -> Lamp:
    settings = {"frame": "world", "irradiance": np.pi, "color": (1.0, 1.0, 1.0)}
    return Lamp(**({"direction": direction, "shadows": True, "angle": 0.0} | settings | options))


def image_of(
    process: Blender, scene: BlenderScene, X_WC: np.ndarray = DOWN, camera: Intrinsics = CAMERA
) -> np.ndarray:
    return process.image(scene, {"0": np.eye(4)}, camera, X_WC, (0.01, 10.0))
