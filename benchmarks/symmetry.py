"""Verdicts of the same physical grasp: fingers swapped, and the world turned.

    python benchmarks/symmetry.py [SCENE] [--station S] [--trials N] [--turn DEGREES]

Prints how many outcomes of executed trials change. The PyBullet peer (BURG-Toolkit) changes 8.8 %
of its verdicts with the fingers swapped and 5.6 % with the world turned by 37 degrees.
"""

from __future__ import annotations

import argparse
import dataclasses

import numpy as np

import burg_drake as burg
from burg_drake.core.content import rng_from
from burg_drake.core.frames import make_pose, rot_z, swap_fingers
from burg_drake.core.schema import Pose
from burg_drake.station.station import Station, Table


def turned(station: Station, angle: float) -> Station:
    """The station without its arm on a large table, the board turned about the world's z axis."""
    X_WS = make_pose(rot_z(angle)) @ station.document.X_WS.matrix()
    document = dataclasses.replace(
        station.document,
        arm=None,
        X_WS=Pose.from_matrix(X_WS, quaternion=True),
        table=Table(size=(4.0, 4.0, 0.1), friction=station.document.table.friction),
    )
    return dataclasses.replace(station, document=document, arm_model=None)


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", nargs="?", default="tabletop_six")
    parser.add_argument("--station", default="panda_tabletop")
    parser.add_argument("--trials", type=int, default=20, help="for each object, at most")
    parser.add_argument("--turn", type=float, default=37.0)
    arguments = parser.parse_args()
    scene, station = burg.load_scene(arguments.scene), burg.load_station(arguments.station)
    here = burg.HandTrial(scene, turned(station, 0.0))
    there = burg.HandTrial(scene, turned(station, np.deg2rad(arguments.turn)))
    executed, swapped, moved = 0, 0, 0
    for name in scene.instances:
        entry = scene.entry(name)
        down_O = -here.diagram.X_WO(name)[2, :3]
        cone = burg.ApproachCone(tuple(down_O), np.deg2rad(75.0))
        rng = rng_from("symmetry", name)
        grasps = burg.sample_antipodal(
            scene.library.surface(scene.instance(name).object),
            1000,
            rng,
            friction=entry.friction,
            approach_cone=cone,
        )
        count = 0
        for X_OG in grasps.X_OG:
            clear = here.clearance.check(name, here.diagram.X_WO(name) @ X_OG).outcome is None
            if not clear or count == arguments.trials:
                continue
            count += 1
            one = here.run(name, X_OG)
            other, elsewhere = here.run(name, swap_fingers(X_OG)), there.run(name, X_OG)
            for label, result in (("swapped", other), ("turned", elsewhere)):
                if result.outcome is not one.outcome:
                    print(f"{name} {label}: {one.outcome} {one.margins}")
                    print(f"    {result.outcome} {result.margins}")
            swapped += other.outcome is not one.outcome
            moved += elsewhere.outcome is not one.outcome
        executed += count
        print(f"{name:20} {count} trials", flush=True)
    for label, flips, peer in (("swapped", swapped, 8.8), ("turned", moved, 5.6)):
        print(
            f"{label}: {flips} of {executed} verdicts change ({flips / executed:.1%}, peer {peer}%)"
        )


if __name__ == "__main__":
    main()
