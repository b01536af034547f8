"""Timing of the motions of a grasp: as fast as the joints allow, the hand on straight segments."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array, InvalidInputError
from burg_drake.motion.joint_limits import ArmLimits
from burg_drake.motion.line_timing import HandSpeed, PathMotion, time_line
from burg_drake.motion.motion_settings import TimingSettings
from burg_drake.motion.numeric_ik import ArmKinematics
from burg_drake.motion.plan_files import Plan
from burg_drake.motion.polyline_timing import Cubics, IsFree, time_polyline
from burg_drake.motion.reach_verdict import ArmPath
from burg_drake.motion.target_sweep import MIN_STRAIGHTNESS
from burg_drake.motion.trajectory import Motion, Trajectory
from burg_drake.station import GraspMotion

REFERENCE_LIFT_HEIGHT = GraspMotion().lift_height
"""Metres. Height that `TimingSettings.lift_time` refers to."""


@dataclass(frozen=True)
class PathChecks:
    """Collision checks for deviations from an arm path, each for rows (R, n) that the arm moves
    through straight from row to row.

    Attributes:
        transfer: check with the hand open and empty.
        approach: check with the hand open and empty, near the target.
        lift, retreat: checks with the target in the hand.
    """

    transfer: IsFree | None = None
    approach: IsFree | None = None
    lift: IsFree | None = None
    retreat: IsFree | None = None


def time_motion(
    path: ArmPath,
    limits: ArmLimits,
    kinematics: ArmKinematics,
    *,
    settings: TimingSettings | None = None,
    checks: PathChecks | None = None,
    limit_margin: float = 0.0,
) -> Plan:
    """Times the segments of an arm path; each begins and ends at rest.

    Args:
        path: the segments.
        limits: limits of the joints; none is exceeded.
        kinematics: the arm, to measure the path length of the hand.
        settings: speeds and tolerances.
        checks: collision checks of rounded corners and smoothed segments. Without a check of the
            transfer, the arm stops at each corner; without one of a straight segment, it keeps to a
            spline through the waypoints.

    Returns:
        The plan, sampled at `settings.rate`.

    Raises:
        InvalidInputError: a path outside the joint limits, or one that cannot be slowed down to
            keep the others.
    """
    unmeasured_clearance = 2e-4  # Metres. Clearance of a path without a measured one.
    settings, checks = settings or TimingSettings(), checks or PathChecks()
    near = unmeasured_clearance if np.isnan(path.clearance) else max(0.0, path.clearance)
    line_settings = replace(
        settings, straightness=max(MIN_STRAIGHTNESS, min(settings.straightness, near / 2.0))
    )
    gentle = limits.scaled_down(settings.velocity_share, settings.ramp)
    transfer = time_polyline(
        _require_within_limits(path.transfer, limits, "transfer"),
        gentle,
        deviation=settings.corner_deviation,
        is_free=checks.transfer,
    )

    def timed_line(
        name: str, rows: Array, hand: HandSpeed, is_free: IsFree | None
    ) -> PathMotion | Cubics:
        rows = _require_within_limits(rows, limits, name)
        return time_line(
            *(rows, kinematics, gentle, hand, line_settings),
            is_free=is_free,
            limit_margin=limit_margin,
        )

    slow = HandSpeed(settings.approach_speed, settings.approach_acceleration, settings.ramp)
    approach = timed_line("approach", path.approach, slow, checks.approach)
    rising = _lift_speed(_hand_path_length(path.lift, kinematics), settings)
    lift = timed_line("lift", path.lift, rising, checks.lift)
    retreat = None
    if path.retreat is not None:
        back = timed_line("retreat", path.retreat, _retreat_speed(settings), checks.retreat)
        retreat = _sample_motion(back, path.retreat, limits, settings)
    return Plan(
        _sample_motion(transfer, path.transfer, limits, settings),
        _sample_motion(approach, path.approach, limits, settings),
        _sample_motion(lift, path.lift, limits, settings),
        retreat=retreat,
    )


def _require_within_limits(q: Array, limits: ArmLimits, name: str) -> Array:
    outside = ~((q >= limits.lower) & (q <= limits.upper))  # NaN, too
    if outside.any():
        row, joint = np.argwhere(outside)[0]
        raise InvalidInputError(
            f"{name} of the path has joint {joint + 1} at {q[row, joint]:.4f} rad in waypoint"
            f" {row}, outside its limits {limits.lower[joint]:.4f} to {limits.upper[joint]:.4f}"
        )
    return q


def _lift_speed(height: float, settings: TimingSettings) -> HandSpeed:
    """Hand limits for a lift: full acceleration, then full braking, each for half of the time. The
    acceleration is that of `REFERENCE_LIFT_HEIGHT`, so that the load on the object is the same."""
    time = settings.lift_time * np.sqrt(height / REFERENCE_LIFT_HEIGHT)
    acceleration = 4.0 * REFERENCE_LIFT_HEIGHT / settings.lift_time**2
    return HandSpeed(float(acceleration * time / 2.0), acceleration, settings.ramp)


def _retreat_speed(settings: TimingSettings) -> HandSpeed:
    """Hand limits for a retreat: the speed of the approach, at most the lift's acceleration."""
    acceleration = min(
        settings.approach_acceleration, 4.0 * REFERENCE_LIFT_HEIGHT / settings.lift_time**2
    )
    return HandSpeed(settings.approach_speed, acceleration, settings.ramp)


def _hand_path_length(rows: Array, kinematics: ArmKinematics) -> float:
    """Distance between the ends of a straight segment [m]."""
    p = kinematics.forward(rows[[0, -1]])[0][:, :3, 3]
    return float(np.linalg.norm(p[1] - p[0]))


def _sample_motion(
    motion: Motion, path: Array, limits: ArmLimits, settings: TimingSettings
) -> Trajectory:
    """Samples a motion, slowed down until finite differences of the samples keep the limits."""
    max_slowdowns = 20  # Times that a motion is slowed down.
    motion, kept = motion.time_scaled(1.0 / settings.speed), limits.slowed(settings.speed)
    for _ in range(max_slowdowns):
        trajectory = Trajectory.of(motion, path[0], path[-1], settings.rate)
        factor = kept.time_scale(trajectory.peaks())
        if factor <= 1.0 + 1e-6:
            return trajectory
        # Samples miss the peaks, so the motion is slowed down by 0.05 % more.
        motion = motion.time_scaled(1.0005 * factor)
    raise InvalidInputError(
        f"a motion still exceeds the limits of the arm after it was slowed down {max_slowdowns}"
        f" times, to {motion.duration:g} s"
    )
