"""What pages of trials say: outcomes as an operator tells them apart, and grasps in words."""

from __future__ import annotations

import math

from burg_drake.core import Array
from burg_drake.core.grasps import RealOutcome, outcome_label as outcome_label

_MEANINGS: dict[RealOutcome, str] = {
    RealOutcome.LIFTED: "held at the end of the lift, nothing else moved",
    RealOutcome.LIFTED_DISTURBED: "held at the end of the lift, but another object was moved",
    RealOutcome.LIFTED_TURNED: "held at the end of the lift, but turned or slid in the hand",
    RealOutcome.SLIPPED: "gripped, and lost during the lift",
    RealOutcome.DROPPED: "lifted, and lost while it was held",
    RealOutcome.CLOSED_EMPTY: "the fingers closed without the object",
    RealOutcome.HAND_COLLISION_APPROACH: "the hand hit something before it closed",
    RealOutcome.PROTECTIVE_STOP: "the robot stopped by itself",
    RealOutcome.PERCEPTION_FAILED: (
        "the scene was not seen well enough to try; does not count for the grasp"
    ),
    RealOutcome.NOT_ATTEMPTED: "nobody tried; does not count for the grasp",
}
SHORT_LIST: dict[RealOutcome, tuple[str, str]] = {
    outcome: (outcome_label(outcome), meaning) for outcome, meaning in _MEANINGS.items()
}
"""Outcomes that an operator tells apart at a glance, in the order of their keys 1 to 9 and 0: what
is written, and what it means."""
STRAIGHT = math.radians(8.0)
"""Approaches within it of straight down have no side [rad]."""
LEVEL = math.radians(75.0)
"""From this on an approach is from the side [rad]."""
SIDES = (
    "right",
    "far right",
    "far side",
    "far left",
    "left",
    "near left",
    "near side",
    "near right",
)
"""From which side of the board a hand comes, in steps of 45 degrees from +x on."""


def approach_text(X_SG: Array) -> str:
    """From where the hand of a grasp (4, 4) in S comes, in words."""
    approach_S = X_SG[:3, 2]
    tilt = math.acos(max(-1.0, min(1.0, float(-approach_S[2]))))
    if tilt < STRAIGHT:
        return "from straight above"
    side = SIDES[round(math.atan2(-approach_S[1], -approach_S[0]) / (math.pi / 4)) % 8]
    degrees = round(math.degrees(tilt))
    if tilt > math.pi / 2 + STRAIGHT:
        return f"from below, from the {side}, {degrees}° from straight down"
    if tilt > LEVEL:
        return f"from the {side}, level ({degrees}° from straight down)"
    return f"from above, {degrees}° from the {side}"


def closing_text(X_SG: Array) -> str:
    """Along which line the fingers close, as an angle from x on the board, seen from above."""
    x, y, z = X_SG[:3, 0]
    if math.hypot(x, y) < math.sin(STRAIGHT):
        return "upright"
    angle = round(math.degrees(math.atan2(y, x))) % 180
    slope = round(math.degrees(math.asin(min(1.0, abs(float(z))))))
    return f"at {angle}° to x" + (f", {slope}° from level" if slope >= 8 else "")


def point_text(X_SG: Array) -> str:
    """Where a grasp is on the board [mm]."""
    x, y, z = (round(1e3 * float(v)) for v in X_SG[:3, 3])
    return f"x {x}, y {y}, z {z} mm"


def day_and_time(text: str) -> str:
    """A moment (ISO 8601) as people write it; empty if there is none."""
    return text.replace("T", " ")[:16]
