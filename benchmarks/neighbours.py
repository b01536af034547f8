"""Motion of a cube that a falling bar meets: engines against a rigid model of two boxes.

    python benchmarks/neighbours.py [--engine NAME ...]

The bar (30 x 300 x 40 mm, 0.2 kg) stands on its end, 8 degrees off the vertical, at some distance
[mm] from a cube (50 mm, 0.1 kg), and falls on it; or it is dropped across the cube from 20 to
200 mm. Figures are the motion of the cube's farthest point [mm]. `oracle.two_boxes` shares no code
with the engines; `bouncy` is it with a coefficient of restitution of 0.2.
"""

from __future__ import annotations

import argparse
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from mixed_grasps import hand_only
from oracle.two_boxes import TwoBoxes, farthest, simulate

import burg_drake as burg
from burg_drake.core import Array, Pose, grasp_from_axes
from burg_drake.objects import load_library
from burg_drake.pipeline import ObjectSource, build_library
from burg_drake.scene import Instance, Scene, SceneDocument
from burg_drake.simulation import HandTrial, MotionTracker, MujocoTrial, hand_trial_of
from burg_drake.station import ENGINES

BAR, BLOCK = (0.03, 0.30, 0.04), (0.05, 0.05, 0.05)
"""Sizes [m]."""
MASSES = (0.2, 0.1)
TILT, TIME = math.radians(8.0), 1.2
DISTANCES = (0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.10, 0.13, 0.16, 0.20)
DROPS = 11


@dataclass(frozen=True)
class Fall:
    """Start of a bar in the plane of the fall.

    Attributes:
        name: what is printed.
        x, z: middle of the bar, from the point of the table below the cube's middle [m].
        angle: slope of the bar [rad].
    """

    name: str
    x: float
    z: float
    angle: float


def falls() -> list[Fall]:
    """Bars that stand tilted beside the cube, and bars that are dropped across it."""
    found = []
    length, width = BAR[1] / 2, BAR[2] / 2
    angle = math.pi / 2.0 - TILT
    for distance in DISTANCES:
        x = length * math.cos(angle) - width * math.sin(angle) - BLOCK[1] / 2 - distance
        z = length * math.sin(angle) + width * math.cos(angle)
        found.append(Fall(f"stands at {1e3 * distance:.0f}", x, z, angle))
    rng = np.random.default_rng(5)
    for k in range(DROPS):
        offset, height = rng.uniform(-0.16, 0.16), rng.uniform(0.02, 0.2)
        angle = math.radians(rng.uniform(-30.0, 30.0))
        z = BLOCK[2] + height + length * abs(math.sin(angle)) + width * math.cos(angle)
        found.append(Fall(f"dropped {k + 1}", offset - width * math.sin(angle), z, angle))
    return found


def expected(fall: Fall, friction: float, table: float, restitution: float = 0.0) -> float:
    """Motion of the cube in the rigid model [mm]."""
    on_table = 2.0 * friction * table / (friction + table)
    half = np.array([[BAR[1] / 2, BAR[2] / 2], [BLOCK[1] / 2, BLOCK[2] / 2]])
    boxes = TwoBoxes(half, np.array(MASSES), np.array([on_table, on_table, friction]))
    start = np.array([(fall.x, fall.z, fall.angle), (0.0, half[1, 1], 0.0)])
    poses = simulate(boxes, start, np.zeros((2, 3)), TIME, restitution=restitution)
    return 1e3 * farthest(half[1], start[1], poses[:, 1])


def simulated(scene: Scene, engine: str) -> float:
    """Motion of the cube in an engine [mm]; the hand is far away."""
    trial = hand_trial_of(scene, hand_only(burg.load_station("panda_tabletop")), engine, lock=False)
    far: Array = grasp_from_axes((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.9, 0.9, 0.9))
    world = trial.complete_world
    if isinstance(trial, HandTrial):
        trial.begin("bar", far)
    elif isinstance(trial, MujocoTrial):
        up = np.array([0.0, 0.0, 1.0])
        trial.complete_world.prepare("bar", far, None, up, friction=None, mass=None)
    tracker = MotionTracker(world, [world.free["block"]])
    for _ in range(round(TIME / 0.01)):
        world.advance(round(0.01 / world.engine.time_step))
        tracker.update(set())
    return 1e3 * tracker.farthest[world.free["block"]]


def make_scene(folder: Path, fall: Fall) -> Scene:
    """The bar and the cube; the bar's origin is in the middle of its lower face."""
    y = 0.2 + fall.x + BAR[2] / 2 * math.sin(fall.angle)
    z = fall.z - BAR[2] / 2 * math.cos(fall.angle)
    slope = (math.degrees(fall.angle), 0.0, 0.0)
    bar = Instance(object="bar", X_SO=Pose((0.3, y, z), rpy_deg=slope))
    block = Instance(object="block", X_SO=Pose((0.3, 0.2, 0.0)))
    document = SceneDocument(name="fall", library=str(folder), instances=(block, bar))
    return Scene(document, load_library(str(folder)), folder / "scene.yaml")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument(
        "--engine", nargs="+", default=["standard", "reference", "mujoco"], choices=ENGINES
    )
    engines = parser.parse_args().engine
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        sources = []
        for label, size, mass in (("bar", BAR, MASSES[0]), ("block", BLOCK, MASSES[1])):
            mesh = trimesh.creation.box(size).apply_translation((0.0, 0.0, size[2] / 2))
            sources.append(ObjectSource(name=label, mesh=mesh, mass=mass))
        build_library(sources, folder, confirm=False)
        print("bar", "rigid", "bouncy", *engines, sep="\t")
        table = burg.load_station("panda_tabletop").document.table.friction
        errors = []
        for fall in falls():
            scene = make_scene(folder, fall)
            friction = scene.entry("block").friction
            true, bouncy = (expected(fall, friction, table, e) for e in (0.0, 0.2))
            found = [simulated(scene, engine) for engine in engines]
            errors.append(np.array(found) - true)
            print(fall.name, *(f"{v:.1f}" for v in (true, bouncy, *found)), sep="\t", flush=True)
    for name, rows in (("stands", errors[:-DROPS]), ("dropped", errors[-DROPS:])):
        for what, values in (("median", np.median), ("largest", np.max)):
            found = [f"{v:.1f}" for v in values(np.abs(rows), axis=0)]
            print(f"{name}: {what} error", "", "", *found, sep="\t")


if __name__ == "__main__":
    main()
