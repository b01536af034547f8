"""Trials a second of engine mujoco-gpu, against the engines that execute grasps one by one.

    python benchmarks/gpu.py [OBJECT ...] [--grasps N] [--worlds W ...] [--device D] [--each M]

Every object stands in SCENE (tabletop_six). The grasps are clear ones, every second one with less
friction; if there are fewer than asked for, they are repeated. For each number of worlds a row has
trials a second of the whole batch, from the grasps to their results, of which so many were executed
on the CPU; grasps a second that one core feeds (screens, starts and results); and the most memory
in use on the card meanwhile, by all processes. M of the grasps are executed one by one by engines
of the CPU, and ratios are to one core. On a card the kernels that take most of the time follow. The
first batch, a small one, compiles the kernels, and is not counted.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from importlib.metadata import version

import numpy as np
import warp as wp
from mixed_grasps import clear_grasps, frictions, hand_only

import burg_drake as burg
from burg_drake.core import Array
from burg_drake.scene import Scene
from burg_drake.simulation import BatchTrial, hand_trial_of
from burg_drake.station import Station

COMPILING = 8
"""Grasps of the first batch."""
SAMPLED = 1000
"""Different grasps of an object, at most."""
SHOWN_KERNELS = 8


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("objects", nargs="*", default=["box", "mug", "bottle"], metavar="OBJECT")
    parser.add_argument("--scene", default="tabletop_six")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--grasps", type=int, default=49152)
    parser.add_argument("--worlds", type=int, nargs="+", default=[1024, 4096, 16384])
    parser.add_argument("--each", type=int, default=50, help="grasps executed one by one")
    parser.add_argument("--device")
    arguments = parser.parse_args()
    scene = burg.load_scene(arguments.scene)
    station = hand_only(burg.load_station(arguments.station))
    batch = BatchTrial(scene, station, device=arguments.device)
    print(f"{batch.device}, MuJoCo Warp {version('mujoco-warp')}, Warp {wp.__version__}")
    for name in arguments.objects:
        X_OG = clear_grasps(batch.single, name, min(SAMPLED, arguments.grasps))
        friction = frictions(scene, name, len(X_OG))
        base = rates_one_by_one(scene, station, name, X_OG[: arguments.each], friction)
        batch.run(name, X_OG[:COMPILING], friction=friction[:COMPILING])
        rows = np.arange(arguments.grasps) % len(X_OG)
        for worlds in arguments.worlds:
            batch.worlds = worlds
            rate = measure(batch, name, X_OG[rows], friction[rows])
            print(", ".join(f"{rate / one:.1f} times {engine}" for engine, one in base.items()))
        if arguments.device != "cpu":
            print_kernels(batch, name, X_OG[rows], friction[rows])


def rates_one_by_one(
    scene: Scene, station: Station, name: str, X_OG: Array, friction: Array
) -> dict[str, float]:
    """Trials a second and core of the engines on the CPU."""
    rates = {}
    for engine in ("mujoco", "standard"):
        trial = hand_trial_of(scene, station, engine)
        trial.run(name, X_OG[0])
        start = time.process_time()
        for X, mu in zip(X_OG, friction.tolist(), strict=False):
            trial.run(name, X, friction=mu)
        rates[engine] = len(X_OG) / (time.process_time() - start)
        print(f"{name}: {engine} {rates[engine]:.2f} trials a second and core")
    return rates


def measure(batch: BatchTrial, name: str, X_OG: Array, friction: Array) -> float:
    """Prints a row; returns trials a second."""
    used = [0.0]

    def read_memory() -> None:
        device = wp.get_device()  # That of the worlds, while they exist.
        if device.is_cuda:
            used.append((device.total_memory - device.free_memory) / 2**30)

    on_cpu, fed, start = batch.on_cpu, batch.feeding_time, time.perf_counter()
    batch.run(name, X_OG, friction=friction, progress=read_memory)
    wall = time.perf_counter() - start
    fed, on_cpu, n = batch.feeding_time - fed, batch.on_cpu - on_cpu, len(X_OG)
    print(
        f"{name}: {n} grasps in {batch.worlds} worlds: {n / wall:.1f} a second,"
        f" {on_cpu} on the CPU; a core feeds {n / fed:.0f} a second; {max(used):.1f} GiB"
    )
    return n / wall


def print_kernels(batch: BatchTrial, name: str, X_OG: Array, friction: Array) -> None:
    """Prints the kernels that take most of the time, in a batch of one trial a world."""
    rows = np.arange(len(X_OG))[: batch.worlds]
    wp.timing_begin(cuda_filter=wp.TIMING_KERNEL)
    batch.run(name, X_OG[rows], friction=friction[rows])
    by_kernel: dict[str, float] = defaultdict(float)
    for result in wp.timing_end():
        by_kernel[result.name] += result.elapsed
    total = sum(by_kernel.values())
    for kernel, spent in sorted(by_kernel.items(), key=lambda item: -item[1])[:SHOWN_KERNELS]:
        print(f"  {100.0 * spent / total:5.1f} %  {kernel}")


if __name__ == "__main__":
    main()
