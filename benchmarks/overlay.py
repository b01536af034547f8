"""CPU time and accuracy of the overlay of a scene over a camera's image.

    python benchmarks/overlay.py [--scans FOLDER] [--size 640x480 ...]

Time: process time of `Overlay.draw`, of one thread, over views around the board; nothing is kept
from frame to frame. Accuracy: where the label of a ray changes between two pixels, the border is
found to 1/1000 pixel by halving, with no other part of the overlay's code; compared with it are the
projected outline, and the middle of the line that was drawn, as it lies in the image. FOLDER has
meshes in metres (.obj) that make a second scene, such as scans.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from burg_drake.core import SINGLE_THREAD_ENVIRONMENT, Array, Bytes

os.environ.update(SINGLE_THREAD_ENVIRONMENT)

import cv2
import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

import burg_drake as burg
from burg_drake.cameras import (
    OUTLINE_KIND,
    FieldOfView,
    Intrinsics,
    Overlay,
    OverlayStyle,
    SceneMesh,
    build_scene_mesh,
    instance_labels,
    visible_lines,
)
from burg_drake.core import Pose, make_pose
from burg_drake.pipeline import ObjectSource
from burg_drake.scene import Instance, Scene, SceneDocument

LENS = (-0.25, 0.08, 0.0004, -0.0003, 0.0)
"""Distortion of a webcam's wide lens: 20 pixels in the corners of 640 x 480."""
REACH = 2.5
"""To both sides of a border, how far the drawn line is looked for [pixels]."""
NEAREST = 4.0
"""Borders nearer to another one than this have two lines, whose middles run into each other; they
count for the projected outline, not for the drawn line [pixels]."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=Path, help="folder of meshes in metres")
    parser.add_argument("--size", nargs="+", default=["640x480", "1280x720"])
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    scenes = [burg.load_scene("tabletop_six")]
    with tempfile.TemporaryDirectory() as folder:
        if arguments.scans:
            scenes.append(scan_scene(arguments.scans, Path(folder)))
        for scene in scenes:
            faces = len(build_scene_mesh(scene).outline.faces)
            print(f"\n{scene.name}: {len(scene.instances)} objects, {faces} faces")
            for size in arguments.size:
                width, height = map(int, size.split("x"))
                for distortion in ((), LENS):
                    report(scene, camera(width, height, distortion))


def report(scene: Scene, intrinsics: Intrinsics) -> None:
    """A row: times and errors over all views."""
    overlay = Overlay(scene, intrinsics)
    image = np.full((intrinsics.height, intrinsics.width, 3), 200, np.uint8)
    overlay.draw(image, views()[0])
    times = [min(timed(overlay, image, X_SC) for _ in range(5)) for X_SC in views()]
    shape, projected, drawn = build_scene_mesh(scene), [], []
    for X_SC in views():
        points, normals, alone = borders(scene, shape, intrinsics, X_SC)
        lines = visible_lines(shape, FieldOfView(intrinsics), X_SC)
        projected.append(distances(points, lines.ends[lines.kind == OUTLINE_KIND]))
        drawn.append(np.abs(line_middles(overlay, X_SC, points[alone], normals[alone])))
    lens = "lens" if intrinsics.distortion else "pinhole"
    print(
        f"{intrinsics.width:5} x {intrinsics.height:<5}{lens:8}"
        f"draw {1e3 * np.median(times):5.1f} ms, most {1e3 * max(times):5.1f}"
        f"   outline {spread(projected)}   drawn line {spread(drawn)}"
    )


def spread(errors: list[Array]) -> str:
    """Of distances [pixels]."""
    values = np.concatenate(errors)
    q = np.percentile(values, [50, 95, 99])
    return f"{q[0]:.3f} px, 95 % {q[1]:.3f}, 99 % {q[2]:.3f} ({len(values)})"


def timed(overlay: Overlay, image: Bytes, X_SC: Array) -> float:
    """CPU seconds of one frame."""
    start = time.process_time()
    overlay.draw(image, X_SC)
    return time.process_time() - start


def camera(width: int, height: int, distortion: tuple[float, ...]) -> Intrinsics:
    """One of 56 degrees."""
    focal = (width * 600 / 640,) * 2
    center = ((width - 1) / 2 + 3.3, (height - 1) / 2 - 2.6)
    return Intrinsics(width=width, height=height, focal=focal, center=center, distortion=distortion)


def views() -> list[Array]:
    """Poses of cameras around the board, which look at its middle from 0.5 to 0.8 m."""
    target = np.array([0.297, 0.21, 0.03])
    poses = []
    for k in range(6):
        turn, height = 2.0 * np.pi * k / 6 + 0.3, np.deg2rad(35.0 + 9.0 * k)
        away = np.array([np.cos(turn) * np.cos(height), np.sin(turn) * np.cos(height), 0.0])
        z = -(away + np.array([0.0, 0.0, np.sin(height)]))
        x = np.cross(z, (0.0, 0.0, 1.0))
        x /= np.linalg.norm(x)
        R_SC = np.stack([x, np.cross(z, x), z], axis=1)
        poses.append(make_pose(R_SC, target - (0.5 + 0.06 * k) * z))
    return poses


def borders(
    scene: Scene, shape: SceneMesh, intrinsics: Intrinsics, X_SC: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Points (N, 2) where one pixel shows another instance than its neighbour, found by rays; unit
    normals (N, 2) of the border; and whether (N,) no other border is near."""
    labels = instance_labels(scene, intrinsics, X_SC)
    points = []
    for axis in (0, 1):
        pairs = np.argwhere(np.diff(labels, axis=axis) != 0)
        step = np.array([0, 1]) if axis == 0 else np.array([1, 0])
        low = pairs[:, ::-1].astype(float)
        high = low + step
        first = cast(shape, intrinsics, X_SC, low)
        for _ in range(10):
            middle = (low + high) / 2
            same = (cast(shape, intrinsics, X_SC, middle) == first)[:, None]
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        points.append((low + high) / 2)
    found = np.concatenate(points)
    apart = np.linalg.norm(found[:, None] - found[None], axis=2)
    normals, alone = np.zeros((len(found), 2)), np.zeros(len(found), bool)
    for i, row in enumerate(apart):
        near = found[row < NEAREST] - found[i]
        values, vectors = np.linalg.eigh(near.T @ near)
        normals[i] = vectors[:, 0]
        alone[i] = values[0] < 0.01 * len(near)  # all on one line
    inner = visible_lines(shape, FieldOfView(intrinsics), X_SC)
    others = inner.ends[inner.kind != OUTLINE_KIND].mean(axis=1)
    if len(others):
        alone &= np.linalg.norm(found[:, None] - others[None], axis=2).min(axis=1) > NEAREST
    edge = (found > NEAREST) & (found < np.array(labels.shape)[::-1] - 1 - NEAREST)
    return np.asarray(found), normals, alone & edge.all(axis=1)


def cast(shape: SceneMesh, intrinsics: Intrinsics, X_SC: Array, pixels: Array) -> Array:
    """(N,) number of the instance that a point of the image shows, -1 for none."""
    flat = (intrinsics.undistort(pixels) - intrinsics.center) / intrinsics.focal
    rays = np.column_stack([flat, np.ones(len(flat))]) @ X_SC[:3, :3].T
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    face, _ = shape.rays.first_hits(np.broadcast_to(X_SC[:3, 3], rays.shape), rays)
    return np.where(face < 0, -1, shape.owner[face])


def distances(points: Array, ends: Array) -> Array:
    """(N,) from points to the nearest of lines (M, 2, 2)."""
    a, e = ends[:, 0], ends[:, 1] - ends[:, 0]
    square = np.maximum((e**2).sum(axis=1), 1e-12)
    nearest = np.empty(len(points))
    for i, p in enumerate(points):
        along = np.clip(((p - a) * e).sum(axis=1) / square, 0.0, 1.0)
        nearest[i] = np.linalg.norm(p - a - along[:, None] * e, axis=1).min()
    return nearest


def line_middles(overlay: Overlay, X_SC: Array, points: Array, normals: Array) -> Array:
    """(N,) how far across the border the middle of the drawn line lies [pixels].

    The image is white, so that most of what is seen of a line is its dark rim, which lies evenly on
    both sides of its middle.
    """
    style = OverlayStyle(opacity=0.0, names=False, footprints=False)
    blank = np.full((overlay.intrinsics.height, overlay.intrinsics.width, 3), 255, np.uint8)
    ink = 255.0 - overlay.draw(blank, X_SC, style=style).min(axis=2)
    offset = np.linspace(-REACH, REACH, 101)
    at = points[:, None] + offset[None, :, None] * normals[:, None]
    profile = map_coordinates(ink, [at[..., 1], at[..., 0]], order=1)
    return (profile * offset).sum(axis=1) / profile.sum(axis=1)


def scan_scene(folder: Path, scratch: Path) -> Scene:
    """Six of the meshes of a folder on the board; their surfaces alone matter."""
    box = trimesh.creation.box((0.05, 0.06, 0.07))
    meshes = sorted(folder.glob("*.obj"))[:6]
    sources = [ObjectSource(name=p.stem, mesh=p, pieces=(box,), mass=0.1) for p in meshes]
    library = burg.build_library(sources, scratch, confirm=False).library
    instances = []
    for i, path in enumerate(meshes):
        lower, upper = (np.array(getattr(library.entry(path.stem), k)) for k in ("lower", "upper"))
        place = np.array([0.12 + 0.18 * (i % 3), 0.11 + 0.19 * (i // 3), 0.0])
        place[:2] -= (lower + upper)[:2] / 2
        place[2] = -lower[2]
        instances.append(Instance(object=path.stem, X_SO=Pose(tuple(place))))
    document = SceneDocument(name="scans", library=str(scratch), instances=tuple(instances))
    return replace(burg.load_scene("tabletop_six"), document=document, library=library)


if __name__ == "__main__":
    main()
