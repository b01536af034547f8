"""Grasps under a shelf board and under a table, by how the hand leaves them.

    python benchmarks/lift_room.py [--scene S] [--grasps N] [--audit N]

The stations are those of `benchmarks/confined`, the grasps those of `benchmarks/reach.py`:
antipodal ones at which the open hand is clear. Motions are audited as there, in a diagram of their
own with the target in the hand.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np
from reach import STEP, Grasps, cause_of, clear_grasps
from reach_audit import Audit

from burg_drake.motion import ArmReach, ReachSettings
from burg_drake.scene import Scene, load_scene
from burg_drake.station import GraspMotion, Station, load_station

STATIONS = Path(__file__).parent / "confined"
MOTIONS = {
    "up by 1 mm": GraspMotion(lift_height=0.001),
    "up by 30 cm": GraspMotion(),
    "up by 30 cm, or as far as there is room, at least 2 cm": GraspMotion(least_lift=0.02),
    "back by 10 cm, then up by 30 cm": GraspMotion(retreat=0.10),
    "back by 10 cm, then up as far as there is room": GraspMotion(retreat=0.10, least_lift=0.0),
}


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--scene", default="tabletop_six")
    parser.add_argument("--grasps", type=int, default=200)
    parser.add_argument("--audit", type=int, default=15, help="motions that are audited")
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene)
    for path in sorted(STATIONS.glob("*.yaml")):
        station = load_station(path)
        grasps = clear_grasps(scene, station, arguments.grasps)
        print(f"\n{scene.name}, {station.name}: {len(grasps.instance)} grasps", flush=True)
        for label, motion in MOTIONS.items():
            judge(label, scene, station, grasps, motion, arguments.audit)


def judge(
    label: str, scene: Scene, station: Station, grasps: Grasps, motion: GraspMotion, most: int
) -> None:
    """Judges the grasps with one motion, audits some, and prints what comes of it."""
    arm = ArmReach(scene, station, settings=ReachSettings(motion=motion))
    start = time.process_time()
    found = arm.check_all(grasps.instance, grasps.X_WG, grasps.width)
    rate = len(found) / (time.process_time() - start)
    reached = [k for k, reach in enumerate(found) if reach.outcome is None]
    print(f"  {label}: {len(reached)} of {len(found)} reached, {rate:.1f} grasps/s")
    if reached:
        low, middle, high = np.quantile([found[k].lift for k in reached], (0.0, 0.5, 1.0))
        print(f"    lifted by {low:.2f} to {high:.2f} m, {middle:.2f} in the median")
    causes = Counter(cause_of(reach) for reach in found if reach.outcome is not None)
    print("    " + "; ".join(f"{count} x {cause}" for cause, count in causes.most_common(4)))
    audit, faults = Audit(scene, station), 0
    for k in reached[:most]:
        arm_path = found[k].path
        assert arm_path is not None
        width = float(grasps.width[k])
        faults += bool(audit.faults(grasps.instance[k], arm_path, width, step=STEP))
    print(f"    audit: {faults} of {len(reached[:most])} motions collide", flush=True)


if __name__ == "__main__":
    main()
