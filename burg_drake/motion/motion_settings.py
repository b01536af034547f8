"""Settings of the search for arm motions and of their timing."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core import InvalidInputError
from burg_drake.motion.target_sweep import MIN_STRAIGHTNESS
from burg_drake.station import GraspMotion


@dataclass(frozen=True, kw_only=True)
class ReachSettings:
    """Effort and tolerances of the search for arm motions.

    Attributes:
        motion: the hand's straight segments to a grasp and away from it; those of the station if
            None.
        exact: whether Drake's collision checker confirms every motion. False, for screening: the
            best guess from bounds of the arm's clearance decides.
        closed_form: whether to use the closed form for arms that have one, the Panda.
        redundant: number of values of the redundant joint that the closed form sweeps in each
            round. A round is run only if the one before found nothing.
        starts: number of start postures of the numeric inverse kinematics of other arms in each
            round, for each finger assignment.
        iterations: largest number of steps from a start.
        tolerance: largest error of a solution [m and rad].
        limit_margin: distance to keep from the joint limits [rad].
        joint_travel: largest motion of a joint while the hand moves by 5 cm [rad]. Beyond it, the
            two postures count as different branches, between which the hand cannot move straight.
        deviation: the hand may deviate from the straight segment by half of its clearance, clipped
            to these two bounds [m].
        chains: number of motions of a grasp that the collision checker refuses before the grasp is
            given up.
        starts_tried: number of its pregrasp postures without a path from home before it is given
            up.
    """

    motion: GraspMotion | None = None
    exact: bool = True
    closed_form: bool = True
    redundant: tuple[int, ...] = (32, 192)
    starts: tuple[int, ...] = (32, 64, 128)
    iterations: int = 15
    tolerance: float = 1e-6
    limit_margin: float = 0.01
    joint_travel: float = 0.8
    deviation: tuple[float, float] = (MIN_STRAIGHTNESS, 5e-4)
    chains: int = 24
    starts_tried: int = 4

    def __post_init__(self) -> None:
        if self.limit_margin < 0.0 or self.joint_travel <= 0:
            raise InvalidInputError("limit_margin must be at least 0, joint_travel above 0")
        if not self.redundant or min(self.redundant) < 1:
            raise InvalidInputError(
                f"redundant is {list(self.redundant)}; give whole numbers above 0"
            )
        if not self.starts or min(self.starts) < 1:
            raise InvalidInputError(f"starts is {list(self.starts)}; give whole numbers above 0")
        if min(self.chains, self.starts_tried) < 1:
            raise InvalidInputError("chains and starts_tried must be at least 1")
        if not 0.0 < self.deviation[0] <= self.deviation[1]:
            raise InvalidInputError(
                f"deviation is {list(self.deviation)}; give two lengths, the smaller one first"
            )


@dataclass(frozen=True, kw_only=True)
class TimingSettings:
    """Speeds of the arm, and tolerances of its path.

    The lift accelerates and brakes the hand as in the trial of the hand alone.

    Attributes:
        speed: share of the speed that the limits allow, above 0, at most 1: the same motion in
            1 / speed times the time.
        velocity_share: share of the joints' velocity limits to use, at most 1. libfranka reserves
            up to 2.3 % for three lost packets (`rate_limiting.h`, kTolNumberPacketsLost).
        rate: samples per second of time.
        ramp: shortest time in which a joint builds up its largest acceleration [s]. Franka's jerk
            limits alone would allow 2 ms, but torques may change by at most 1000 Nm/s, for which
            transfers need about 30 ms (`benchmarks/timing.py`).
        corner_deviation: how far the transfer may cut a corner [rad].
        line_deviation: how far approach and lift may leave the joint path between two of its
            waypoints without a new check [rad].
        straightness: how far the hand may leave a straight line on approach, retreat and lift [m];
            at most half of its clearance there.
        approach_speed, approach_acceleration: of the hand [m/s, m/s^2].
        lift_time: time in which the hand rises by 0.30 m with full acceleration in the first half
            and full braking in the second one [s], without the ramps. Other heights have the same
            acceleration, so that the time grows with the square root of the height. The retreat has
            at most this acceleration, and the speed of the approach.
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
