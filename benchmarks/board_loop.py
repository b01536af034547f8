"""What simulated images leave of the board's pose, by the number of rays a pixel.

    python benchmarks/board_loop.py [--views 30]

Views of the board from 0.5 to 1 m and 40 to 85 degrees above it, empty and with six objects,
through `build_board_loop`. Error: of the estimate against where the camera is. Time: process time
of rendering one image, and of the estimate from it, of one thread.
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import replace

from burg_drake.core import SINGLE_THREAD_ENVIRONMENT, Array

os.environ.update(SINGLE_THREAD_ENVIRONMENT)

import cv2
import numpy as np
from pydrake.systems.framework import Context

import burg_drake as burg
from burg_drake.cameras import BoardLoop, LoopCamera, build_board_loop
from burg_drake.core import Pose, inverse, make_pose, rotation_angle
from burg_drake.station import Camera

CAMERAS = {
    "640x480": Camera(X_WC=Pose(), width=640, height=480, focal=(600.0, 600.0)),
    "1280x720": Camera(X_WC=Pose(), width=1280, height=720, focal=(1000.0, 1000.0)),
}


def main() -> None:
    """Prints a row a camera, scene and number of rays."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=30)
    views = poses(parser.parse_args().views)
    cv2.setNumThreads(1)
    full, station = burg.load_scene("tabletop_six"), burg.load_station("panda_tabletop")
    scenes = {"empty": replace(full, document=replace(full.document, instances=())), "six": full}
    print("camera    scene  rays  valid  median mm   deg  worst mm  render ms  estimate ms")
    for size, camera in CAMERAS.items():
        document = replace(station.document, cameras={"board": camera})
        for name, scene in scenes.items():
            for samples in (1, 2, 3):
                loop = build_board_loop(
                    scene, replace(station, document=document), LoopCamera(samples=samples)
                )
                context = loop.diagram.CreateDefaultContext()
                found = np.array([look(loop, context, X_SC) for X_SC in views])
                valid = found[:, 0] < np.inf
                mm, degrees, render, estimate = np.median(found[valid], axis=0)
                print(
                    f"{size:9} {name:6} {samples}x{samples} {valid.sum():4d}/{len(views)}"
                    f" {mm:10.3f} {degrees:6.4f} {found[valid, 0].max():8.2f}"
                    f" {render:10.0f} {estimate:10.1f}"
                )


def poses(number: int) -> list[Array]:
    """`X_SC` of cameras that look at points near the board's middle, turned about their axes."""
    rng = np.random.default_rng(1)
    found = []
    for _ in range(number):
        target = np.array([*rng.uniform([0.217, 0.13], [0.377, 0.29]), 0.0])
        elevation, azimuth = np.deg2rad(rng.uniform(40, 85)), rng.uniform(0, 2 * np.pi)
        level = np.cos(elevation)
        back = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
        right = np.cross([0.0, 0.0, 1.0], back) / level
        upright = np.stack([right, np.cross(-back, right), -back], axis=1)
        c, s = np.cos(roll := rng.uniform(-3, 3)), np.sin(roll)
        turned = upright @ [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
        found.append(make_pose(turned, target + rng.uniform(0.5, 1.0) * back))
    return found


def look(loop: BoardLoop, context: Context, X_SC: Array) -> tuple[float, float, float, float]:
    """Errors [mm, degrees] and times to render and to estimate [ms]; inf without a pose."""
    loop.place_camera(context, X_SC)
    times = [time.process_time()]
    for port in ("camera.board.color_image", "board.estimate"):
        value = loop.diagram.GetOutputPort(port).Eval(context)
        times.append(time.process_time())
    render, estimate = 1e3 * np.diff(times)
    if not value.valid:
        return np.inf, np.inf, render, estimate
    X_CD = inverse(X_SC) @ value.X_SC
    error = 1e3 * float(np.linalg.norm(X_CD[:3, 3]))
    return error, float(np.rad2deg(rotation_angle(X_CD[:3, :3]))), render, estimate


if __name__ == "__main__":
    main()
