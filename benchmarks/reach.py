"""Speed and truth of the arm's reach check, beside an exhaustive search and a plain baseline.

    python benchmarks/reach.py [--stations S ...] [--scenes S ...] [--also SCENE:STATION ...]
                               [--grasps N] [--proven N] [--exhaustive N] [--plain N] [--audit N]

Samples grasps on every object of each scene, keeps those that the open hand is clear for, and
judges them on each station: with the exact recheck and in screening mode. `reach_prover`, which
shares nothing with the reach check, looks for motions to some of those that we refuse, at 1 to 5 s
each (`reach_recall`). The other judges, which are in `reach_judges`, are asked about some; for each
grasp on which they differ it is said why. Some motions are audited (`reach_audit`), in steps in
which no point of the robot moves by more than 5 mm. Intervals are Wilson's, of 95 %. Seconds are
CPU time.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from reach_audit import Audit
from reach_judges import Exhaustive, Plain, PlainWorld, World
from reach_recall import Recall, recall

from burg_drake.core import Array, rng_from, wilson_interval
from burg_drake.grasping import AntipodalSettings, HandClearance, sample_antipodal
from burg_drake.motion import ArmReach, PandaIk, Reach, ReachSettings
from burg_drake.scene import Scene, load_scene
from burg_drake.station import GraspMotion, Station, build_station_diagram, load_station

STEP = 0.005
"""Of the audit [m]."""
SAMPLED = 4000
"""Grasps for each object, of which those that are clear of everything are taken evenly."""


@dataclass(frozen=True, eq=False)
class Grasps:
    """N grasps that the open hand is clear for.

    Attributes:
        instance: N names.
        X_WG: (N, 4, 4) in the world.
        width: (N,) distances between the pads [m].
    """

    instance: list[str]
    X_WG: Array
    width: Array


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    stations = ["panda_tabletop", "panda_bin", "panda_shelf"]
    parser.add_argument("--stations", nargs="*", default=stations)
    parser.add_argument("--scenes", nargs="*", default=["tabletop_six", "tabletop_twelve"])
    also = ["tabletop_close:panda_pedestal", "tabletop_twelve:panda_offset"]
    also += ["tabletop_six:ur5e_tabletop"]
    parser.add_argument("--also", nargs="*", default=also, help="not used to choose anything by")
    parser.add_argument("--grasps", type=int, default=500, help="to judge")
    parser.add_argument("--proven", type=int, default=100, help="judged by the prover, too")
    parser.add_argument("--exhaustive", type=int, default=0, help="judged exhaustively, too")
    parser.add_argument("--plain", type=int, default=0, help="judged by the baseline, too")
    parser.add_argument("--audit", type=int, default=60, help="motions that are audited")
    arguments = parser.parse_args()
    pairs = [(scene, station) for scene in arguments.scenes for station in arguments.stations]
    pairs += [tuple(pair.split(":", 1)) for pair in arguments.also]
    found = [judge(load_scene(a), load_station(b), arguments) for a, b in pairs]
    print(f"\nrecall of all: {Recall.total(found)}")


def judge(scene: Scene, station: Station, arguments: argparse.Namespace) -> Recall:
    """Judges the grasps of one scene on one station, and prints what comes of it."""
    grasps = clear_grasps(scene, station, arguments.grasps)
    n = len(grasps.instance)
    print(f"\n{scene.name} on {station.name}: {n} grasps that the open hand is clear for")
    motion = GraspMotion()
    settings = ReachSettings(motion=motion)
    exact, rate = timed("exact", scene, station, settings, grasps)
    screened, _ = timed("screening", scene, station, replace(settings, exact=False), grasps)
    compare("screening", screened, "exact", yes(exact))
    audit_motions(scene, station, grasps, exact, arguments.audit)
    few = slice(0, arguments.proven)
    asked_about = grasps.instance[few], grasps.X_WG[few], grasps.width[few]
    said = recall(scene, station, asked_about, exact[few], settings)

    if arguments.exhaustive or arguments.plain:
        ask_others(scene, station, grasps, exact, rate, arguments)
    return said


def ask_others(
    scene: Scene,
    station: Station,
    grasps: Grasps,
    exact: list[Reach],
    rate: float,
    arguments: argparse.Namespace,
) -> None:
    """Asks the judges of `reach_judges`, and prints where they differ."""
    motion = GraspMotion()
    world = World(scene, station, motion.standoff, motion.lift_height)
    if PandaIk.of(world.kinematics) is not None:  # the exhaustive judge knows the Panda alone
        few = slice(0, arguments.exhaustive)
        other, _ = asked("exhaustive", Exhaustive(world).check, grasps, few)
        compare("exact", exact[few], "exhaustive", other)
    few = slice(0, arguments.plain)
    plain = Plain(PlainWorld(scene, station, motion.standoff, motion.lift_height))
    other, plain_rate = asked("SNOPT and RRT", plain.check, grasps, few)
    compare("exact", exact[few], "SNOPT and RRT", other)
    if other:
        print(f"  exact is {rate / plain_rate:.0f} times as fast as SNOPT and RRT", flush=True)


def audit_motions(
    scene: Scene, station: Station, grasps: Grasps, found: list[Reach], most: int
) -> None:
    """Audits the first motions, and prints what collides."""
    audit = Audit(scene, station)
    motions = [(k, reach.path) for k, reach in enumerate(found) if reach.path][:most]
    faulty = 0
    for k, arm_path in motions:
        faults = audit.faults(grasps.instance[k], arm_path, float(grasps.width[k]), step=STEP)
        if faults:
            faulty += 1
            print(
                f"    grasp {k}: {max(faults, key=lambda fault: fault.depth)}; {len(faults)} in all"
            )
    print(f"  audit: {share(faulty, len(motions))} motions collide", flush=True)


def clear_grasps(scene: Scene, station: Station, count: int) -> Grasps:
    """Sampled grasps that the open hand is clear for, of all objects alike."""
    diagram = build_station_diagram(scene, station, robot="hand")
    clearance = HandClearance(diagram)
    instance: list[str] = []
    poses, widths = [], []
    for name in scene.instances:
        entry = scene.entry(name)
        mesh = scene.library.surface(scene.instance(name).object)
        rng = rng_from("benchmark reach", name)
        sampled = sample_antipodal(mesh, SAMPLED, rng, AntipodalSettings(friction=entry.friction))
        X_WG = diagram.X_WO(name) @ sampled.X_OG
        clear = np.flatnonzero(clearance.measure(name, X_WG).clear)
        instance += [name] * len(clear)
        poses.append(X_WG[clear])
        widths.append(sampled.width[clear])
    order = rng_from("benchmark reach").permutation(len(instance))[:count]
    return Grasps(
        [instance[k] for k in order], np.concatenate(poses)[order], np.concatenate(widths)[order]
    )


def timed(
    label: str, scene: Scene, station: Station, settings: ReachSettings, grasps: Grasps
) -> tuple[list[Reach], float]:
    """Judges all grasps; returns the verdicts and how many a second."""
    start = time.process_time()
    arm = ArmReach(scene, station, settings=settings)
    arm.check_all(grasps.instance[:1], grasps.X_WG[:1], grasps.width[:1])
    built = time.process_time()
    found = arm.check_all(grasps.instance, grasps.X_WG, grasps.width)
    seconds = time.process_time() - built
    rate = len(found) / seconds
    print(f"  {label}: {rate:.0f} grasps/s, set-up and first grasp {built - start:.2f} s")
    counts = Counter(reach.outcome or "reached" for reach in found)
    shares = ", ".join(f"{count} {outcome}" for outcome, count in counts.most_common())
    print(f"    {shares}", flush=True)
    return found, rate


def asked(
    label: str, check: Callable[[str, Array], bool], grasps: Grasps, few: slice
) -> tuple[list[bool], float]:
    """Asks another judge about some grasps."""
    start = time.process_time()
    pairs = zip(grasps.instance[few], grasps.X_WG[few], strict=True)
    found = [check(instance, X_WG) for instance, X_WG in pairs]
    rate = len(found) / max(time.process_time() - start, 1e-9)
    print(f"  {label}: {rate:.1f} grasps/s, {sum(found)} of {len(found)} reached", flush=True)
    return found, rate


def yes(found: list[Reach]) -> list[bool]:
    """Which are reached."""
    return [reach.outcome is None for reach in found]


def compare(label: str, ours: list[Reach], name: str, theirs: list[bool]) -> None:
    """Prints how far two judges agree, and what we say of each grasp on which they do not."""
    pairs = list(zip(yes(ours), theirs, strict=True))
    print(f"  {label} against {name}: {share(sum(a == b for a, b in pairs), len(pairs))} alike")
    print(f"    reached, too: {share(sum(a and b for a, b in pairs), sum(theirs))} of theirs")
    print(f"    reached by {label} alone: {sum(a and not b for a, b in pairs)}")
    missed = [k for k, (a, b) in enumerate(pairs) if b and not a]
    for cause, count in Counter(cause_of(ours[k]) for k in missed).most_common():
        print(f"    reached by {name} alone: {count} x {cause}", flush=True)
    differing = [k for k, (a, b) in enumerate(pairs) if a != b]
    print(f"    different: {differing[:20]}", flush=True)


def cause_of(reach: Reach) -> str:
    """Why a grasp is not reached."""
    return f"{reach.outcome} {reach.blocker}".rstrip()


def share(count: int, total: int) -> str:
    """A count with its interval."""
    low, high = wilson_interval(count, total)
    return f"{count} of {total} ({100.0 * low:.1f} to {100.0 * high:.1f} %)"


if __name__ == "__main__":
    main()
