"""CPU time and recall of the arm's reach check, beside an exhaustive search and a plain baseline.

    python benchmarks/reach.py [SCENE] [--station S] [--grasps N] [--checks N] [--baseline N]

Samples grasps on every object of the scene, keeps those that the open hand is clear for, and judges
them: by the closed form, by the numeric search that serves other arms, and exhaustively by one that
starts from over 3,000 postures. The baseline is what Drake's tutorials suggest: `InverseKinematics`
with SNOPT, restarted at random, and Drake's collision checker.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.solvers import SnoptSolver

from burg_drake.core.content import rng_from
from burg_drake.core.frames import Array, inverse, pregrasp, swap_fingers
from burg_drake.core.outcome import Outcome
from burg_drake.grasping.antipodal import sample_antipodal
from burg_drake.grasping.clearance import HandClearance
from burg_drake.motion.reach import ArmReach, Reach, ReachSettings
from burg_drake.scene.scene import Scene, load_scene
from burg_drake.station.diagram import build_station_diagram
from burg_drake.station.station import Station, load_station

EXHAUSTIVE = ReachSettings(
    closed_form=False, starts=(32, 64, 128, 1024, 2048), postures=16384, iterations=25
)
NUMERIC = ReachSettings(closed_form=False)
BASELINE_STARTS = 10
"""Restarts of the baseline for each way to put the fingers."""


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--grasps", type=int, default=1000, help="sampled for each object")
    parser.add_argument("--checks", type=int, default=300, help="clear grasps to judge")
    parser.add_argument("--baseline", type=int, default=50, help="of them by the baseline, too")
    arguments = parser.parse_args()
    scene, station = load_scene(arguments.scene), load_station(arguments.station)
    clear = clear_grasps(scene, station, arguments.grasps)
    order = rng_from("benchmark reach").permutation(len(clear))[: arguments.checks]
    grasps = [clear[i] for i in order]
    print(f"{scene.name} on {station.name}: {len(clear)} clear grasps, {len(grasps)} judged")

    start = time.process_time()
    arm = ArmReach(scene, station)
    print(f"set-up {time.process_time() - start:.2f} s")
    found = report("reach", arm.check, grasps)
    numeric = ArmReach(scene, station, settings=NUMERIC)
    compare("numeric", found, report("numeric", numeric.check, grasps))
    exhaustive = ArmReach(scene, station, settings=EXHAUSTIVE)
    compare("exhaustive", found, report("exhaustive", exhaustive.check, grasps))
    few = grasps[: arguments.baseline]
    compare("baseline", found, report("baseline", Baseline(arm, station).check, few))


def clear_grasps(scene: Scene, station: Station, count: int) -> list[Array]:
    """`X_WG` of sampled grasps that the open hand is clear for."""
    diagram = build_station_diagram(scene, station, robot="hand")
    clearance = HandClearance(diagram)
    found = []
    for name in scene.instances:
        entry = scene.entry(name)
        mesh = scene.library.surface(scene.instance(name).object)
        rng = rng_from("benchmark reach", name)
        sampled = sample_antipodal(mesh, count, rng, friction=entry.friction)
        X_WG = diagram.X_WO(name) @ sampled.X_OG
        found += [X for X in X_WG if clearance.check(name, X).outcome is None]
    return found


def report(label: str, check: Callable[[Array], Reach], grasps: list[Array]) -> list[Reach]:
    """Judges grasps and prints the CPU time by outcome."""
    found: list[Reach] = []
    seconds: dict[str, list[float]] = defaultdict(list)
    for X_WG in grasps:
        start = time.process_time()
        found.append(check(X_WG))
        seconds[found[-1].outcome or "reached"].append(time.process_time() - start)
    print(f"{label}: {len(grasps) / sum(map(sum, seconds.values())):.0f} grasps/s")
    for outcome, times in sorted(seconds.items()):
        median, most, worst = np.percentile(np.array(times) * 1e3, (50, 90, 100))
        print(
            f"  {outcome:14}{len(times):5} {len(times) / len(grasps):7.1%}"
            f"  median {median:6.1f} ms, 90 % {most:6.1f}, largest {worst:6.1f}",
            flush=True,
        )
    return found


def compare(label: str, found: list[Reach], other: list[Reach]) -> None:
    """Prints how many of the other's grasps were found, and the other way round."""
    pairs = [(a.outcome is None, b.outcome is None) for a, b in zip(found, other, strict=False)]
    theirs, ours = sum(b for _, b in pairs), sum(a for a, _ in pairs)
    both = sum(a and b for a, b in pairs)
    print(f"  of {theirs} that {label} reaches, {both} reached; of ours {both} of {ours}")


class Baseline:
    """SNOPT on the arm alone, restarted at random; same collision checks and same two goals."""

    def __init__(self, arm: ArmReach, station: Station) -> None:
        self._arm, self._station = arm, station
        self._plant = MultibodyPlant(0.0)
        self._hand = self._add_robot()
        self._plant.Finalize()

    def _add_robot(self) -> RigidBody:
        plant, station, arm = self._plant, self._station, self._station.document.arm
        assert arm is not None
        parser = Parser(plant)
        (model,) = parser.AddModels(str(station.arm_model))
        (hand,) = parser.AddModels(str(station.hand_model))
        base, flange = (plant.GetFrameByName(name, model) for name in (arm.base, arm.flange))
        body = plant.GetBodyByName(station.hand.body, hand)
        plant.WeldFrames(plant.world_frame(), base, RigidTransform(arm.X_WA.matrix()))
        plant.WeldFrames(flange, body.body_frame(), RigidTransform(arm.X_FH.matrix()))
        return body

    def check(self, X_WG: Array) -> Reach:
        """As `ArmReach.check`."""
        rng = rng_from("baseline", X_WG)
        kinematics, margin = self._arm.kinematics, self._arm.settings.limit_margin
        outcome = Outcome.NO_IK
        for X in (X_WG, swap_fingers(X_WG)):
            for _ in range(BASELINE_STARTS):
                q = self._solve(
                    X, rng.uniform(kinematics.lower + margin, kinematics.upper - margin)
                )
                if q is None:
                    continue
                q_before = self._solve(pregrasp(X, self._arm.settings.standoff), q)
                if q_before is None:
                    continue
                if self._arm.collision.is_free(q) and self._arm.collision.is_free(q_before):
                    return Reach(None, q, q_before)
                outcome = Outcome.ARM_COLLISION
        return Reach(outcome)

    def _solve(self, X_WG: Array, start: Array) -> Array | None:
        X_WH = X_WG @ inverse(self._station.hand.X_HG.matrix())
        problem = InverseKinematics(self._plant)
        world, hand = self._plant.world_frame(), self._hand.body_frame()
        problem.AddPositionConstraint(
            hand, np.zeros(3), world, X_WH[:3, 3] - 1e-5, X_WH[:3, 3] + 1e-5
        )
        R_WH = RotationMatrix(X_WH[:3, :3])
        problem.AddOrientationConstraint(world, R_WH, hand, RotationMatrix(), 1e-4)
        problem.prog().SetInitialGuess(problem.q(), np.concatenate([start, (0.04, 0.04)]))
        result = SnoptSolver().Solve(problem.prog())
        return result.GetSolution(problem.q())[: len(start)] if result.is_success() else None


if __name__ == "__main__":
    main()
