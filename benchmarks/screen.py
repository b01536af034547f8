"""The screen of the open hand: rate in batches, and agreement with Drake's query.

    python benchmarks/screen.py [SCENE] [--station S] [--grasps N] [--compared N]

Samples grasps on every object of the scene and screens them, in one batch an object, in batches of
64, and one by one; then asks Drake about some of them, one by one. Prints CPU time by object, all
grasps that the two judge differently, and the figures of a peer: BURG-Toolkit's filter without the
body of the hand does 2,400 to 8,800 checks a second, and a grasp that collides costs its PyBullet
trial 0.07 s (CPU time of one core of the same kind of machine).
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import burg_drake as burg
from burg_drake.core.content import rng_from
from burg_drake.core.frames import Array
from burg_drake.grasping.clearance import Clearance, HandClearance
from burg_drake.station.diagram import build_station_diagram

PEER_FILTER = (2400.0, 8800.0)
PEER_REJECTED = 0.07
SMALL_BATCH = 64
HAIR = 1e-5
"""Depth below which Drake's search, which ends at a tolerance, may miss an overlap [m]."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--grasps", type=int, default=2000, help="sampled for each object")
    parser.add_argument("--compared", type=int, default=500, help="of each object, with Drake")
    arguments = parser.parse_args()
    scene, station = burg.load_scene(arguments.scene), burg.load_station(arguments.station)
    diagram = build_station_diagram(scene, station, robot="hand")
    built, clearance = cpu(HandClearance, diagram)
    print(f"built in {built:.2f} s of CPU time; microseconds a grasp:")
    columns = "".join(f" {head:>7}" for head in ("batch", "by 64", "alone", "Drake"))
    print(f"{'object':22} {'grasps':>6} {'clear':>6}{columns}")
    batch, odd, compared = [], [], 0
    for name in scene.instances:
        X_WG = sampled(scene, name, arguments.grasps, diagram.X_WO(name))
        m = min(len(X_WG), arguments.compared)
        seconds, verdicts = cpu(clearance.check_all, name, X_WG)
        by_64, _ = cpu(in_small_batches, clearance, name, X_WG)
        alone, _ = cpu(one_by_one, clearance, name, X_WG[:m])
        drake, touched = cpu(asking_drake, clearance, X_WG[:m])
        times = np.array([seconds / len(X_WG), by_64 / len(X_WG), alone / m, drake / m])
        clear = np.mean([v.outcome is None for v in verdicts])
        figures = "".join(f" {t:7.1f}" for t in times * 1e6)
        print(f"{name:22} {len(X_WG):6} {clear:6.1%}{figures}", flush=True)
        batch.append((len(X_WG), seconds))
        compared += m
        order = list(clearance.outcomes(name))
        odd += disagreements(name, order, verdicts[:m], touched)
    rate = sum(n for n, _ in batch) / sum(s for _, s in batch)
    print(f"in a batch: {rate:,.0f} grasps/s, {1e6 / rate:.1f} microseconds each")
    print(
        f"peer: filter without hand body {PEER_FILTER[0]:,.0f} to {PEER_FILTER[1]:,.0f} checks/s"
        f" ({rate / PEER_FILTER[1]:.1f} to {rate / PEER_FILTER[0]:.1f} times as fast); rejected by"
        f" its trial in {PEER_REJECTED} s ({PEER_REJECTED * rate:,.0f} times)"
    )
    deep = [line for depth, line in odd if depth > HAIR]
    print(
        f"{len(odd)} of {compared} grasps judged differently by Drake's query, {len(deep)} of them"
        f" with more than {HAIR * 1e3:g} mm of overlap"
    )
    for _, line in odd:
        print(f"  {line}")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB")


def sampled(scene: burg.Scene, name: str, n: int, X_WO: Array) -> Array:
    """(N, 4, 4) antipodal grasps on an instance, in the world."""
    mesh = scene.library.surface(scene.instance(name).object)
    friction = scene.entry(name).friction
    grasps = burg.sample_antipodal(mesh, n, rng_from("benchmark", name), friction=friction)
    return X_WO @ grasps.X_OG


def in_small_batches(clearance: HandClearance, name: str, X_WG: Array) -> None:
    """Screens grasps `SMALL_BATCH` at a time."""
    for k in range(0, len(X_WG), SMALL_BATCH):
        clearance.check_all(name, X_WG[k : k + SMALL_BATCH])


def one_by_one(clearance: HandClearance, name: str, X_WG: Array) -> None:
    """Screens grasps each alone."""
    for X in X_WG:
        clearance.check(name, X)


def asking_drake(clearance: HandClearance, X_WG: Array) -> list[dict[str, float]]:
    """What the hand overlaps at each grasp by Drake's query."""
    return [clearance.touched(X) for X in X_WG]


def disagreements(
    name: str, order: list[str], verdicts: list[Clearance], touched: list[dict[str, float]]
) -> list[tuple[float, str]]:
    """Grasps with another deciding body, and the larger of the two depths [m]."""
    found = []
    for k, (verdict, bodies) in enumerate(zip(verdicts, touched, strict=True)):
        first = min(bodies, key=order.index, default="")
        if first != verdict.blocker:
            depth = max(verdict.overlap, bodies.get(first, 0.0))
            ours, theirs = verdict.blocker or "clear", first or "clear"
            found.append(
                (depth, f"{name} {k}: {ours}, Drake: {theirs}; depth {depth * 1e3:.6f} mm")
            )
    return found


def cpu(function: Callable[..., Any], *arguments: object) -> tuple[float, Any]:
    """CPU time of a call [s], and its result."""
    start = time.process_time()
    result = function(*arguments)
    return time.process_time() - start, result


if __name__ == "__main__":
    main()
