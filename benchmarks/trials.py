"""CPU time of grasp trials, beside trials of the same grasps on PyBullet.

    python benchmarks/trials.py [SCENE ...] [--station S] [--engine NAME ...] [--trials N]

Samples grasps on every object, screens them one by one and all at a time, and executes clear ones
with each engine, of Drake and MuJoCo. Every second one is executed with less friction, so that not
all hold. With PyBullet installed (`pip install pybullet`) the same grasps are executed there, in
this process. All engines are held against published figures as well: BURG-Toolkit takes 0.45 s an
executed trial and 0.07 s a grasp that collides, CPU time of one core in a scene of five objects.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

import numpy as np
import peer_pybullet
from mixed_grasps import clear_grasps, frictions, hand_only, sampled_grasps

import burg_drake as burg
from burg_drake.core import Array, Outcome
from burg_drake.scene import Scene
from burg_drake.simulation import MujocoTrial, hand_trial_of
from burg_drake.station import ENGINES, Station

PUBLISHED_EXECUTED, PUBLISHED_REJECTED = 0.45, 0.07
"""BURG-Toolkit's CPU times [s]."""

T = TypeVar("T")


class Peer(Protocol):
    """Another engine, which executes grasps of one scene."""

    def run(self, instance: str, X_OG: Array, friction: float | None = None) -> Outcome:
        """Executes a grasp (4, 4) on an instance, which may have another friction coefficient."""
        ...


PEERS: dict[str, tuple[Callable[[], bool], Callable[[Scene, Station], Peer]]] = {
    "PyBullet": (peer_pybullet.is_installed, peer_pybullet.Peer),
}
"""By name: whether it is installed, and what makes it."""


@dataclass
class Rows:
    """What was measured on some objects.

    Attributes:
        seconds: CPU time of every executed trial, by engine or peer, in the same order.
        held: whether the grasp held, by engine or peer, in the same order.
        outcomes: by engine or peer.
        rejected: CPU time of every grasp that collides, screened alone [s].
        screened: CPU time of all grasps in one batch, and their number.
    """

    seconds: dict[str, list[float]] = field(default_factory=dict)
    held: dict[str, list[bool]] = field(default_factory=dict)
    outcomes: dict[str, Counter[str]] = field(default_factory=dict)
    rejected: list[float] = field(default_factory=list)
    screened: list[tuple[float, int]] = field(default_factory=list)

    def add(self, name: str, seconds: float, outcome: Outcome) -> None:
        """Takes down one trial."""
        self.seconds.setdefault(name, []).append(seconds)
        self.held.setdefault(name, []).append(outcome.held)
        self.outcomes.setdefault(name, Counter())[str(outcome)] += 1

    def merge(self, other: Rows) -> None:
        """Adds all that another one holds."""
        for name, seconds in other.seconds.items():
            self.seconds.setdefault(name, []).extend(seconds)
            self.held.setdefault(name, []).extend(other.held[name])
            self.outcomes.setdefault(name, Counter()).update(other.outcomes[name])
        self.rejected += other.rejected
        self.screened += other.screened


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=["tabletop_six"], metavar="SCENE")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--engine", nargs="+", default=list(ENGINES), dest="engines")
    parser.add_argument("--grasps", type=int, default=400, help="screened for each object")
    parser.add_argument("--trials", type=int, default=12, help="executed for each object")
    arguments = parser.parse_args()
    peers = [name for name, (is_installed, _) in PEERS.items() if is_installed()]
    names = [*arguments.engines, *peers]
    print(f"{'object':22}{'executed':>9}" + "".join(f"{name:>24}" for name in names), "  outcomes")
    print(" " * 31 + "".join(f"{'median  mean  trials/s':>24}" for _ in names))
    overall = Rows()
    for scene_name in arguments.scenes:
        scene = burg.load_scene(scene_name)
        station = hand_only(burg.load_station(arguments.station))
        bench = Bench(scene, station, arguments.engines, peers)
        for name in scene.instances:
            rows = bench.measure(name, arguments.grasps, arguments.trials)
            print_row(name, rows, names)
            overall.merge(rows)
    print_row("all", overall, names)
    print_screen(overall)
    for name in arguments.engines:
        print_ratios(name, overall, peers)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"peak memory {peak / (2**20 if sys.platform == 'darwin' else 2**10):.0f} MiB")


class Bench:
    """Executes grasps of one scene with each engine, and with peers.

    Args:
        scene: the scene.
        station: a station with the hand alone.
        engines: names of presets.
        peers: names of those that are installed.
    """

    def __init__(
        self, scene: Scene, station: Station, engines: Sequence[str], peers: Sequence[str]
    ) -> None:
        self._trials = {name: hand_trial_of(scene, station, name) for name in engines}
        self._peers = {name: PEERS[name][1](scene, station) for name in peers}

    def measure(self, name: str, screened: int, executed: int) -> Rows:
        """Screens and executes grasps on one object."""
        trial = next(iter(self._trials.values()))
        scene, station, rows = trial.diagram.scene, trial.diagram.station, Rows()
        self._screen(trial, name, sampled_grasps(scene, station, name, screened), rows)
        grasps = clear_grasps(trial, name, executed)
        for X_OG, mu in zip(grasps, frictions(scene, name, len(grasps)), strict=True):
            for engine, one in self._trials.items():
                seconds, result = timed(lambda o=one, X=X_OG, m=mu: o.run(name, X, friction=m))
                rows.add(engine, seconds, result.outcome)
            for other, peer in self._peers.items():
                seconds, outcome = timed(lambda p=peer, X=X_OG, m=mu: p.run(name, X, friction=m))
                rows.add(other, seconds, outcome)
        return rows

    @staticmethod
    def _screen(
        trial: burg.HandTrial | MujocoTrial, name: str, grasps: np.ndarray, rows: Rows
    ) -> None:
        X_WG = trial.diagram.X_WO(name) @ grasps
        for X in X_WG:
            seconds, verdict = timed(lambda X=X: trial.clearance.check(name, X))
            if verdict.outcome is not None:
                rows.rejected.append(seconds)
        if len(X_WG):
            trial.clearance.check_all(name, X_WG[:1])  # builds the screen
            seconds, _ = timed(lambda: trial.clearance.check_all(name, X_WG))
            rows.screened.append((seconds, len(X_WG)))


def timed(function: Callable[[], T]) -> tuple[float, T]:
    """CPU time of a call [s], and what it returns."""
    start = time.process_time()
    value = function()
    return time.process_time() - start, value


def print_row(label: str, rows: Rows, names: Sequence[str]) -> None:
    """Prints the line of an object."""
    count = max((len(s) for s in rows.seconds.values()), default=0)
    cells = ""
    for name in names:
        seconds = rows.seconds.get(name)
        if seconds:
            mean = np.mean(seconds)
            cells += f"{np.median(seconds):11.3f}{mean:6.3f}{1 / mean:7.1f}"
        else:
            cells += f"{'-':>24}"
    first = rows.outcomes.get(names[0], Counter())
    print(f"{label:22}{count:9}{cells}  {dict(first)}", flush=True)


def print_screen(rows: Rows) -> None:
    """Prints what a rejected grasp costs."""
    if rows.rejected:
        median = float(np.median(rows.rejected))
        print(
            f"rejected grasp, screened alone: median {1e3 * median:.3f} ms (published peer"
            f" {1e3 * PUBLISHED_REJECTED:.0f} ms, {PUBLISHED_REJECTED / median:.0f} times)"
        )
    if rows.screened:
        seconds, count = np.sum(rows.screened, axis=0)
        each = seconds / count
        ratio = PUBLISHED_REJECTED / each
        print(f"grasp screened in a batch: mean {1e3 * each:.3f} ms ({ratio:.0f} times)")


def print_ratios(name: str, rows: Rows, peers: Sequence[str]) -> None:
    """Prints how an engine compares in time with the published figure, and in time and verdicts
    with each peer."""
    if not rows.seconds.get(name):
        return
    ours = rows.seconds[name]
    print(
        f"{name}: {PUBLISHED_EXECUTED / np.mean(ours):.1f} times as fast as published for"
        f" BURG-Toolkit (mean; median {PUBLISHED_EXECUTED / np.median(ours):.1f})"
    )
    for peer in [*peers, *(other for other in rows.seconds if other not in {name, *PEERS})]:
        theirs = rows.seconds[peer]
        same = np.equal(rows.held[name], rows.held[peer])
        print(
            f"{name}: {np.mean(theirs) / np.mean(ours):.1f} times as fast as {peer} in this process"
            f" (mean; median {np.median(theirs) / np.median(ours):.1f}), {same.sum()} of"
            f" {same.size} verdicts alike: both hold {np.sum(same & rows.held[name])}, only this"
            f" one {np.sum(~same & rows.held[name])}, only {peer}"
            f" {np.sum(~same & rows.held[peer])}"
        )
    for peer in (peer for peer in PEERS if peer not in peers):
        print(f"{name}: {peer} is not installed")


if __name__ == "__main__":
    main()
