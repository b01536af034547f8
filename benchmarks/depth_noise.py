"""How long depth noise takes on an image of 640 x 480 pixels, and whether it is what it should be.

    python benchmarks/depth_noise.py [--images 50]

The scene: a slanted table, eight boxes and a sphere, in closed form, with normals and colours. A
row is a camera: process time of one image with normals at hand and without, of one thread, and how
many pixels lose their depth. Then an image of each camera's noise alone: the standard
deviation of a frontal wall at 0.8 m beside the formula's, and how far its mean is off.

The end is an error if an image takes longer than 15 ms (20 ms without normals), or a deviation is
off by more than 2 %.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import replace

from burg_drake.core.arrays import Array, Bytes, Single
from burg_drake.core.workers.processes import ONE_THREAD

os.environ.update(ONE_THREAD)

import cv2
import numpy as np

from burg_drake.cameras.noise.document import NOISES, DepthNoise
from burg_drake.cameras.noise.measurement import noisy_depth
from burg_drake.cameras.optics.intrinsics import Intrinsics

CAMERA = Intrinsics(width=640, height=480, focal=(600.0, 600.0), center=(319.5, 239.5))
LONGEST, LONGEST_WITHOUT = 15.0, 20.0
"""Of an image with normals at hand and without [ms]."""
WALL = 0.8
"""Depth of the wall [m]."""


def main() -> int:
    """Prints a row a camera; 1 if a time or a deviation is not as it should be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=50)
    images = parser.parse_args().images
    cv2.setNumThreads(1)
    depth, normals, color = scene()
    wrong = []
    print("camera         ms  without normals  lost %  sigma mm  formula mm  mean mm")
    for name, noise in NOISES.items():
        with_normals = milliseconds(images, depth, noise, normals, color)
        without = milliseconds(images, depth, noise, None, color)
        measured = noisy_depth(
            depth, noise, CAMERA, np.random.default_rng(0), normals=normals, color=color
        )
        sigma, mean, formula = deviation(noise)
        print(
            f"{name:13} {with_normals:5.1f} {without:16.1f} {100 * (measured == 0.0).mean():7.2f}"
            f" {1e3 * sigma:9.3f} {1e3 * formula:11.3f} {1e3 * mean:8.3f}"
        )
        if with_normals > LONGEST or without > LONGEST_WITHOUT:
            wrong.append(f"{name} takes longer than {LONGEST:g} or {LONGEST_WITHOUT:g} ms")
        if abs(sigma - formula) > 0.02 * formula:
            wrong.append(f"{name} has another deviation than its formula")
    print("\n".join(wrong) or "all as it should be")
    return bool(wrong)


def milliseconds(
    images: int, depth: Single, noise: DepthNoise, normals: Single | None, color: Bytes
) -> float:
    """Least process time of an image, as others may use the machine [ms]."""
    taken = []
    for seed in range(images):
        rng = np.random.default_rng(seed)
        start = time.process_time()
        noisy_depth(depth, noise, CAMERA, rng, normals=normals, color=color)
        taken.append(1e3 * (time.process_time() - start))
    return min(taken)


def deviation(noise: DepthNoise) -> tuple[float, float, float]:
    """Standard deviation and mean error on a wall, without steps, and what the formulas say [m]."""
    smooth = replace(noise, disparity_step=0.0, depth_step=0.0, second_view="none")
    wall = np.full((CAMERA.height, CAMERA.width), WALL, dtype=np.float32)
    errors = noisy_depth(wall, smooth, CAMERA, np.random.default_rng(1)).astype(float) - WALL
    axial = noise.axial_base + noise.axial_square * (WALL - noise.axial_center) ** 2
    stereo = 0.0
    if noise.disparity_sigma:
        stereo = WALL**2 * noise.disparity_sigma / (CAMERA.focal[0] * noise.baseline)
    return float(errors.std()), float(errors.mean()), float(np.hypot(axial, stereo))


def scene() -> tuple[Single, Single, Bytes]:
    """Depth, normals and colours (H, W) of a table 45 degrees aslant, boxes and a sphere."""
    rows, columns = np.mgrid[: CAMERA.height, : CAMERA.width]
    rays = np.stack([(columns - 319.5) / 600.0, (rows - 239.5) / 600.0, np.ones_like(rows)], -1)
    up = np.array([0.0, -1.0, -1.0]) / np.sqrt(2.0)
    depth = -0.7 / (rays @ up) / np.sqrt(2.0)
    normals = np.broadcast_to(up, rays.shape).copy()
    color = np.full(rays.shape, 160, dtype=np.uint8)
    for k in range(8):
        left, top = 60 + 140 * (k % 4), 90 + 190 * (k // 4)
        inside = (columns >= left) & (columns < left + 90) & (rows >= top) & (rows < top + 110)
        depth[inside] = depth[top + 109, left] - 0.04
        normals[inside] = [0.0, 0.0, -1.0]
        color[inside] = 30 * k
    add_sphere(depth, normals, rays)
    return depth.astype(np.float32), normals.astype(np.float32), color


def add_sphere(depth: Array, normals: Array, rays: Array) -> None:
    """A ball of 6 cm radius, 0.45 m before the camera."""
    center, radius = np.array([0.0, 0.02, 0.45]), 0.06
    along = rays @ center
    lengths = (rays**2).sum(-1)
    root = along**2 - lengths * (center @ center - radius**2)
    z = (along - np.sqrt(np.maximum(root, 0.0))) / lengths
    nearer = (root > 0.0) & (z < depth)
    depth[nearer] = z[nearer]
    normals[nearer] = (rays[nearer] * z[nearer, None] - center) / radius


if __name__ == "__main__":
    sys.exit(main())
