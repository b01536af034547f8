"""What can become of a grasp: the stages it passes and the one outcome that it ends with.

Results files store their values: add new ones, rename none.
"""

from __future__ import annotations

from enum import StrEnum


class Stage(StrEnum):
    """Stages of the cascade in order. A grasp's stage is the one that decided its outcome."""

    CLEAR = "clear"
    REACHABLE = "reachable"
    PLANNED = "planned"
    EXECUTED = "executed"


class Outcome(StrEnum):
    """Why a grasp ended. `LIFTED` alone is success."""

    COLLISION_TARGET = "collision_target"
    """The open hand overlaps the target at the grasp."""
    COLLISION_TABLE = "collision_table"
    """The open hand overlaps the table."""
    COLLISION_CLUTTER = "collision_clutter"
    """The open hand overlaps another object of the scene."""
    COLLISION_BACKGROUND = "collision_background"
    """The open hand overlaps a fixed body of the scene or station."""
    HAND_COLLISION_APPROACH = "hand_collision_approach"
    """On the straight segment from pregrasp to grasp the open hand overlaps something."""
    HAND_COLLISION_RETREAT = "hand_collision_retreat"
    """On the straight segment back the hand, or the target in it, overlaps something."""
    HAND_COLLISION_LIFT = "hand_collision_lift"
    """On the lift the hand, or the target in it, overlaps something."""
    NO_IK = "no_ik"
    """No arm configuration puts the hand at the grasp and at the pregrasp, whatever the joint
    limits."""
    JOINT_LIMIT = "joint_limit"
    """Configurations exist, but each is beyond a joint limit."""
    ARM_COLLISION = "arm_collision"
    """Configurations exist, but in each found the arm collides."""
    APPROACH_LINE = "approach_line"
    """Grasp and pregrasp are reached, but the arm cannot take the hand straight from one to the
    other."""
    RETREAT_LINE = "retreat_line"
    """The arm cannot take the hand straight back from the grasp."""
    LIFT_LINE = "lift_line"
    """The arm cannot take the hand along the lift."""
    NO_PATH = "no_path"
    """No collision-free path from the home posture to a pregrasp was found."""
    NO_CONTACT = "no_contact"
    """The fingers closed and never touched the target."""
    ONE_FINGER = "one_finger"
    """The fingers stopped with only one of them on the target."""
    CLOSED_EMPTY = "closed_empty"
    """The target was touched, but escaped while the fingers closed."""
    SLIPPED = "slipped"
    """Both fingers held the target and lost it during the lift."""
    BLOCKED = "blocked"
    """During its motion the hand or the arm met something fixed."""
    DROPPED = "dropped"
    """The target was lifted and lost while being held."""
    LIFTED = "lifted"
    """Both fingers still hold the target at the end, and nothing else was disturbed."""
    LIFTED_DISTURBED = "lifted_disturbed"
    """Both fingers still hold the target at the end, but another object was moved on the way."""
    SIMULATION_FAILED = "simulation_failed"
    """Drake could not step the trial; the reason is stored with the result."""
    REACHABLE = "reachable"
    """The arm can execute the grasp, and no trial was asked for."""

    @property
    def held(self) -> bool:
        """The target was lifted and is held, whatever happened to the others."""
        return self in (Outcome.LIFTED, Outcome.LIFTED_DISTURBED)

    @property
    def stage(self) -> Stage:
        """The stage that decides this outcome."""
        if self.value.startswith("collision_"):
            return Stage.CLEAR
        if self in _REACHABLE:
            return Stage.REACHABLE
        if self in _PLANNED:
            return Stage.PLANNED
        return Stage.EXECUTED


_REACHABLE = (
    Outcome.HAND_COLLISION_APPROACH,
    Outcome.HAND_COLLISION_RETREAT,
    Outcome.HAND_COLLISION_LIFT,
    Outcome.NO_IK,
    Outcome.JOINT_LIMIT,
    Outcome.ARM_COLLISION,
)
"""Whether the hand can come to a grasp and away, and the arm be there."""
_PLANNED = (
    Outcome.APPROACH_LINE,
    Outcome.RETREAT_LINE,
    Outcome.LIFT_LINE,
    Outcome.NO_PATH,
    Outcome.REACHABLE,
)
"""Whether the arm can move there, straight in, back and up."""
UNTRIED = ("", Outcome.REACHABLE.value)
"""Texts in a column of outcomes that tell nothing of a trial."""


class RealOutcome(StrEnum):
    """How a trial on the robot ended: the simulator's vocabulary, as far as a person or a robot can
    see it, and what only reality has.

    Those that an operator tells apart at a glance come first: messages begin with them.
    """

    LIFTED = "lifted"
    LIFTED_DISTURBED = "lifted_disturbed"
    SLIPPED = "slipped"
    DROPPED = "dropped"
    CLOSED_EMPTY = "closed_empty"
    HAND_COLLISION_APPROACH = "hand_collision_approach"
    PROTECTIVE_STOP = "protective_stop"
    """The robot stopped itself on its way: an execution that failed."""
    NOT_ATTEMPTED = "not_attempted"
    """Nobody tried; tells nothing of the grasp."""
    PERCEPTION_FAILED = "perception_failed"
    """The scene was not seen well enough to try; tells nothing of the grasp."""
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
    def attempted(self) -> bool:
        """Whether it tells anything of the grasp."""
        return self not in (RealOutcome.NOT_ATTEMPTED, RealOutcome.PERCEPTION_FAILED)

    @property
    def held(self) -> bool:
        """The target was lifted and is held, whatever happened to the others."""
        return self in (RealOutcome.LIFTED, RealOutcome.LIFTED_DISTURBED)
