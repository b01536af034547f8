"""Trials a second of engine mujoco-gpu, against the engines that execute grasps one by one.

    python benchmarks/gpu.py [OBJECT ...] [--grasps N] [--worlds W ...] [--device D] [--each M]
                             [--run N] [--workers P]

Every object stands in SCENE (tabletop_six). The grasps are clear ones, every second one with less
friction; if there are fewer than asked for, they are repeated. For each number of worlds a row has
trials a second of the whole batch, from the grasps to their results, of which so many were executed
on the CPU; grasps a second that one core feeds (screens, starts and results); and the most memory
in use on the card meanwhile, by all processes. M of the grasps are executed one by one by engines
of the CPU, and ratios are to one core. On a card the kernels that take most of the time follow. The
first batch, a small one, compiles the kernels, and is not counted. `--grasps 0` leaves all of this
out.

At last `burg.evaluate` judges N grasps of the objects by P worker processes, from sampling to the
report: grasps a second of the whole call, the share of time by phase (opening, judging, writing),
the CPU time of the sampling processes, and the largest memory of this process and of a worker.
Judging includes the start of the workers and the screens. N is small on the CPU device, where it is
a try; 0 leaves it out.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections import defaultdict
from importlib.metadata import version
from pathlib import Path

import numpy as np
import warp as wp
from mixed_grasps import clear_grasps, frictions, hand_only

import burg_drake as burg
from burg_drake.core import STARTING_PHASE, Array, Progress
from burg_drake.scene import Scene
from burg_drake.simulation import BatchTrial, hand_trial_of
from burg_drake.station import Station

COMPILING = 8
"""Grasps of the first batch."""
SAMPLED = 1000
"""Different grasps of an object, at most."""
SHOWN_KERNELS = 8
RUN_ON_THE_CPU, RUN_ON_A_CARD = 12, 100_000
"""Grasps of the run through `evaluate`."""


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
    parser.add_argument("--run", type=int, help="grasps that evaluate judges; 0 for none")
    parser.add_argument("--workers", type=int, default=4, help="processes of evaluate")
    arguments = parser.parse_args()
    scene = burg.load_scene(arguments.scene)
    station = hand_only(burg.load_station(arguments.station))
    try:
        batch = BatchTrial(scene, station, device=arguments.device)
    except burg.BurgError as error:  # there is no card
        parser.error(str(error))
    print(f"{batch.device}, MuJoCo Warp {version('mujoco-warp')}, Warp {wp.__version__}")
    if arguments.grasps:
        measure_batches(batch, arguments)
    count = RUN_ON_THE_CPU if arguments.device == "cpu" else RUN_ON_A_CARD
    count = count if arguments.run is None else arguments.run
    if count:
        settings = burg.EvaluationSettings(
            mode="hand",
            engine="mujoco-gpu",
            device=arguments.device,
            only=arguments.objects,
            grasps_per_object=-(-count // len(arguments.objects)),
        )
        measure_run(scene, arguments.station, settings, arguments.workers)


def measure_batches(batch: BatchTrial, arguments: argparse.Namespace) -> None:
    """Prints the rates of batches of each object."""
    scene, station = batch.single.scene, batch.single.station
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


class PhaseTimes:
    """Wall time by phase [s], from the events of `evaluate`.

    Attributes:
        times: the times by phase, in order.
    """

    def __init__(self) -> None:
        self.times: dict[str, float] = {}
        self._phase, self._begun = "opening", time.perf_counter()

    def note(self, event: Progress) -> None:
        """Notes an event; what comes after the last verdict is writing."""
        phase = "judging" if event.phase == STARTING_PHASE else event.phase
        self.begin("writing" if 0 < event.total == event.done else phase)

    def begin(self, phase: str) -> None:
        """Ends the present phase, and begins another."""
        now = time.perf_counter()
        self.times[self._phase] = self.times.get(self._phase, 0.0) + now - self._begun
        self._phase, self._begun = phase, now


def measure_run(
    scene: Scene, station: str, settings: burg.EvaluationSettings, workers: int
) -> None:
    """Prints the rate of a whole call of `evaluate`, its phases and its memory."""
    phases = PhaseTimes()
    with tempfile.TemporaryDirectory() as folder:
        run = burg.evaluate(
            scene,
            station,
            Path(folder, "run"),
            settings=settings,
            workers=workers,
            progress=phases.note,
        )
        phases.begin("")
        judged, executed = len(run.candidates), run.document.stretches[-1].executed
        sampling = run.document.grasps.cpu
    total = sum(phases.times.values())
    shares = (f"{name} {100.0 * spent / total:.0f} %" for name, spent in phases.times.items())
    own, largest = (
        resource.getrusage(who).ru_maxrss / 2**20
        for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    print(
        f"evaluate, {workers} workers: {judged} grasps, {sum(executed.values())} of them executed,"
        f" in {total:.1f} s: {judged / total:.1f} a second; {', '.join(shares)};"
        f" sampled in {sampling:.1f} s of CPU time; memory"
        f" {own:.1f} GiB, of a worker at most {largest:.1f} GiB"
    )


if __name__ == "__main__":
    main()
