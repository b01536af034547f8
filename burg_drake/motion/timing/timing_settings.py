"""How fast an arm moves along a path, and how far it may cut corners."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core import InvalidInputError


@dataclass(frozen=True, kw_only=True)
class TimingSettings:
    """How fast to move, and how close to the path.

    The lift accelerates and brakes the hand as the trial of the hand alone does.

    Attributes:
        speed: share of the speed that the limits allow, above 0, at most 1: the same motion in
            1 / speed times the time.
        velocity_share: share of the joints' velocity limits to use, at most 1. libfranka keeps what
            three lost packets may cost, up to 2.3 % (`rate_limiting.h`, kTolNumberPacketsLost).
        rate: samples per second of time.
        ramp: least time in which a joint builds up its largest acceleration [s]. Franka's limits
            of jerk alone would allow 2 ms; but torques may change by 1000 Nm/s only, for which
            transfers need about 30 ms (`benchmarks/timing.py`).
        corner_deviation: how far the transfer may cut a corner [rad].
        line_deviation: how far approach and lift may leave the joint path between two of its
            waypoints without a new check [rad].
        straightness: how far the hand may leave a straight line on approach, retreat and lift
            [m], and no farther than half of its clearance there.
        approach_speed, approach_acceleration: of the hand [m/s, m/s^2].
        lift_time: time in which the hand rises by 0.30 m with full acceleration in the first half
            and full braking in the second one [s]; the ramps come on top. Another height has the
            same acceleration, so that its time grows like the square root; the retreat has no more,
            and the speed of the approach.
    """

    speed: float = 1.0
    velocity_share: float = 0.97
    rate: float = 1000.0
    ramp: float = 0.03
    corner_deviation: float = 0.15
    line_deviation: float = 0.01
    straightness: float = 0.0005
    approach_speed: float = 0.25
    approach_acceleration: float = 0.75
    lift_time: float = 1.25

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0.0 < value < float("inf"):
                raise InvalidInputError(f"{name} of a motion is {value:g}; give more than 0")
        for name in ("speed", "velocity_share"):
            if getattr(self, name) > 1.0:
                raise InvalidInputError(
                    f"{name} of a motion is {getattr(self, name):g}; give at most 1"
                )
