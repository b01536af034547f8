"""The same physical grasp has the same verdict: fingers swapped, world turned, order reversed.

    python benchmarks/symmetry.py [SCENE ...] [--station S] [--engine E] [--trials N] [--workers N]

Executes each grasp four times: as it is, with the fingers swapped, in a world that is turned and
moved, and as it is once more, after all the others and in reverse order. The first three are the
same grasp to physics, though not to rounding; the last has to be the same to the bit.

Every changed verdict (success or not) is listed with its margins. It is marginal if the reference
engine changes its own verdict, too, when the friction of the object changes by 2 %. The PyBullet
peer (BURG-Toolkit) changes 8.8 % of its verdicts with the fingers swapped and 5.6 % with the world
turned by 37 degrees.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import astuple, dataclass, field
from multiprocessing import get_context

import numpy as np
from mixed_grasps import clear_grasps, frictions, hand_only

import burg_drake as burg
from burg_drake.core import Array, swap_fingers
from burg_drake.simulation import TrialResult
from burg_drake.station import as_engine

SCENES = ("tabletop_six", "tabletop_close")
PEER = {"swapped": 0.088, "turned": 0.056}
SHIFT = (0.7, -0.4)
"""Where the turned world is moved to [m]."""
FRICTION_CHANGES = (0.98, 1.02)


@dataclass(frozen=True)
class Work:
    """Grasps of one object in one scene.

    Attributes:
        scene, instance: whose grasps.
        station, engine, trials, turn: as on the command line.
    """

    scene: str
    instance: str
    station: str
    engine: str
    trials: int
    turn: float


@dataclass
class Tally:
    """What became of the grasps of one object.

    Attributes:
        work: which.
        outcomes: of the grasps as they are.
        flips: changed verdicts by kind of change, with whether they are marginal.
        renamed: verdicts that stay while the outcome changes, such as `slipped` to `dropped`.
        inexact: repeated trials whose bits differ.
        lines: what to print about each flip.
    """

    work: Work
    outcomes: Counter[str] = field(default_factory=Counter)
    flips: list[tuple[str, bool]] = field(default_factory=list)
    renamed: Counter[str] = field(default_factory=Counter)
    inexact: int = 0
    lines: list[str] = field(default_factory=list)


def succeeded(result: TrialResult) -> bool:
    """Held, and nothing else disturbed."""
    return result.outcome is burg.Outcome.LIFTED


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", default=SCENES, metavar="SCENE")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--engine", default="standard")
    parser.add_argument("--trials", type=int, default=50, help="for each object, at most")
    parser.add_argument("--turn", type=float, default=37.0, help="of the world [degrees]")
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    works = [
        Work(scene, name, arguments.station, arguments.engine, arguments.trials, arguments.turn)
        for scene in arguments.scenes
        for name in burg.load_scene(scene).instances
    ]
    with ProcessPoolExecutor(arguments.workers, get_context("spawn")) as pool:
        tallies = list(printed(pool.map(judge, works)))
    print_totals(tallies)


def judge(work: Work) -> Tally:
    """Executes the grasps of one object."""
    scene, station = burg.load_scene(work.scene), burg.load_station(work.station)
    engine = as_engine(work.engine)
    here = burg.HandTrial(scene, hand_only(station), engine=engine)
    moved = hand_only(station, np.deg2rad(work.turn), *SHIFT)
    there = burg.HandTrial(scene, moved, engine=engine)
    name, tally = work.instance, Tally(work)
    grasps = clear_grasps(here, name, work.trials)
    tries = list(zip(grasps, frictions(scene, name, len(grasps)), strict=True))
    ways = {
        "swapped": [here.run(name, swap_fingers(X_OG), friction=mu) for X_OG, mu in tries],
        "turned": [there.run(name, X_OG, friction=mu) for X_OG, mu in tries],
    }
    plain = [here.run(name, X_OG, friction=mu) for X_OG, mu in tries]
    again = [here.run(name, X_OG, friction=mu) for X_OG, mu in tries[::-1]][::-1]
    tally.outcomes.update(str(result.outcome) for result in plain)
    tally.inexact = sum(bits(a) != bits(b) for a, b in zip(plain, again, strict=True))
    for way, results in ways.items():
        for (X_OG, mu), one, other in zip(tries, plain, results, strict=True):
            if succeeded(one) is not succeeded(other):
                marginal = list(judged_with_other_friction(work, X_OG, mu))
                tally.flips.append((way, len({o is burg.Outcome.LIFTED for o in marginal}) > 1))
                tally.lines += told(work, way, one, other, marginal)
            elif one.outcome is not other.outcome:
                tally.renamed[way] += 1
    return tally


def judged_with_other_friction(work: Work, X_OG: Array, friction: float) -> Iterator[burg.Outcome]:
    """Outcomes of the reference at a lower, at the same and at a higher friction."""
    scene, station = burg.load_scene(work.scene), hand_only(burg.load_station(work.station))
    trial = burg.HandTrial(scene, station, engine=as_engine("reference"))
    for factor in (FRICTION_CHANGES[0], 1.0, FRICTION_CHANGES[1]):
        yield trial.run(work.instance, X_OG, friction=factor * friction).outcome


def bits(result: TrialResult) -> tuple[str, ...]:
    """Outcome and margins, exactly."""
    return str(result.outcome), *(value.hex() for value in astuple(result.margins))


def told(
    work: Work, way: str, one: TrialResult, other: TrialResult, reference: list[burg.Outcome]
) -> list[str]:
    """Lines about a flip."""
    kind = "marginal" if len({o is burg.Outcome.LIFTED for o in reference}) > 1 else "NOT marginal"
    lines = [f"  {work.instance} {way}, {kind}: reference with friction 98, 100, 102 %:"
             f" {', '.join(reference)}"]  # fmt: skip
    for result in (one, other):
        m = result.margins
        lines.append(f"    {result.outcome:16} slip {m.slip * 1e3:6.2f} mm, tilt"
                     f" {np.rad2deg(m.tilt):6.2f} deg, pad {m.pad_force:5.1f} N on"
                     f" {m.patch_area * 1e6:5.1f} mm2, lift {m.lift * 1e3:6.1f} mm,"
                     f" end {m.end_time:.2f} s")  # fmt: skip
    return lines


def printed(tallies: Iterator[Tally]) -> Iterator[Tally]:
    """Prints a row an object."""
    for tally in tallies:
        flips = Counter(way for way, _ in tally.flips)
        print(
            f"{tally.work.scene:16} {tally.work.instance:20} {tally.outcomes.total():4} trials,"
            f" swapped {flips['swapped']}, turned {flips['turned']} flips, bits changed"
            f" {tally.inexact}; {dict(tally.outcomes)}",
            *tally.lines, sep="\n", flush=True,
        )  # fmt: skip
        yield tally


def print_totals(tallies: list[Tally]) -> None:
    """Prints the shares of flips."""
    executed = sum(tally.outcomes.total() for tally in tallies)
    for way, peer in PEER.items():
        flips = [marginal for tally in tallies for kind, marginal in tally.flips if kind == way]
        renamed = sum(tally.renamed[way] for tally in tallies)
        print(
            f"{way}: {len(flips)} of {executed} verdicts change ({len(flips) / executed:.2%}, peer"
            f" {peer:.1%}), {sum(flips)} of them marginal; {renamed} failures under another name"
        )
    inexact = sum(tally.inexact for tally in tallies)
    print(f"again, in reverse order: {inexact} of {executed} results differ in a bit")


if __name__ == "__main__":
    main()
