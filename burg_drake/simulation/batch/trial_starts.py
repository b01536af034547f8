"""Trials of one target as rows of arrays: where hand and target begin, the way of the hand, and
how the trials end."""

from __future__ import annotations

from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np

from burg_drake.core import Array, Indices, inverse
from burg_drake.simulation.hand_carrier import check_count
from burg_drake.simulation.mujoco_trial import MujocoTrial
from burg_drake.simulation.shaking import shake_checks, turning_axis


class End(IntEnum):
    """How trials end on the device.

    Attributes:
        RUNNING: not yet.
        HELD: held to the end.
        HELD_IF_FREE: held to the end if the rest of the lift is free of obstacles.
        SLIPPED, DROPPED, ONE_FINGER, CLOSED_EMPTY, NO_CONTACT, BLOCKED: see `Outcome`.
        OTHER_TOUCHED: the trial needs the complete world.
        UNPLANNED_TOUCH: the hand touched something on its approach, or later something fixed.
        NOT_FINITE: the simulation failed.
        OVERFLOW: there were more contacts than there is room for.
    """

    RUNNING = 0
    HELD = 1
    HELD_IF_FREE = 2
    SLIPPED = 3
    DROPPED = 4
    ONE_FINGER = 5
    CLOSED_EMPTY = 6
    NO_CONTACT = 7
    BLOCKED = 8
    OTHER_TOUCHED = 9
    UNPLANNED_TOUCH = 10
    NOT_FINITE = 11
    OVERFLOW = 12


@dataclass(frozen=True, eq=False)
class TrialStarts:
    """Trials of one target to execute; one row each.

    Attributes:
        p_WH, R_WH: (N, 3), (N, 3, 3) start of the hand.
        p_GO, R_GO: the target in the grasp frame at the start.
        fingers: (N, 2) positions of the fingers at the start [m].
        friction, mass: (N,) of the target.
        pads: (N, 2, 3) see `MujocoWorld.pad_contacts`.
        early: (N,) whether the trial may end before the end of its lift.
        turn_sign: (N,) sense in which a shaken hand turns first, see `turning_axis`.
        ways: (N, 3, 4) approach, if any, and one or two segments: direction and length [m].
        checks: (N, 3) number of contact checks of each; 0 if there is none.
        time: (N,) duration of the segments with the target [s].
    """

    p_WH: Array
    R_WH: Array
    p_GO: Array
    R_GO: Array
    fingers: Array
    friction: Array
    mass: Array
    pads: Array
    early: Array
    turn_sign: Array
    ways: Array
    checks: Array
    time: Array

    def __len__(self) -> int:
        return len(self.p_WH)

    def at(self, rows: Indices) -> TrialStarts:
        """Some of the trials."""
        return TrialStarts(*(getattr(self, field.name)[rows] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class TrialEnds:
    """How trials ended; one row each, see `Trials`."""

    end: Array
    check: Array
    slip: Array
    tilt: Array
    force: Array
    spheres: Array
    lift: Array
    left: Array
    pushed: Array
    blocker: Array
    p_WO: Array
    q_WO: Array
    last_fingers: Array
    travelled: Array
    p_WG: Array
    others_moved: Array
    others_turned: Array
    others_toppled: Array
    others_p: Array
    others_q: Array


@dataclass(frozen=True, eq=False)
class Loads:
    """What may differ between trials of a target; one row each.

    Attributes:
        friction, mass: (N,) of the target.
        lift: (N,) length of the lift [m].
    """

    friction: Array
    mass: Array
    lift: Array


def trial_starts(
    trial: MujocoTrial, instance: str, X_WG: Array, loads: Loads, pads: Array
) -> TrialStarts:
    """Starts of trials.

    Args:
        trial: executes such trials one by one.
        instance: the target.
        X_WG: (N, 4, 4) grasps in the world at which the open hand is clear.
        loads: what differs between them.
        pads: (N, 2, 3) see `MujocoWorld.pad_contacts`.

    Raises:
        InvalidInputError: the hand would not move.
    """
    hand, X_WO, approaches = trial.station.hand, trial.X_WO(instance), trial.approaches
    X_WF = [trial.X_WG_start(X) for X in X_WG]
    X_GH = inverse(hand.X_HG.matrix())
    # One by one: products of stacked matrices may differ in the last bit.
    X_WH = np.array([X @ X_GH for X in X_WF])
    X_GO = np.array([inverse(X) @ X_WO for X in X_WF])
    closed = np.zeros(len(X_WG)) if approaches else trial.closed_before_contacts(instance, X_WG)
    ways, checks, time = _ways(trial, X_WG, loads.lift)
    return TrialStarts(
        p_WH=X_WH[:, :3, 3],
        R_WH=X_WH[:, :3, :3],
        p_GO=X_GO[:, :3, 3],
        R_GO=X_GO[:, :3, :3],
        fingers=np.array([[f.position(c) for f in hand.fingers] for c in closed.tolist()]),
        friction=loads.friction,
        mass=loads.mass,
        pads=pads,
        early=np.full(len(X_WG), not trial.engine.whole_trial),
        turn_sign=np.array([turning_axis(X[:3, :3].T)[0] for X in X_GO]),
        ways=ways,
        checks=checks,
        time=time,
    )


def _ways(trial: MujocoTrial, X_WG: Array, lift: Array) -> tuple[Array, Array, Array]:
    """The `ways`, `checks` and `time` of trials."""
    settings, n = trial.settings, len(X_WG)
    ways = np.zeros((n, 3, 4))
    if settings.shake is not None:
        ways[:, 1, 2] = 1.0
        checks = np.tile([0.0, shake_checks(settings), 0.0], (n, 1))
        return ways, checks, np.full(n, settings.shake.duration)
    if trial.approaches:
        ways[:, 0, :3], ways[:, 0, 3] = X_WG[:, :3, 2], trial.motion.standoff
    for way, X, height in zip(ways, X_WG, lift.tolist(), strict=True):
        for row, path in enumerate(trial.lift_paths(X, height), start=1):
            way[row] = *path.direction_W, path.length
    lengths, inverse_rows = np.unique(ways[:, :, 3], return_inverse=True)
    counts = [check_count(length, settings) if length else 0 for length in lengths]
    times = np.array([settings.time_of(length) for length in lengths])
    at = inverse_rows.reshape(n, 3)
    return ways, np.array(counts, dtype=float)[at], times[at[:, 1]] + times[at[:, 2]]
