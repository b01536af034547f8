"""The whole arm's trials beside those of the hand alone: CPU time, tracking error, verdicts.

    python benchmarks/arm_trials.py [SCENE] [--stations S ...] [--engines NAME ...] [--grasps N]

Samples grasps on every object at which the open hand is clear, asks whether the arm can execute
them, plans those that it can, and executes each plan with the whole arm and the same grasp with the
hand alone: with the library's friction, which is what `evaluate --mode arm` does, and again with
0.4 of it, as most grasps hold by far with all of it.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mixed_grasps import SLIPPERY, sampled_set

import burg_drake as burg
from burg_drake.core import Array
from burg_drake.motion import ArmReach, Plan, Planner
from burg_drake.scene import Scene
from burg_drake.simulation import ArmTrial, HandTrial, TrialResult
from burg_drake.station import Engine, Station, as_engine

SAMPLED = 400
"""Grasps that are sampled for each one that is wanted: few are clear in a bin or on a shelf."""
ASKED = 4
"""Clear ones that are asked about for each one that is wanted, at most."""
HEAD = (
    "| station | engine | friction | trials | held | same outcome | both hold or neither"
    " | arm, median (mean) | hand alone | joint error, median (most) | grasp frame |\n"
    "|---|---|---|---|---|---|---|---|---|---|---|"
)


@dataclass(frozen=True)
class Planned:
    """A grasp with its plan: number, pose (4, 4) in the frame of an instance."""

    instance: str
    number: int
    X_OG: Array
    plan: Plan


@dataclass(frozen=True)
class Row:
    """One grasp, executed both ways.

    Attributes:
        name: instance and number.
        arm, hand: what became of it.
        arm_cpu, hand_cpu: CPU time [s].
    """

    name: str
    arm: TrialResult
    hand: TrialResult
    arm_cpu: float
    hand_cpu: float

    @property
    def equal(self) -> bool:
        """The same outcome."""
        return self.arm.outcome is self.hand.outcome

    @property
    def alike(self) -> bool:
        """Both hold the target, or neither does."""
        return self.arm.outcome.held == self.hand.outcome.held


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    stations = ["panda_tabletop", "panda_bin", "panda_shelf"]
    parser.add_argument("--stations", nargs="+", default=stations)
    parser.add_argument("--engines", nargs="+", type=as_engine, default=["standard"])
    parser.add_argument("--grasps", type=int, default=8, help="to execute, for each object")
    parser.add_argument("--whole", action="store_true", help="simulate every trial to its end")
    arguments = parser.parse_args()
    scene = burg.load_scene(arguments.scene)
    table, notes = [HEAD], []
    for name in arguments.stations:
        station = burg.load_station(name)
        planned = list(plans(scene, station, arguments.grasps))
        print(f"{len(planned)} plans on {name}", flush=True)
        for preset in arguments.engines:
            engine = as_engine(preset)
            engine = replace(engine, whole_trial=arguments.whole or engine.whole_trial)
            for share in (1.0, SLIPPERY):
                rows = list(execute(scene, station, engine, planned, share))
                label = "the library's" if share == 1.0 else f"{share:g} of it"
                table.append(line(f"| {name} | {engine.name} | {label} ", rows))
                notes.append(f"{name}, {engine.name}, {label} friction: {pushes(rows)}")
                notes += [difference(row) for row in rows if not row.equal]
                print(f"{table[-1]}\n{notes[-1]}", flush=True)
    print("\n".join(["", *table, "", *notes]))


def plans(scene: Scene, station: Station, count: int) -> Iterator[Planned]:
    """The first `count` grasps of each instance that are clear and feasible, with their plans."""
    planner = Planner(ArmReach(scene, station))
    clearance = HandTrial(scene, station).clearance
    for name in scene.instances:
        sampled = sampled_set(scene, station, name, SAMPLED * count)
        X_WG = station.document.X_WS.matrix() @ scene.X_SO(name) @ sampled.X_OG
        screened = clearance.check_all(name, X_WG)
        clear = [k for k, verdict in enumerate(screened) if verdict.outcome is None]
        clear = clear[: ASKED * count]
        width = sampled.width[clear]
        found = planner.reach.check_all([name] * len(clear), X_WG[clear], width)
        feasible = [k for k, reach in enumerate(found) if reach.path is not None][:count]
        for k in feasible:
            arm_path = found[k].path
            assert arm_path is not None
            plan = planner.time(name, arm_path, float(width[k]))
            yield Planned(name, k, sampled.X_OG[clear[k]], plan)


def execute(
    scene: Scene, station: Station, engine: Engine, planned: Sequence[Planned], share: float
) -> Iterator[Row]:
    """Executes plans with the arm, and their grasps with the hand alone, with a share of the
    objects' friction."""
    hand_trial = HandTrial(scene, station, engine=engine)
    arm_trial = ArmTrial(scene, station, engine=engine, clearance=hand_trial.clearance)
    for each in planned:
        mu = share * scene.entry(each.instance).friction
        start = time.process_time()
        arm = arm_trial.run(each.instance, each.X_OG, each.plan, friction=mu)
        middle = time.process_time()
        hand = hand_trial.run(each.instance, each.X_OG, friction=mu)
        end = time.process_time()
        yield Row(f"{each.instance} {each.number}", arm, hand, middle - start, end - middle)


def line(label: str, rows: Sequence[Row]) -> str:
    """A line of the table, in the columns of `HEAD`."""
    if not rows:
        return f"{label}| 0 |"
    arm, hand = np.array([(row.arm_cpu, row.hand_cpu) for row in rows]).T
    margins = [row.arm.margins for row in rows]
    angle = 1e3 * known([m.tracking_error for m in margins])
    distance = 1e3 * known([m.tracking_distance for m in margins])
    cells = [
        str(len(rows)),
        str(sum(row.arm.outcome.held for row in rows)),
        share_of(sum(row.equal for row in rows), len(rows)),
        share_of(sum(row.alike for row in rows), len(rows)),
        f"{np.median(arm):.2f} s ({arm.mean():.2f})",
        f"{np.median(hand):.2f} s ({hand.mean():.2f})",
        f"{np.median(angle):.1f} mrad ({angle.max():.1f})",
        f"{np.median(distance):.1f} mm ({distance.max():.1f})",
    ]
    return f"{label}| {' | '.join(cells)} |"


def pushes(rows: Sequence[Row]) -> str:
    """What the approaches touched and pushed, and how all ended."""
    pushed = 1e3 * known([row.arm.margins.pushed for row in rows])
    outcomes = dict(Counter(str(row.arm.outcome) for row in rows))
    touched = dict(Counter(row.arm.touched for row in rows if row.arm.touched))
    return f"{outcomes}, touched {touched}, pushed by at most {pushed.max():.2f} mm"


def known(values: Sequence[float]) -> Array:
    """Those that are not NaN; 0 if all are."""
    finite = np.array([value for value in values if np.isfinite(value)])
    return finite if len(finite) else np.zeros(1)


def share_of(count: int, of: int) -> str:
    """For people."""
    return f"{count} of {of} ({100 * count / of:.1f} %)"


def difference(row: Row) -> str:
    """How the two ends of a grasp differ."""
    arm, hand = row.arm, row.hand
    return (
        f"  {row.name}: arm {arm.outcome}{f' ({arm.blocker})' if arm.blocker else ''}, hand"
        f" {hand.outcome}{f' ({hand.blocker})' if hand.blocker else ''};"
        f" slip {1e3 * arm.margins.slip:.1f} and {1e3 * hand.margins.slip:.1f} mm,"
        f" tilt {np.rad2deg(arm.margins.tilt):.1f} and {np.rad2deg(hand.margins.tilt):.1f} deg,"
        f" lift {arm.margins.lift:.3f} and {hand.margins.lift:.3f} m, others moved by"
        f" {1e3 * arm.margins.others_moved:.1f} and {1e3 * hand.margins.others_moved:.1f} mm"
        f"{f', touched {arm.touched}' if arm.touched else ''}"
    )


if __name__ == "__main__":
    main()
