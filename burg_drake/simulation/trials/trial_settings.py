"""Phases of a trial in numbers: where and how fast the hand goes, and what counts as rest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from burg_drake.core.documents import Ranges, require_ranges
from burg_drake.station.document import GraspMotion

LONGEST = 30.0
"""Of a phase [s]: 60 times what the phases take by default."""

USUAL_LIFT = 0.30
"""Length that `lift_time` is about [m]: that of the usual lift."""


@dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """Phases of a trial.

    Attributes:
        motion: where the hand goes; None if as the station says.
        lift_time: duration of a straight segment of 0.30 m with the target [s]: half of it
            accelerates and half of it brakes, as they do, as hard, on a shorter way.
        hold_time: how long the target must be held at the end of the way [s].
        creep_speed: a target that moves in the hand slower than this sticks to the pads [m/s] ...
        creep_distance: ... and one that does not get faster may go on by this much [m]; both decide
            trials early, see `Engine.whole_trial`.
        steady_time: how long that, and free air, and the rest of all others, must last [s].
        poll: interval at which contacts are looked at [s].
        settled_speed: the fingers have closed when they are slower than this [m/s] ...
        settled_time: ... for this long [s].
        close_timeout: closing ends after this time in any case [s]; for a slow hand, after twice
            the time that it takes to close.
        disturbance: others that are moved by more than this count as disturbed [m].
        tilt_limit: a target that has turned in the hand by more than this since the grip does not
            count as lifted, though it is held [rad]; pi: it may turn as it likes.
        slip_limit: likewise of one that has slid [m]; infinite: it may slide as it likes.
        approach: whether the hand alone begins at the pregrasp, and not at the grasp.
    """

    RANGES: ClassVar[Ranges] = {
        "lift_time": (1e-2, LONGEST),
        "hold_time": (0.0, LONGEST),
        "creep_speed": (0.0, 10.0),
        "creep_distance": (0.0, 10.0),
        "steady_time": (0.0, LONGEST),
        "poll": (1e-4, 1.0),
        "settled_speed": (0.0, 10.0),
        "settled_time": (0.0, LONGEST),
        "close_timeout": (0.0, LONGEST),
        "disturbance": (0.0, 10.0),
        "tilt_limit": (0.0, math.pi),
        "slip_limit": (0.0, math.inf),
    }
    """Values with which a trial ends, within minutes at the shortest steps, and is a trial."""

    motion: GraspMotion | None = None
    lift_time: float = 1.25
    hold_time: float = 0.5
    creep_speed: float = 0.0003
    creep_distance: float = 0.002
    steady_time: float = 0.05
    poll: float = 0.01
    settled_speed: float = 0.002
    settled_time: float = 0.03
    close_timeout: float = 2.0
    disturbance: float = 0.01
    tilt_limit: float = math.radians(30)
    slip_limit: float = 0.02
    approach: bool = False

    def __post_init__(self) -> None:
        require_ranges(self, "a trial")

    @property
    def acceleration(self) -> float:
        """Of the hand on its straight segments with the target [m/s^2]."""
        return 4.0 * USUAL_LIFT / self.lift_time**2

    def time_of(self, length: float) -> float:
        """Duration of a straight segment with the target [s], by its length [m]."""
        return self.lift_time * math.sqrt(length / USUAL_LIFT)

    @property
    def steady_polls(self) -> int:
        """Looks in `steady_time`."""
        return max(1, round(self.steady_time / self.poll))


NO_LIMITS = {"tilt_limit": math.pi, "slip_limit": math.inf}
"""What is held counts as lifted, however it lies in the hand."""
DEFAULT_TRIAL = TrialSettings()
"""The phases that `evaluate` and `replay` use."""
