"""How far two engines agree about the same grasps, and where they do not.

    python benchmarks/engine_agreement.py [SCENE ...] [--engines standard mujoco] [--trials N]
        [--station S] [--workers N] [--device D]

Samples antipodal grasps on every object, and executes the clear ones with both engines, every
second one with less friction, so that not all hold. An object that stands in several scenes is
tried with other grasps in each. Two verdicts are alike if both hold the target at the end or
neither does. Tables show what is alike by object, by the phase in which each engine loses the
target, by the outcomes of both, and by the margins of the first engine: what slipped or tilted
much, or is pressed little, is contested. The grasps on which the engines differ are listed.

An engine with parallel trials runs on a card, or with --device cpu without one.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing import get_context

import numpy as np
from mixed_grasps import clear_grasps, frictions, hand_only

import burg_drake as burg
from burg_drake.core import Array, wilson_interval
from burg_drake.simulation import BatchTrial, MujocoTrial, TrialResult, hand_trial_of
from burg_drake.station import ENGINES

ENOUGH = 0.95
"""Share of verdicts that two good engines should have alike."""
PHASES = {
    "no_contact": "closing",
    "one_finger": "closing",
    "closed_empty": "closing",
    "hand_collision_approach": "approach",
    "dropped": "hold",
    "simulation_failed": "failed",
}
"""In which phase an outcome that does not hold ends a trial; the others do on the lift."""
SLIPS = (1e-4, 1e-3, 3e-3, 1e-2)
TILTS = (0.5, 3.0, 10.0, 30.0)
FORCES = (10.0, 20.0, 30.0, 38.0)


@dataclass(frozen=True)
class Pair:
    """One grasp, executed twice.

    Attributes:
        object: the instance, with its scene.
        number: of the grasp on it.
        friction: coefficient.
        results: of the two engines.
        seconds: CPU time of each.
    """

    object: str
    number: int
    friction: float
    results: tuple[TrialResult, TrialResult]
    seconds: tuple[float, float]

    @property
    def alike(self) -> bool:
        """Whether both hold the target, or neither does."""
        one, other = self.results
        return one.outcome.held == other.outcome.held


@dataclass(frozen=True)
class Share:
    """Grasps of one object, or some of them.

    Attributes:
        scene, station, instance: where.
        engines: names of the two.
        count: grasps of the instance.
        skip: leave out so many clear ones first.
        part, parts: every so many of them, from that one on.
        device: of an engine with parallel trials.
    """

    scene: str
    station: str
    instance: str
    engines: tuple[str, str]
    count: int
    skip: int
    part: int
    parts: int
    device: str | None


def main() -> None:
    """Runs the study."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "scenes", nargs="*", default=["tabletop_six", "tabletop_twelve"], metavar="SCENE"
    )
    parser.add_argument("--engines", nargs=2, choices=list(ENGINES), default=["standard", "mujoco"])
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--trials", type=int, default=1300, help="at most, in all")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--device", help="of an engine with parallel trials")
    arguments = parser.parse_args()
    engines = (arguments.engines[0], arguments.engines[1])
    placed = [(s, name) for s in arguments.scenes for name in burg.load_scene(s).instances]
    each = -(-arguments.trials // len(placed))
    seen = Counter[str]()
    shares = []
    for scene, name in placed:
        skip = each * seen[name]
        seen[name] += 1
        where = (scene, arguments.station, name, engines, each, skip)
        shares += [
            Share(*where, part, arguments.workers, arguments.device)
            for part in range(arguments.workers)
        ]
    pairs: list[Pair] = []
    with ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool:
        for found in pool.map(execute, shares):
            pairs += found
    report(pairs, engines)


def execute(share: Share) -> list[Pair]:
    """Executes a share of the grasps on one object."""
    scene, station = burg.load_scene(share.scene), hand_only(burg.load_station(share.station))
    name = share.instance
    trial = hand_trial_of(scene, station, share.engines[0])
    grasps = clear_grasps(trial, name, share.skip + share.count)[share.skip :]
    numbers = np.arange(len(grasps))[share.part :: share.parts]
    X_OG, friction = grasps[numbers], frictions(scene, name, len(grasps))[numbers]
    columns = []
    for engine in share.engines:
        if ENGINES[engine].parallel:
            batch = BatchTrial(scene, station, engine=engine, device=share.device)
            columns.append(execute_all(batch, name, X_OG, friction))
        else:
            single = hand_trial_of(scene, station, engine)
            columns.append(execute_each(single, name, X_OG, friction))
    return [
        Pair(f"{share.scene}/{name}", int(number), float(mu), (a[0], b[0]), (a[1], b[1]))
        for number, mu, a, b in zip(numbers, friction, *columns, strict=True)
    ]


Timed = tuple[TrialResult, float]
"""A result, and its CPU time [s]."""


def execute_each(
    trial: burg.HandTrial | MujocoTrial, name: str, X_OG: Array, friction: Array
) -> list[Timed]:
    """Executes grasps one by one."""
    results = []
    for X, mu in zip(X_OG, friction.tolist(), strict=True):
        start = time.process_time()
        results.append((trial.run(name, X, friction=mu), time.process_time() - start))
    return results


def execute_all(trial: BatchTrial, name: str, X_OG: Array, friction: Array) -> list[Timed]:
    """Executes grasps in parallel; each gets an equal share of the CPU time."""
    start = time.process_time()
    results = trial.run(name, X_OG, friction=friction)
    seconds = (time.process_time() - start) / max(1, len(results))
    if trial.on_cpu:
        print(f"{name}: {trial.on_cpu} of {len(results)} were executed on the CPU")
    return [(result, seconds) for result in results]


def report(pairs: Sequence[Pair], engines: tuple[str, str]) -> None:
    """Prints all tables."""
    one, other = engines
    print(f"{len(pairs)} grasps with {one} and {other}")
    for object in dict.fromkeys(pair.object for pair in pairs):
        print_row(object, [pair for pair in pairs if pair.object == object])
    print_row("all", pairs)
    print(f"\nphase in which the target is lost, {one} / {other}")
    phases = Counter(tuple(phase(r) for r in pair.results) for pair in pairs)
    for (a, b), count in phases.most_common():
        print(f"  {a:20}{b:20}{count:6}{'' if a == b else '   other'}")
    print(f"\noutcomes, {one} / {other}")
    counts = Counter(tuple(str(r.outcome) for r in pair.results) for pair in pairs)
    for (a, b), count in counts.most_common():
        print(f"  {a:20}{b:20}{count:6}{'' if a == b else '   other'}")
    margins: dict[str, tuple[Callable[[TrialResult], float], Sequence[float], str, float]] = {
        "slip": (lambda r: r.margins.slip, SLIPS, "mm", 1e3),
        "tilt": (lambda r: float(np.rad2deg(r.margins.tilt)), TILTS, "deg", 1.0),
        "pad force": (lambda r: r.margins.pad_force, FORCES, "N", 1.0),
    }
    for label, (of, edges, unit, scale) in margins.items():
        print(f"\n{label} of {one} [{unit}]")
        values = np.array([of(pair.results[0]) for pair in pairs])
        bounds = [-np.inf, *edges, np.inf]
        for low, high in pairwise(bounds):
            within = (values >= low) & (values < high)
            print_row(
                f"  {scale * low:g} to {scale * high:g}",
                [p for p, x in zip(pairs, within, strict=True) if x],
            )
        print_row("  never held", [p for p, x in zip(pairs, np.isnan(values), strict=True) if x])
    print(f"\nnot alike, {one} / {other}")
    for pair in pairs:
        if not pair.alike:
            print_pair(pair)
    cpu = np.array([pair.seconds for pair in pairs]).mean(axis=0)
    print(f"\nCPU time a trial: {one} {cpu[0]:.3f} s, {other} {cpu[1]:.3f} s")
    share = np.mean([pair.alike for pair in pairs])
    low, high = wilson_interval(sum(pair.alike for pair in pairs), len(pairs))
    print(
        f"{100 * share:.1f} % alike ({100 * low:.1f} to {100 * high:.1f}),"
        f" {'as' if share >= ENOUGH else 'not as'} it should be"
    )


def phase(result: TrialResult) -> str:
    """In which phase of the trial the target is lost; `held` if it is not."""
    return "held" if result.outcome.held else PHASES.get(str(result.outcome), "lift")


def print_pair(pair: Pair) -> None:
    """Prints a grasp on which the engines differ, with the margins of both."""
    slips, tilts = (
        " / ".join(f"{value:.1f}" for value in values)
        for values in (
            [1e3 * r.margins.slip for r in pair.results],
            [np.rad2deg(r.margins.tilt) for r in pair.results],
        )
    )
    outcomes = " / ".join(str(r.outcome) for r in pair.results)
    print(
        f"  {pair.object:28} {pair.number:3}  friction {pair.friction:.2f}  {outcomes:32}"
        f"  slip {slips} mm, tilt {tilts} deg"
    )


def print_row(label: str, pairs: Sequence[Pair]) -> None:
    """Prints what is alike of some grasps, and which engine holds the others."""
    if not pairs:
        return
    held = np.array([[r.outcome.held for r in pair.results] for pair in pairs])
    alike = held[:, 0] == held[:, 1]
    both, first = held.all(axis=1).sum(), (held[:, 0] & ~held[:, 1]).sum()
    second = (held[:, 1] & ~held[:, 0]).sum()
    print(
        f"{label:24}{len(pairs):5}  alike {alike.sum():5} ({100 * alike.mean():5.1f} %), both hold"
        f" {both:5}, only the first {first:4}, only the second {second:4}"
    )


if __name__ == "__main__":
    main()
