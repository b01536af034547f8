"""The reach check of arms without a closed form: on the Panda held against the closed form, and on
the UR5e against that of a user, which is plain Python.

    python benchmarks/numeric_reach.py [--scene S] [--grasps N] [--plain N] [--audit N]

Grasps, speed, audit and the judge by SNOPT and RRT are those of `benchmarks/reach.py`.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

from reach import STEP, Grasps, clear_grasps
from reach_audit import Audit
from reach_judges import Plain, World

from burg_drake.core import inverse
from burg_drake.motion import ArmReach, IkRoutine, Reach, ReachSettings
from burg_drake.scene import Scene, load_scene
from burg_drake.station import GraspMotion, Station, load_station

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "motion"))
import ur_ik


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scene", default="tabletop_six")
    parser.add_argument("--grasps", type=int, default=200)
    parser.add_argument("--plain", type=int, default=30, help="judged by SNOPT and RRT, too")
    parser.add_argument("--audit", type=int, default=60, help="motions that are audited")
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene)

    panda = load_station("panda_tabletop")
    grasps = clear_grasps(scene, panda, arguments.grasps)
    swept = judge("Panda, closed form", scene, panda, grasps)
    numeric = ReachSettings(closed_form=False, motion=GraspMotion())
    compare(swept, judge("Panda, numeric", scene, panda, grasps, settings=numeric))

    ur5e = load_station("ur5e_tabletop")
    grasps = clear_grasps(scene, ur5e, arguments.grasps)
    found = judge("UR5e, numeric", scene, ur5e, grasps)
    assert ur5e.document.arm is not None
    X_HF = inverse(ur5e.document.arm.X_FH.matrix())
    own = judge(
        "UR5e, routine", scene, ur5e, grasps, ik=lambda X_AH: [ur_ik.solve(X @ X_HF) for X in X_AH]
    )
    compare(own, found)
    against_drake(scene, ur5e, grasps, found, arguments)


def judge(
    label: str,
    scene: Scene,
    station: Station,
    grasps: Grasps,
    *,
    settings: ReachSettings | None = None,
    ik: IkRoutine | None = None,
) -> list[Reach]:
    """Judges all grasps and prints how many a second."""
    arm = ArmReach(scene, station, settings=settings, ik=ik)
    arm.check_all(grasps.instance[:1], grasps.X_WG[:1], grasps.width[:1])
    start = time.process_time()
    found = arm.check_all(grasps.instance, grasps.X_WG, grasps.width)
    rate = len(found) / (time.process_time() - start)
    counts = Counter(str(reach.outcome or "reached") for reach in found)
    print(f"{label}: {rate:.0f} grasps/s; {dict(counts.most_common())}", flush=True)
    return found


def compare(expected: list[Reach], found: list[Reach]) -> None:
    """Prints how far two judges agree."""
    pairs = [(a.outcome, b.outcome) for a, b in zip(expected, found, strict=True)]
    alike = sum((a is None) == (b is None) for a, b in pairs)
    same = sum(a == b for a, b in pairs)
    both, yes = sum(a is b is None for a, b in pairs), sum(a is None for a, _ in pairs)
    print(
        f"  reached or not alike {alike}, same outcome {same} of {len(pairs)}; found {both}/{yes}"
    )


def against_drake(
    scene: Scene,
    station: Station,
    grasps: Grasps,
    found: list[Reach],
    arguments: argparse.Namespace,
) -> None:
    """Audits motions, and asks the judge by SNOPT and RRT about as many yes as no."""
    motion = GraspMotion()
    world = World(scene, station, motion.standoff, motion.lift_height)
    reached = [k for k, reach in enumerate(found) if reach.path is not None]
    audited = reached[: arguments.audit]
    audit, faults = Audit(scene, station), 0
    for k in audited:
        arm_path = found[k].path
        assert arm_path is not None
        width = float(grasps.width[k])
        faults += bool(audit.faults(grasps.instance[k], arm_path, width, step=STEP))
    print(f"  audit: {faults} of {len(audited)} motions collide")
    refused = [
        k
        for k, reach in enumerate(found)
        if reach.outcome is not None and not reach.outcome.value.startswith("hand")
    ]
    plain = Plain(world)
    for label, which in (("reached", reached), ("refused", refused)):
        few = which[: arguments.plain // 2]
        yes = sum(plain.check(grasps.instance[k], grasps.X_WG[k]) for k in few)
        print(f"  SNOPT and RRT reach {yes} of {len(few)} that were {label}", flush=True)


if __name__ == "__main__":
    main()
