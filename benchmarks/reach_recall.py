"""Which grasps that can be reached are said to be: against a judge that proves it, and against the
numeric search of an arm that has a closed form.

A grasp counts as one that can be reached if any of them has a motion for it. Each motion that is
found for a grasp to which we say no is gone through by the audit of `reach_audit`, too, and counts
only if nothing collides in it.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from reach_audit import Audit
from reach_prover import Prover

from burg_drake.core import Array, wilson_interval
from burg_drake.motion import ArmPath, ArmReach, Reach, ReachSettings
from burg_drake.scene import Scene
from burg_drake.station import GraspMotion, Station

STEP = 0.003
"""Of the audit of motions that we have missed [m]."""


@dataclass(frozen=True)
class Recall:
    """What became of grasps that can be reached.

    Attributes:
        found: how many of them are said to be reached.
        known: how many are known to be.
        missed: what is said of the others.
    """

    found: int
    known: int
    missed: tuple[str, ...] = ()

    def __str__(self) -> str:
        low, high = wilson_interval(self.found, self.known)
        return f"{self.found} of {self.known} ({100.0 * low:.1f} to {100.0 * high:.1f} %)"

    @classmethod
    def total(cls, parts: Iterable[Recall]) -> Recall:
        """Of several sets together."""
        every = list(parts)
        missed = tuple(reason for part in every for reason in part.missed)
        return cls(sum(p.found for p in every), sum(p.known for p in every), missed)


def recall(
    scene: Scene,
    station: Station,
    grasps: tuple[list[str], Array, Array],
    ours: list[Reach],
    settings: ReachSettings,
) -> Recall:
    """Looks for motions to the grasps to which we say no, and prints what it finds.

    Args:
        scene, station: what stands where.
        grasps: N targets, poses in the world (N, 4, 4) and widths (N,).
        ours: what we say.
        settings: with which.
    """
    instance, X_WG, width = grasps
    refused = [k for k, reach in enumerate(ours) if reach.outcome is not None]
    start = time.process_time()
    motions = _proven(scene, station, grasps, refused, settings.motion or GraspMotion())
    proven = len(motions)
    if refused:  # of an arm without a closed form the same again
        numeric = ArmReach(scene, station, settings=replace(settings, closed_form=False))
        again = numeric.check_all([instance[k] for k in refused], X_WG[refused], width[refused])
        for k, reach in zip(refused, again, strict=True):
            if reach.path is not None:
                motions.setdefault(k, reach.path)
    audit = Audit(scene, station)
    missed = [
        f"{instance[k]} {k}: {ours[k].outcome} {ours[k].blocker}".rstrip()
        for k, motion in sorted(motions.items())
        if not audit.faults(instance[k], motion, float(width[k]), step=STEP)
    ]
    found = len(ours) - len(refused)
    said = Recall(found, found + len(missed), tuple(missed))
    seconds = time.process_time() - start
    print(f"  recall: {said}; of {len(refused)} refused, {proven} were proven in {seconds:.0f} s")
    for reason in missed:
        print(f"    missed: {reason}")
    return said


def _proven(
    scene: Scene,
    station: Station,
    grasps: tuple[list[str], Array, Array],
    refused: list[int],
    motion: GraspMotion,
) -> dict[int, ArmPath]:
    """Motions of the independent judge, by the number of the grasp."""
    assert motion.retreat == 0.0 and np.array_equal(motion.direction_W, (0.0, 0.0, 1.0))
    prover = Prover(scene, station, motion.standoff, motion.lift_height)
    motions = {}
    for k in refused:
        proof = prover.prove(grasps[0][k], grasps[1][k], float(grasps[2][k]))
        if proof is not None:
            motions[k] = ArmPath(
                X_WG=proof.X_WG,
                transfer=proof.transfer,
                approach=proof.approach,
                lift=proof.lift,
                clearance=0.0,
            )
    return motions
