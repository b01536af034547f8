"""Colours of outcomes: a few groups that stay apart for colour-blind eyes.

The hues are those of Okabe and Ito, "Color Universal Design" (2008).
"""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core.grasps import Outcome
from burg_drake.core.terminal import Rgba as Rgba


@dataclass(frozen=True)
class OutcomeGroup:
    """Outcomes that share a colour.

    Attributes:
        name: for legends.
        rgba: colour; grasps that ended early are fainter, as they are many.
        outcomes: the members.
    """

    name: str
    rgba: Rgba
    outcomes: tuple[Outcome, ...]

    @property
    def hex(self) -> str:
        """The colour as HTML has it, without its opacity."""
        return "#" + "".join(f"{round(255 * c):02x}" for c in self.rgba[:3])


GROUPS = (
    OutcomeGroup("lifted", (0.0, 0.62, 0.45, 1.0), (Outcome.LIFTED,)),
    OutcomeGroup("lifted, others disturbed", (0.94, 0.89, 0.26, 1.0), (Outcome.LIFTED_DISTURBED,)),
    OutcomeGroup("held, turned in the hand", (0.84, 0.37, 0.0, 1.0), (Outcome.LIFTED_TURNED,)),
    OutcomeGroup(
        "lost during lift or hold",
        (0.90, 0.62, 0.0, 1.0),
        (Outcome.SLIPPED, Outcome.BLOCKED, Outcome.DROPPED),
    ),
    OutcomeGroup(
        "never held",
        (0.80, 0.47, 0.65, 1.0),
        (Outcome.NO_CONTACT, Outcome.ONE_FINGER, Outcome.CLOSED_EMPTY),
    ),
    OutcomeGroup("reachable, not tried", (0.60, 0.87, 0.62, 1.0), (Outcome.REACHABLE,)),
    OutcomeGroup(
        "arm has no path",
        (0.10, 0.20, 0.45, 0.6),
        (Outcome.APPROACH_LINE, Outcome.RETREAT_LINE, Outcome.LIFT_LINE, Outcome.NO_PATH),
    ),
    OutcomeGroup(
        "arm cannot reach",
        (0.0, 0.45, 0.70, 0.6),
        (Outcome.NO_IK, Outcome.JOINT_LIMIT, Outcome.ARM_COLLISION),
    ),
    OutcomeGroup(
        "hand collides on its path",
        (0.55, 0.32, 0.15, 0.5),
        (
            Outcome.HAND_COLLISION_APPROACH,
            Outcome.HAND_COLLISION_RETREAT,
            Outcome.HAND_COLLISION_LIFT,
        ),
    ),
    OutcomeGroup(
        "hand collides",
        (0.45, 0.45, 0.45, 0.4),
        (
            Outcome.COLLISION_TARGET,
            Outcome.COLLISION_TABLE,
            Outcome.COLLISION_CLUTTER,
            Outcome.COLLISION_BACKGROUND,
        ),
    ),
    OutcomeGroup("simulation failed", (0.0, 0.0, 0.0, 1.0), (Outcome.SIMULATION_FAILED,)),
)
"""All groups, best outcome first; every outcome is in exactly one."""

UNJUDGED = OutcomeGroup("not judged", (0.34, 0.71, 0.91, 1.0), ())

OTHERS: Rgba = (0.35, 0.35, 0.35, 0.6)
"""Of all names beyond the `CATEGORIES`."""
UNKNOWN: Rgba = (0.62, 0.62, 0.62, 0.6)
"""Where there is no value."""


def group_of(outcome: Outcome | None) -> OutcomeGroup:
    """The group of an outcome; None stands for a grasp that nobody judged."""
    if outcome is None:
        return UNJUDGED
    return next((g for g in GROUPS if outcome in g.outcomes), UNJUDGED)
