"""Time of clouds, signed distances and grasps that are made of images and scenes as labels.

    python benchmarks/dataset_labels.py [--scene SCENE] [--rounds N]

Depth images are of a camera with 640 x 480 pixels that looks at the table from above, by formula;
lengths of time do not depend on what is seen. The true distances are those of the scene's meshes.
Of several rounds the fastest one counts, after one that does not: machines are shared.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from burg_drake.cameras import Intrinsics
from burg_drake.core import inverse, make_pose
from burg_drake.dataset import (
    LabelledGrasps,
    depth_cloud,
    exact_tsdf,
    fuse_tsdf,
    grasp_rectangles,
    surface_cloud,
    volume_grasps,
)
from burg_drake.scene import load_scene

CAMERA = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5))
LENS = replace(CAMERA, distortion=(-0.1, 0.02, 1e-4, 1e-4))
HEIGHT = 0.6
VIEWS = 5
GRASPS = 1000


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scene", default="tabletop_six")
    parser.add_argument("--rounds", type=int, default=10)
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene)
    places = [scene.X_SO(name)[:3, 3] for name in scene.instances]
    x, y, _ = np.mean(places, axis=0)
    X_SC = make_pose(np.diag([1.0, -1.0, -1.0]), (x, y, HEIGHT))
    X_SV = make_pose(p_AB=(x - 0.15, y - 0.15, -0.05))
    depth = np.full((480, 640), HEIGHT, np.float32)
    color, labels = np.zeros((480, 640, 3), np.uint8), np.zeros((480, 640), np.uint16)
    depths, poses = [depth] * VIEWS, np.stack([X_SC] * VIEWS)
    rng = np.random.default_rng(0)
    X_CG = make_pose(p_AB=rng.uniform((-0.1, -0.1, 0.5), (0.1, 0.1, 0.6), (GRASPS, 3)))
    grasps = LabelledGrasps(
        X_CG, np.full(GRASPS, 0.05), np.ones(GRASPS, np.uint16), np.full(GRASPS, "lifted"), {}
    )

    def shown(what: str, call: Callable[[], object], share: int = 1, rounds: int = 0) -> None:
        took = fastest(call, rounds or arguments.rounds) / share
        print(f"{took:10.2f} ms  {what}")

    shown("cloud of 640 x 480", lambda: depth_cloud(depth, CAMERA))
    shown("with colours and labels", lambda: depth_cloud(depth, CAMERA, color=color, labels=labels))
    shown("of a lens, after its first image", lambda: depth_cloud(depth, LENS))
    shown("fused view at 40^3", lambda: fuse_tsdf(depths, CAMERA, poses, X_SV), VIEWS)
    shown("of a lens", lambda: fuse_tsdf(depths, LENS, poses, X_SV), VIEWS)
    shown(f"rectangles of {GRASPS} grasps", lambda: grasp_rectangles(grasps, CAMERA))
    shown(f"voxels of {GRASPS} grasps", lambda: volume_grasps(grasps, inverse(X_SC) @ X_SV))
    shown("1000 points on each object", lambda: surface_cloud(scene, rng, per_object=1000))
    shown("true distances at 40^3", lambda: exact_tsdf(scene, X_SV), rounds=1)


def fastest(call: Callable[[], object], rounds: int) -> float:
    """Wall time of the fastest of some calls [ms]."""
    call()
    times = []
    for _ in range(rounds):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


if __name__ == "__main__":
    main()
