"""CPU time of floating-hand trials in a scene, beside the figures of the PyBullet peer.

    python benchmarks/trials.py [SCENE] [--station S] [--engine NAME] [--grasps N] [--trials N]

Samples grasps on every object of the scene, screens all of them and executes some. Prints a row an
object and the ratio to the peer: BURG-Toolkit on PyBullet takes 0.45 s an executed trial and 0.07 s
a grasp that collides, CPU time of one core in a scene of five objects.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections import Counter

import numpy as np

import burg_drake as burg
from burg_drake.core.content import rng_from
from burg_drake.station.engine import engine_preset

PEER_EXECUTED = 0.45
PEER_REJECTED = 0.07


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--engine", default="standard")
    parser.add_argument("--grasps", type=int, default=400, help="sampled for each object")
    parser.add_argument("--trials", type=int, default=12, help="executed for each object")
    arguments = parser.parse_args()
    scene, station = burg.load_scene(arguments.scene), burg.load_station(arguments.station)
    trial = burg.HandTrial(scene, station, engine=engine_preset(arguments.engine))
    executed_all: list[float] = []
    rejected_all: list[float] = []
    print(f"{'object':20} {'pieces':>6} {'clear':>9} {'rejected':>9} {'executed':>9}  outcomes")
    for name in scene.instances:
        executed, rejected, outcomes = measure(trial, name, arguments.grasps, arguments.trials)
        executed_all += executed
        rejected_all += rejected
        print(
            f"{name:20} {len(scene.entry(name).pieces):6}"
            f" {outcomes.total() / arguments.grasps:9.1%} {np.median(rejected) * 1e3:6.2f} ms"
            f" {np.median(executed) if executed else np.nan:7.3f} s  {dict(outcomes)}",
            flush=True,
        )
    rows = (("executed", executed_all, PEER_EXECUTED), ("rejected", rejected_all, PEER_REJECTED))
    for label, seconds, peer in rows:
        if not seconds:
            continue
        median = float(np.median(seconds))
        quarters = np.percentile(seconds, (25, 75))
        print(
            f"{label}: median {median:.4f} s (quartiles {quarters[0]:.4f} to {quarters[1]:.4f}),"
            f" peer {peer:.2f} s, {peer / median:.1f} times as fast"
        )
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


def measure(
    trial: burg.HandTrial, name: str, grasps: int, trials: int
) -> tuple[list[float], list[float], Counter[str]]:
    """CPU seconds of executed trials and of rejected grasps, and the outcomes of the clear ones."""
    scene = trial.diagram.scene
    entry = scene.entry(name)
    mesh = scene.library.surface(scene.instance(name).object)
    rng = rng_from("benchmark", name)
    sampled = burg.sample_antipodal(mesh, grasps, rng, friction=entry.friction)
    executed, rejected, outcomes = [], [], Counter[str]()
    X_WO = trial.diagram.X_WO(name)
    for X_OG in sampled.X_OG:
        start = time.process_time()
        clear = trial.clearance.check(name, X_WO @ X_OG).outcome is None
        if not clear:
            rejected.append(time.process_time() - start)
        elif len(executed) < trials:
            start = time.process_time()
            outcomes[str(trial.run(name, X_OG).outcome)] += 1
            executed.append(time.process_time() - start)
        else:
            outcomes["not executed"] += 1
    return executed, rejected, outcomes


if __name__ == "__main__":
    main()
