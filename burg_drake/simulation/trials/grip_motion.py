"""How the target moves in the hand: since the grip, and from look to look, which decides trials
before their end."""

from __future__ import annotations

import math

import numpy as np

from burg_drake.core import Array, inverse, rotation_angle
from burg_drake.simulation.trials.trial_settings import TrialSettings

LEVER = 0.01
"""Turning counts as the motion of a point so far from the grasp [m], which is at a pad's rim."""


class GripMotion:
    """Follows one target in the hand.

    Args:
        settings: phases of the trial.
        X_GO: (4, 4) target in the grasp frame at the start.
    """

    def __init__(self, settings: TrialSettings, X_GO: Array) -> None:
        self._settings = settings
        self._X_GO_last = X_GO
        self._X_GO_grip: Array | None = None
        self._motions: list[float] = []

    def grip(self) -> None:
        """Both fingers hold the target, as it was at the last look."""
        self._X_GO_grip = self._X_GO_last

    def look(self, X_GO: Array, *, others_rest: bool) -> None:
        """Takes down where the target is.

        Args:
            X_GO: (4, 4) target in the grasp frame.
            others_rest: whether all other objects are at rest; if not, what was before tells
                nothing any more of what is to come.
        """
        distance, angle = motion_in_hand(self._X_GO_last, X_GO)
        self._X_GO_last = X_GO
        if others_rest:
            self._motions.append(max(distance, angle * LEVER))
        else:
            self._motions.clear()

    def begin_again(self) -> None:
        """From now on only later looks tell what is to come."""
        self._motions.clear()

    @property
    def since_grip(self) -> tuple[float, float]:
        """Slip [m] and tilt [rad]; NaN if both fingers never held the target."""
        if self._X_GO_grip is None:
            return math.nan, math.nan
        return motion_in_hand(self._X_GO_grip, self._X_GO_last)

    @property
    def is_beyond_limits(self) -> bool:
        """Whether the target has turned or slid so far that it does not count as lifted."""
        slip, tilt = self.since_grip
        return slip > self._settings.slip_limit or tilt > self._settings.tilt_limit

    @property
    def is_steady(self) -> bool:
        """Whether the target has stuck to the pads for `steady_time`."""
        settings = self._settings
        recent = self._motions[-settings.steady_polls :]
        enough = len(recent) == settings.steady_polls
        return enough and max(recent) <= settings.creep_speed * settings.poll

    def is_coming_to_rest(self, time: float) -> bool:
        """Whether the target moves in the hand no faster than before, and not far any more.

        Drake's friction is slightly viscous: below its limit a load does not slide but creeps, at a
        constant speed that is the higher, the larger the time step.

        Args:
            time: that is left at most [s].
        """
        n = self._settings.steady_polls
        before, now = sum(self._motions[-2 * n : -n]), sum(self._motions[-n:])
        enough = len(self._motions) >= 2 * n
        return enough and now <= before and self._creep(time) <= self._settings.creep_distance

    def stays_on_one_side(self, time: float) -> bool:
        """Whether the target is beyond the limits for good, or will not come there, whatever creep
        still adds.

        Args:
            time: that is left at most [s].
        """
        settings, creep = self._settings, self._creep(time)
        slip, tilt = self.since_grip
        slid = creep * (1.0 + slip / LEVER)  # turning moves what has slid by its distance
        turned = creep / LEVER
        if slip - slid > settings.slip_limit or tilt - turned > settings.tilt_limit:
            return True
        most = min(math.pi, tilt + turned)
        return slip + slid <= settings.slip_limit and most <= settings.tilt_limit

    def _creep(self, time: float) -> float:
        """How far the target gets in a time [s] if it goes on as during the last looks [m]."""
        recent = self._motions[-self._settings.steady_polls :]
        return sum(recent) / len(recent) * (time / self._settings.poll)


def motion_in_hand(X_GO: Array, X_GO_later: Array) -> tuple[float, float]:
    """How a target has moved in the hand: of the point at the grasp [m], and its angle [rad]."""
    X_GG = X_GO_later @ inverse(X_GO)
    return float(np.linalg.norm(X_GG[:3, 3])), float(rotation_angle(X_GG[:3, :3]))
