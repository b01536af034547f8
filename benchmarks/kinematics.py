"""Inverse kinematics of the Panda: time of the closed form, and what it finds again.

    python benchmarks/kinematics.py [--postures N] [--poses N] [--sweep M]

Solves for the hand poses of random postures within the joint limits, each with its own last joint,
and looks for the posture among the solutions; then for some poses with a sweep of the last joint.
Prints CPU time for a pair of pose and joint value, beside the numeric search of this project (one
start a pair), and the largest error of hand poses.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from burg_drake.core import Array
from burg_drake.motion import ArmReach, PandaIk, panda_forward, solve_ik
from burg_drake.scene import load_scene
from burg_drake.station import load_station

TARGET = 1.0
"""Of a pair of pose and joint value [microseconds]."""
FOUND = 1e-7
"""Joint error up to which a posture counts as found again [rad]."""
STARTS = 2000


def main() -> None:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--postures", type=int, default=100_000)
    parser.add_argument("--poses", type=int, default=4000)
    parser.add_argument("--sweep", type=int, default=32, help="values of the last joint")
    arguments = parser.parse_args()
    arm = ArmReach(load_scene("tabletop_six"), load_station("panda_tabletop")).kinematics
    ik = PandaIk.of(arm)
    assert ik is not None
    rng = np.random.default_rng(0)
    q = rng.uniform(ik.lower, ik.upper, (arguments.postures, 7))
    X_AH = panda_forward(q) @ ik.X_FH
    seconds, found = cpu(ik.solve, X_AH, q[:, 6:])
    error = np.full(len(q), np.inf)
    np.minimum.at(error, found.pose, np.abs(found.q - q[found.pose]).max(axis=1))
    off = np.abs(panda_forward(found.q) @ ik.X_FH - X_AH[found.pose]).max()
    print(
        f"{len(q):,} random postures: {(error > FOUND).sum()} not found again, joints off by"
        f" {error.max():.1e} rad at most, hand poses by {off:.1e}; {len(found) / len(q):.1f}"
        f" solutions and {seconds / len(q) * 1e6:.2f} microseconds each"
    )
    some = X_AH[: arguments.poses]
    q7 = np.linspace(ik.lower[6], ik.upper[6], arguments.sweep)
    best = min(cpu(ik.solve, some, q7)[0] for _ in range(3))
    pair = best / len(some) / len(q7) * 1e6
    print(f"sweep of {len(q7)}: {pair:.2f} microseconds a pair (target {TARGET:g})")
    start = rng.uniform(ik.lower, ik.upper, (STARTS, 7))
    seconds, (_, met) = cpu(numeric, arm, X_AH[:STARTS], start)
    each = seconds / STARTS * 1e6
    print(
        f"numeric, a start a pose: {each:.0f} microseconds ({each / pair:.0f} times), meets"
        f" {met.mean():.0%}"
    )


def numeric(arm, X_AH: Array, start: Array):  # type: ignore[no-untyped-def]
    """The numeric search from one start each."""
    return solve_ik(arm, X_AH, start, iterations=15, tolerance=1e-6)


def cpu(function, *arguments):  # type: ignore[no-untyped-def]
    """CPU time of a call [s], and its result."""
    start = time.process_time()
    result = function(*arguments)
    return time.process_time() - start, result


if __name__ == "__main__":
    main()
