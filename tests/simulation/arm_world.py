"""A Panda in the world of the trials' tests, and plans made without a planner."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from trial_world import make_station

from burg_drake.core import Array, Pose, inverse, make_pose, resolve_reference, rot_z
from burg_drake.motion import PandaIk, Plan, Trajectory
from burg_drake.simulation import ArmTrial
from burg_drake.station import Arm, Obstacle, Station

HOME = (0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4)
PANDA = resolve_reference("package://burg_drake/models/panda/panda_arm.sdf")
STANDOFF, LIFT = 0.1, 0.3
APPROACH_TIME, LIFT_TIME = 0.8, 1.4


def make_arm_station(angle: float = 0.0, obstacles: dict[str, Obstacle] | None = None) -> Station:
    """The Panda behind the board; all of it turned about the world's z axis by an angle [rad]."""
    X_WW = make_pose(rot_z(angle), np.zeros(3))
    station = make_station(Pose.from_matrix(X_WW, quaternion=True), obstacles)
    X_WA = Pose.from_matrix(X_WW @ make_pose(np.eye(3), (-0.2, 0.2, 0.0)), quaternion=True)
    document = replace(station.document, arm=Arm(X_WA=X_WA, home=HOME))
    return replace(station, document=document, arm_model=Path(PANDA))


def timed(q: Array, duration: float) -> Trajectory:
    """Through rows (K, n) at even distances, from rest to rest along a quintic, at 1 kHz."""
    t = np.arange(round(1e3 * duration) + 1) / 1e3
    u = t / duration
    s = u**3 * (10 - 15 * u + 6 * u**2)
    ds = 30 * u**2 * (1 - u) ** 2 / duration
    dds = 60 * u * (1 - u) * (1 - 2 * u) / duration**2
    way = CubicSpline(np.linspace(0.0, 1.0, len(q)), q)
    first = way(s, 1)
    v, a = first * ds[:, None], first * dds[:, None] + way(s, 2) * ds[:, None] ** 2
    return Trajectory(t, way(s), v, a)


def straight_plan(
    trial: ArmTrial, X_WG: Array, near: ArrayLike = HOME, retreat: float = 0.0
) -> Plan:
    """Straight to a grasp (4, 4), back by a retreat [m] and straight up, with a fixed last joint;
    of what is possible the one with the grasp closest to some posture (7,)."""
    arm = trial.diagram.station.document.arm
    joints = trial.diagram.arm_joints
    ik = PandaIk(
        arm.X_FH.matrix(),
        np.array([joint.position_lower_limits()[0] for joint in joints]),
        np.array([joint.position_upper_limits()[0] for joint in joints]),
    )
    steps = round(retreat / 0.01)
    back = [np.linspace(STANDOFF, 0.0, 11), np.linspace(0.0, retreat, steps + 1)[1:]]
    back = np.concatenate([*back, np.full(30, retreat)])
    up = np.append(np.zeros(11 + steps), np.linspace(0.01, LIFT, 30))
    X = np.repeat(X_WG[None], len(back), axis=0)
    X[:, :3, 3] += up[:, None] * (0.0, 0.0, 1.0) - back[:, None] * X_WG[:3, 2]
    X_AH = inverse(arm.X_WA.matrix()) @ trial.diagram.station.hand.X_AH(X)
    chains = []
    for q7 in np.linspace(-2.8, 2.8, 29):
        found = ik.solve(X_AH, [q7])
        chains += [found.q[found.branch == branch] for branch in set(found.branch.tolist())]
    chains = [q for q in chains if len(q) == len(X) and np.abs(np.diff(q, axis=0)).max() < 0.2]
    q = min(chains, key=lambda q: np.abs(q[10] - near).max())
    return Plan(
        transfer=timed(np.linspace(HOME, q[0], 5), 2.0),
        approach=timed(q[:11], APPROACH_TIME),
        retreat=timed(q[10 : 11 + steps], LIFT_TIME) if steps else None,
        lift=timed(q[10 + steps :], LIFT_TIME),
    )
