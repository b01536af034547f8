"""Evaluation modes, the stages of the cascade, and the outcomes of a grasp, simulated and real."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal, get_args

Mode = Literal["hand", "reach", "arm"]
"""`hand`: the hand alone executes the grasp in simulation. `reach`: the same, but only grasps that
the arm can execute. `arm`: the whole arm executes these grasps."""
MODES: tuple[Mode, ...] = get_args(Mode)
"""Evaluation modes; each requires more than the one before."""


FirstMode = Mode | Literal["approach"]
"""The first mode that determines a value; `approach`: the whole arm, or the hand alone if its
approach is simulated."""


def mode_includes(mode: Mode, first: FirstMode, *, approach: bool = False) -> bool:
    """Whether a mode determines a value whose first mode is `first`.

    Args:
        mode: the mode.
        first: the first mode that determines the value.
        approach: whether the approach of the hand alone is simulated.
    """
    if first == "approach":
        return approach or mode == "arm"
    return MODES.index(mode) >= MODES.index(first)


class Stage(StrEnum):
    """Stages of the cascade in order. A grasp's stage is the one that decided its outcome."""

    CLEAR = "clear"
    REACHABLE = "reachable"
    PLANNED = "planned"
    EXECUTED = "executed"


Among = Literal["all", "clear", "reachable", "executed"]
"""Subsets of judged grasps: all, the ones with a clear hand, the ones that the arm can reach as
well, or the ones executed in simulation."""
DECIDED_STAGES: dict[Among, tuple[Stage, ...]] = {
    "all": tuple(Stage),
    "clear": (Stage.REACHABLE, Stage.PLANNED, Stage.EXECUTED),
    "reachable": (Stage.PLANNED, Stage.EXECUTED),
    "executed": (Stage.EXECUTED,),
}
"""Stages that decided the grasps of a subset."""


class Outcome(StrEnum):
    """Why a grasp ended. Only `LIFTED` is success.

    Attributes:
        meaning: short description."""

    _value_: str
    meaning: str

    def __new__(cls, value: str, meaning: str = "") -> Outcome:
        """Creates a member from its value, which is stored, and its meaning."""
        outcome = str.__new__(cls, value)
        outcome._value_, outcome.meaning = value, meaning
        return outcome

    COLLISION_TARGET = "collision_target", "at the grasp the open hand overlaps the object itself"
    COLLISION_TABLE = "collision_table", "at the grasp the open hand overlaps the table"
    COLLISION_CLUTTER = "collision_clutter", "at the grasp the open hand overlaps another object"
    COLLISION_BACKGROUND = (
        "collision_background",
        "at the grasp the open hand overlaps something fixed",
    )
    HAND_COLLISION_APPROACH = (
        "hand_collision_approach",
        "on the straight approach the open hand hits something",
    )
    HAND_COLLISION_RETREAT = (
        "hand_collision_retreat",
        "on the straight retreat the hand or the object in it hits something",
    )
    HAND_COLLISION_LIFT = (
        "hand_collision_lift",
        "on the lift the hand or the object in it hits something",
    )
    NO_IK = "no_ik", "no arm configuration reaches the grasp, even without joint limits"
    JOINT_LIMIT = (
        "joint_limit",
        "all arm configurations that reach the grasp are beyond a joint limit",
    )
    ARM_COLLISION = (
        "arm_collision",
        "the arm collides in every configuration that was found within the joint limits",
    )
    APPROACH_LINE = (
        "approach_line",
        "the arm reaches pregrasp and grasp, but cannot follow the straight line between them",
    )
    RETREAT_LINE = "retreat_line", "the arm cannot follow the straight retreat"
    LIFT_LINE = "lift_line", "the arm cannot follow the lift"
    NO_PATH = "no_path", "no path from the home posture to the pregrasp was found"
    NO_CONTACT = "no_contact", "the fingers closed without touching the object"
    ONE_FINGER = "one_finger", "the fingers stopped with only one of them at the object"
    CLOSED_EMPTY = (
        "closed_empty",
        "the object was touched, but slipped away while the fingers closed",
    )
    SLIPPED = "slipped", "both fingers held the object, and lost it during the lift"
    BLOCKED = "blocked", "during the motion the hand or the arm hit something fixed"
    DROPPED = "dropped", "the object was lifted, and lost while it was held"
    LIFTED = "lifted", "both fingers hold the object to the end, and nothing else was moved"
    LIFTED_DISTURBED = (
        "lifted_disturbed",
        "the object is held to the end, but another one was moved",
    )
    LIFTED_TURNED = (
        "lifted_turned",
        "the object is held to the end, but turned or slid in the hand beyond the limits",
    )
    SIMULATION_FAILED = (
        "simulation_failed",
        "the trial could not be simulated; the results have the reason",
    )
    REACHABLE = (
        "reachable",
        "the arm can execute the grasp; it was not simulated, as the mode did not ask for that",
    )

    @property
    def held(self) -> bool:
        """Whether the target was lifted and is held, even if it turned, or others moved."""
        return self in (Outcome.LIFTED, Outcome.LIFTED_DISTURBED, Outcome.LIFTED_TURNED)

    @property
    def stage(self) -> Stage:
        """The stage that decides this outcome."""
        reach_outcomes = (
            Outcome.HAND_COLLISION_APPROACH,
            Outcome.HAND_COLLISION_RETREAT,
            Outcome.HAND_COLLISION_LIFT,
            Outcome.NO_IK,
            Outcome.JOINT_LIMIT,
            Outcome.ARM_COLLISION,
        )
        plan_outcomes = (
            Outcome.APPROACH_LINE,
            Outcome.RETREAT_LINE,
            Outcome.LIFT_LINE,
            Outcome.NO_PATH,
            Outcome.REACHABLE,
        )
        if self.value.startswith("collision_"):
            return Stage.CLEAR
        if self in reach_outcomes:
            return Stage.REACHABLE
        if self in plan_outcomes:
            return Stage.PLANNED
        return Stage.EXECUTED


UNTRIED_OUTCOMES = ("", Outcome.REACHABLE.value)
"""Outcomes in a column that do not come from a trial."""


class RealOutcome(StrEnum):
    """How a trial on the robot ended.

    The values are the simulated outcomes that a person or a robot can observe, and outcomes that
    exist only in reality. Outcomes that an operator distinguishes at a glance come first: messages
    begin with them.
    """

    LIFTED = "lifted"
    LIFTED_DISTURBED = "lifted_disturbed"
    LIFTED_TURNED = "lifted_turned"
    SLIPPED = "slipped"
    DROPPED = "dropped"
    CLOSED_EMPTY = "closed_empty"
    HAND_COLLISION_APPROACH = "hand_collision_approach"
    PROTECTIVE_STOP = "protective_stop"
    """The robot stopped itself: the execution failed."""
    NOT_ATTEMPTED = "not_attempted"
    """The grasp was not tried; no information about it."""
    PERCEPTION_FAILED = "perception_failed"
    """The scene was not perceived well enough to try; no information about the grasp."""
    ONE_FINGER = "one_finger"
    NO_CONTACT = "no_contact"
    BLOCKED = "blocked"
    COLLISION_TARGET = "collision_target"
    COLLISION_TABLE = "collision_table"
    COLLISION_CLUTTER = "collision_clutter"
    COLLISION_BACKGROUND = "collision_background"
    HAND_COLLISION_RETREAT = "hand_collision_retreat"
    HAND_COLLISION_LIFT = "hand_collision_lift"
    NO_IK = "no_ik"
    JOINT_LIMIT = "joint_limit"
    ARM_COLLISION = "arm_collision"
    APPROACH_LINE = "approach_line"
    RETREAT_LINE = "retreat_line"
    LIFT_LINE = "lift_line"
    NO_PATH = "no_path"

    @property
    def of_arm(self) -> bool:
        """Whether the outcome needs an arm, so that a run of the hand alone cannot predict it."""
        return self.value in (
            *("no_ik", "joint_limit", "arm_collision", "approach_line", "retreat_line"),
            *("lift_line", "no_path", "protective_stop"),
        )

    @property
    def attempted(self) -> bool:
        """Whether the outcome gives information about the grasp."""
        return self not in (RealOutcome.NOT_ATTEMPTED, RealOutcome.PERCEPTION_FAILED)

    @property
    def held(self) -> bool:
        """Whether the target was lifted and is held, even if it turned, or others moved."""
        return self.value in (one.value for one in Outcome if one.held)


def outcome_label(outcome: str) -> str:
    """Label of a simulated or real outcome on buttons, pages and in tables."""
    labels = {
        "lifted_disturbed": "lifted, others moved",
        "lifted_turned": "lifted, turned",
        "hand_collision_approach": "hit on the approach",
    }
    return labels.get(outcome) or outcome.replace("_", " ")
