"""Settings of trials, of robustness tests, and of settling; no simulator is loaded for them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal, get_args

from burg_drake.core import InvalidInputError, Ranges, Units, require_ranges, setting
from burg_drake.station import GraspMotion

MAX_PHASE_DURATION = 30.0
"""Seconds. 60 times what the phases take by default."""

REFERENCE_LIFT_LENGTH = 0.30
"""Metres. Length that `lift_time` refers to."""


TrialProtocol = Literal["lift", "shake"]
"""What a hand does with a gripped target: lift it off the table, or shake it, alone and without
gravity."""
TRIAL_PROTOCOLS: tuple[TrialProtocol, ...] = get_args(TrialProtocol)


@dataclass(frozen=True, kw_only=True)
class ShakeSettings:
    """Shaking of the hand with a weightless target, in place of the lift.

    The hand closes, goes to and fro along its approach, and turns to and fro about its closing
    axis: the order and the axes of Eppner et al., "ACRONYM" (2021). In each period it goes to one
    side and back, `s (1 - cos(2 pi f t)) / 2` for a stroke s and frequency f, and to the other side
    in the next. By default the load of each part is about that of gravity.

    Attributes:
        shake_acceleration: largest acceleration along the approach [m/s^2].
        turn_acceleration: largest angular acceleration about the closing axis [rad/s^2].
        shake_frequency: periods a second of both [Hz].
        shake_periods: number of periods of each.
    """

    RANGES: ClassVar[Ranges] = {
        "shake_acceleration": (0.0, 1e3),
        "turn_acceleration": (0.0, 1e5),
        "shake_frequency": (0.1, 100.0),
        "shake_periods": (1, 100),
    }

    shake_acceleration: float = 9.81
    turn_acceleration: float = 100.0
    shake_frequency: float = 3.0
    shake_periods: int = 2

    def __post_init__(self) -> None:
        require_ranges(self, "shaking")

    @property
    def duration(self) -> float:
        """Duration of both parts [s]."""
        return 2.0 * self.shake_periods / self.shake_frequency


@dataclass(frozen=True, kw_only=True)
class TrialSettings:
    """Phases of a trial.

    Attributes:
        motion: the hand's motion around the grasp; None for the station's.
        lift_time: duration of a straight segment of 0.30 m with the target [s]: the hand
            accelerates over one half and brakes over the other; shorter segments have the same
            acceleration.
        hold_time: how long the target must be held at the end of the lift [s].
        creep_speed: a target that moves in the hand slower than this sticks to the pads [m/s] ...
        creep_distance: ... and one that does not get faster may go on by this much [m]; both decide
            trials early, see `Engine.whole_trial`.
        steady_time: how long the target must stick, free of contact, with all others at rest [s].
        poll: interval between contact checks [s].
        settled_speed: the fingers have closed when they are slower than this [m/s] ...
        settled_time: ... for this long [s].
        close_timeout: longest time for closing [s]; for a slow hand, twice its closing time.
        disturbance: other objects that move farther than this count as disturbed [m].
        tilt_limit: a held target that has rotated farther than this in the hand since the grip does
            not count as lifted [rad]; pi for no limit.
        slip_limit: likewise for a target that has slid farther than this [m]; infinite for no
            limit.
        approach: whether the hand alone begins at the pregrasp, and not at the grasp.
        shake: shaking in place of the lift, of a target alone and without gravity; None for a lift.
    """

    RANGES: ClassVar[Ranges] = {
        "lift_time": (1e-2, MAX_PHASE_DURATION),
        "hold_time": (0.0, MAX_PHASE_DURATION),
        "creep_speed": (0.0, 10.0),
        "creep_distance": (0.0, 10.0),
        "steady_time": (0.0, MAX_PHASE_DURATION),
        "poll": (1e-4, 1.0),
        "settled_speed": (0.0, 10.0),
        "settled_time": (0.0, MAX_PHASE_DURATION),
        "close_timeout": (0.0, MAX_PHASE_DURATION),
        "disturbance": (0.0, 10.0),
        "tilt_limit": (0.0, math.pi),
        "slip_limit": (0.0, math.inf),
    }
    """Values for which a trial is meaningful, and ends within minutes at the shortest steps."""

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
    shake: ShakeSettings | None = None

    def __post_init__(self) -> None:
        require_ranges(self, "a trial")

    @property
    def acceleration(self) -> float:
        """Acceleration of the hand on its straight segments with the target [m/s^2]."""
        return 4.0 * REFERENCE_LIFT_LENGTH / self.lift_time**2

    def time_of(self, length: float) -> float:
        """Duration of a straight segment with the target [s], by its length [m]."""
        return self.lift_time * math.sqrt(length / REFERENCE_LIFT_LENGTH)

    @property
    def steady_polls(self) -> int:
        """Number of contact checks in `steady_time`."""
        return max(1, round(self.steady_time / self.poll))


NO_GRIP_LIMITS = {"tilt_limit": math.pi, "slip_limit": math.inf}
"""Limits with which every held target counts as lifted, however it moved in the hand."""
DEFAULT_TRIAL = TrialSettings()
"""Phases that `evaluate` and `replay` use."""


@dataclass(frozen=True, kw_only=True)
class LoadSettings:
    """Loads of a grip.

    Attributes:
        smallest, largest: range of the tried accelerations [g].
        tolerance: relative distance between the largest load withstood and the next load that
            fails.
        slide: a load fails when the target's point at the grasp moves farther than this in the hand
            [m], or a finger loses contact.
        tug_rise: time in which a tug grows to its full force [s], which is then constant ...
        tug_time: ... for this long [s], or until the target is at rest.
        frequency: of shaking [Hz].
        periods: number of periods of shaking; the amplitude grows during the first one.
    """

    smallest: float = 0.05
    largest: float = 50.0
    tolerance: float = 0.03
    slide: float = 0.005
    tug_rise: float = 0.05
    tug_time: float = 0.2
    frequency: float = 5.0
    periods: int = 3

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest < self.largest:
            raise InvalidInputError(
                f"loads are from {self.smallest:g} to {self.largest:g} g; the smallest must be"
                " above 0, the largest above the smallest"
            )
        for name in ("tolerance", "slide", "tug_rise", "tug_time", "frequency", "periods"):
            if not getattr(self, name) > 0:
                raise InvalidInputError(f"{name} is {getattr(self, name):g}; give more than 0")


@dataclass(frozen=True, kw_only=True)
class FrictionSettings:
    """Search range of the friction coefficient.

    Attributes:
        smallest, largest: coefficients.
        tolerance: relative distance between the smallest coefficient that lifts and the next that
            fails.
    """

    smallest: float = 0.02
    largest: float = 2.0
    tolerance: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 < self.smallest < self.largest:
            raise InvalidInputError(
                f"friction is from {self.smallest:g} to {self.largest:g}; the smallest must be"
                " above 0, the largest above the smallest"
            )
        if not self.tolerance > 0.0:
            raise InvalidInputError(f"tolerance is {self.tolerance:g}; give more than 0")


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Standard deviations.

    Attributes:
        translation: of the grasp in the target, along each axis [m].
        rotation: of the grasp in the target, about each axis [rad].
        mass: of the target, relative.
        friction: of the target's coefficient, relative.
    """

    translation: float = setting(
        0.005, "noise of the grasp along each axis", unit=Units.millimetres, low=0
    )
    rotation: float = setting(
        math.radians(5.0), "noise of the grasp about each axis", unit=Units.degrees, low=0
    )
    mass: float = setting(0.1, "noise of the object's mass", unit=Units.percent, low=0)
    friction: float = setting(
        0.2, "noise of the object's friction coefficient", unit=Units.percent, low=0
    )

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 <= value < math.inf:
                raise InvalidInputError(f"noise of the {name} is {value:g}; give 0 or more")


SETTLING_TIME = 10.0
"""Seconds of simulated time in which a scene must come to rest."""
SETTLING_ENGINE = "screening"
"""Preset used while objects fall; `relax` has its own time step."""
