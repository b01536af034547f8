"""The screen of the open hand: rate, clearances, agreement with Drake, and starts of trials.

    python benchmarks/screen.py [SCENE ...] [--station S] [--grasps N] [--compared N] [--started N]

Samples grasps on every object of each scene and screens them: overlaps alone, with signed
clearances, in mode `conservative`, as many that are all clear, in batches of 64, and one by one.
Then it asks Drake about some of them, and looks at the start of trials of clear ones: whether the
trial rejects them, and whether the engine finds the open hand in contact with anything, in the
geometry that it simulates.

Prints CPU time by object, all grasps that Drake judges differently, and the figures of a peer:
BURG-Toolkit's filter without the body of the hand does 2,400 to 8,800 checks a second, 46 to 62 %
of what passes it collide at the start of its trials, and a grasp that collides costs its PyBullet
trial 0.07 s (CPU time of one core of the same kind of machine).
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydrake.geometry import HydroelasticContactRepresentation

import burg_drake as burg
from burg_drake.core import Array, rng_from
from burg_drake.grasping import ClearanceBatch, HandClearance
from burg_drake.simulation import HandTrial

PEER_FILTER = (2400.0, 8800.0)
PEER_REJECTED = 0.07
PEER_STARTS = (0.46, 0.62)
SMALL_BATCH = 64
HAIR = 1e-5
"""Depth below which Drake's search, which ends at a tolerance, may miss an overlap [m]."""
WAYS = ("overlaps", "exact", "conserv.", "clear", "by 64", "alone", "Drake")
"""Ways to screen a grasp, for the heads of columns."""


@dataclass
class Figures:
    """What was measured, over all objects.

    Attributes:
        seconds, asked: CPU time [s] and number of grasps of each of `WAYS`.
        clear, lost: grasps that are clear, and those of them that `conservative` rejects.
        odd: grasps that Drake judges differently: larger depth [m] and a line each.
        judged: grasps that Drake was asked about.
        gaps: difference of Drake's distance and ours of clear grasps [m].
        elsewhere: how many of them have another nearest body by Drake.
        started, rejected, touching: clear grasps that were started, that the trial rejects, and in
            which the engine has the hand in contact.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    asked: dict[str, int] = field(default_factory=dict)
    clear: int = 0
    lost: int = 0
    odd: list[tuple[float, str]] = field(default_factory=list)
    judged: int = 0
    gaps: list[float] = field(default_factory=list)
    elsewhere: int = 0
    started: int = 0
    rejected: int = 0
    touching: int = 0

    def timed(self, way: str, count: int, function: Callable[..., Any], *args: Any) -> Any:
        """Calls a function that screens grasps, and takes down its CPU time."""
        start = time.process_time()
        result = function(*args)
        self.seconds[way] = self.seconds.get(way, 0.0) + time.process_time() - start
        self.asked[way] = self.asked.get(way, 0) + count
        return result

    def rate(self, way: str) -> float:
        """Grasps a second of CPU time."""
        return self.asked[way] / self.seconds[way]


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=["tabletop_six", "tabletop_close"])
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--grasps", type=int, default=4000, help="sampled for each object")
    parser.add_argument("--compared", type=int, default=300, help="of each object, with Drake")
    parser.add_argument("--started", type=int, default=200, help="clear ones of each object")
    arguments = parser.parse_args()
    station = burg.load_station(arguments.station)
    for scene in arguments.scenes:
        measure(burg.load_scene(scene), station, arguments)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(f"peak memory {peak / 1024:.0f} MiB")


def measure(scene: burg.Scene, station: burg.Station, arguments: argparse.Namespace) -> None:
    """Measures on one scene."""
    trial = HandTrial(scene, station)
    print(f"{scene.name}: microseconds a grasp")
    heads = "".join(f" {way:>8}" for way in WAYS)
    print(f"{'object':22} {'grasps':>6} {'clear':>6} {'conserv.':>8}{heads}")
    overall = Figures()
    for name in scene.instances:
        X_WG = sampled(scene, name, arguments.grasps, trial.diagram.X_WO(name))
        measure_object(overall, trial, name, X_WG, arguments)
    report(overall)


def measure_object(
    overall: Figures, trial: HandTrial, name: str, X_WG: Array, arguments: argparse.Namespace
) -> None:
    """Measures grasps on one object, and adds them to the figures of all."""
    screen, own = trial.clearance, Figures()
    screen.measure(name, X_WG[:SMALL_BATCH])
    exact = own.timed("exact", len(X_WG), screen.measure, name, X_WG)
    order = list(screen.outcomes(name))
    own.timed("overlaps", len(X_WG), screen._screen.deepest, X_WG, order)
    careful = own.timed("conserv.", len(X_WG), conservative, screen, name, X_WG)
    clear = X_WG[exact.clear]
    if len(clear):
        many = np.resize(clear, X_WG.shape)
        own.timed("clear", len(many), screen.measure, name, many)
    own.timed("by 64", len(X_WG), in_small_batches, screen, name, X_WG)
    some = X_WG[: arguments.compared]
    own.timed("alone", len(some), one_by_one, screen, name, some)
    touched = own.timed("Drake", len(some), lambda: [screen.touched(X) for X in some])
    figures = "".join(
        f" {1e6 * own.seconds[way] / own.asked[way]:8.1f}" if way in own.asked else f"{'':9}"
        for way in WAYS
    )
    shares = f"{exact.clear.mean():6.1%} {careful.clear.mean():8.1%}"
    print(f"{name:22} {len(X_WG):6} {shares}{figures}", flush=True)
    for way in own.asked:
        overall.seconds[way] = overall.seconds.get(way, 0.0) + own.seconds[way]
        overall.asked[way] = overall.asked.get(way, 0) + own.asked[way]
    overall.clear += int(exact.clear.sum())
    overall.lost += int((exact.clear & ~careful.clear).sum())
    overall.judged += len(some)
    overall.odd += disagreements(name, order, exact, touched)
    compare_distances(overall, screen, X_WG, exact, arguments.compared // 10)
    start_trials(overall, trial, name, clear[: arguments.started])


def conservative(screen: HandClearance, name: str, X_WG: Array) -> ClearanceBatch:
    """Screens grasps in the other mode."""
    return screen.measure(name, X_WG, mode="conservative")


def in_small_batches(screen: HandClearance, name: str, X_WG: Array) -> None:
    """Screens grasps `SMALL_BATCH` at a time."""
    for k in range(0, len(X_WG), SMALL_BATCH):
        screen.measure(name, X_WG[k : k + SMALL_BATCH])


def one_by_one(screen: HandClearance, name: str, X_WG: Array) -> None:
    """Screens grasps each alone."""
    for X in X_WG:
        screen.check(name, X)


def sampled(scene: burg.Scene, name: str, n: int, X_WO: Array) -> Array:
    """(N, 4, 4) antipodal grasps on an instance, in the world."""
    mesh = scene.library.surface(scene.instance(name).object)
    friction = scene.entry(name).friction
    grasps = burg.grasps.sample_antipodal(
        mesh, n, rng_from("benchmark", name), burg.grasps.AntipodalSettings(friction=friction)
    )
    return X_WO @ grasps.X_OG


def disagreements(
    name: str, order: list[str], verdicts: ClearanceBatch, touched: list[dict[str, float]]
) -> list[tuple[float, str]]:
    """Grasps with another deciding body, and the larger of the two depths [m]."""
    found = []
    for k, bodies in enumerate(touched):
        ours, overlap = str(verdicts.blocker[k]), float(verdicts.overlap[k])
        first = min(bodies, key=order.index, default="")
        if first != ours:
            depth = max(overlap, bodies.get(first, 0.0))
            line = f"{name} {k}: {ours or 'clear'}, Drake: {first or 'clear'}"
            found.append((depth, f"{line}; depth {depth * 1e3:.6f} mm"))
    return found


def compare_distances(
    figures: Figures, screen: HandClearance, X_WG: Array, found: ClearanceBatch, most: int
) -> None:
    """Asks Drake for the distances of some clear grasps."""
    for k in np.flatnonzero(found.clear)[:most]:
        distances = screen.signed_distances(X_WG[k])
        name = min(distances, key=lambda body: distances[body])
        figures.gaps.append(distances[name] - float(found.clearance[k]))
        figures.elsewhere += name != found.nearest[k]


def start_trials(figures: Figures, trial: HandTrial, name: str, X_WG: Array) -> None:
    """Looks at the start of trials."""
    diagram = trial.diagram
    context = diagram.diagram.CreateDefaultContext()
    plant_context = diagram.plant.GetMyMutableContextFromRoot(context)
    port = diagram.scene_graph.get_query_output_port()
    inspector = diagram.scene_graph.model_inspector()
    robot = {diagram.plant.GetBodyFrameIdOrThrow(body) for body in diagram.robot_bodies}
    for X in X_WG:
        figures.started += 1
        figures.rejected += trial.clearance.check(name, X).outcome is not None
        trial.hand.place(plant_context, X)
        query = port.Eval(diagram.scene_graph.GetMyContextFromRoot(context))
        surfaces, points = query.ComputeContactSurfacesWithFallback(
            HydroelasticContactRepresentation.kPolygon
        )
        pairs = [(s.id_M(), s.id_N()) for s in surfaces] + [(p.id_A, p.id_B) for p in points]
        figures.touching += any(
            (inspector.GetFrameId(a) in robot) != (inspector.GetFrameId(b) in robot)
            for a, b in pairs
        )


def report(figures: Figures) -> None:
    """Prints what holds for all objects of a scene."""
    print("grasps a second: " + ", ".join(f"{way} {figures.rate(way):,.0f}" for way in WAYS))
    rate = figures.rate("exact")
    print(
        f"peer: filter without hand body {PEER_FILTER[0]:,.0f} to {PEER_FILTER[1]:,.0f} checks/s"
        f" ({rate / PEER_FILTER[1]:.1f} to {rate / PEER_FILTER[0]:.1f} times as fast); rejected by"
        f" its trial in {PEER_REJECTED} s ({PEER_REJECTED * rate:,.0f} times)"
    )
    print(
        f"conservative: rejects {figures.lost} of {figures.clear} clear grasps"
        f" ({figures.lost / max(1, figures.clear):.1%})"
    )
    deep = [line for depth, line in figures.odd if depth > HAIR]
    print(
        f"{len(figures.odd)} of {figures.judged} grasps judged differently by Drake's query,"
        f" {len(deep)} of them with more than {HAIR * 1e3:g} mm of overlap"
    )
    for _, line in figures.odd:
        print(f"  {line}")
    print(
        f"clearance of {len(figures.gaps)} clear grasps: Drake's is"
        f" {min(figures.gaps):.1g} to {max(figures.gaps):.1g} m larger;"
        f" {figures.elsewhere} have another nearest body"
    )
    low, high = PEER_STARTS
    print(
        f"{figures.started} clear grasps started: {figures.rejected / figures.started:.2%}"
        f" rejected by the trial, {figures.touching / figures.started:.2%} in contact by the engine"
        f" (peer {low:.0%} to {high:.0%})"
    )


if __name__ == "__main__":
    main()
