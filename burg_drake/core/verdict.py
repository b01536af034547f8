"""The verdict of a grasp: its fields and margins, declared once, and the columns that follow."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from burg_drake.core.columns import (
    DIMENSIONLESS,
    InstancesField,
    JointsField,
    MarginsField,
    NumberField,
    StagesField,
    TableShape,
    TextField,
    VerdictField,
    VerdictPart,
    margin_field,
    verdict_fields,
)
from burg_drake.core.outcomes import Mode, Outcome, Stage


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Continuous slack behind an outcome, SI units; NaN where it was not measured.

    Margins are equal if they have the same numbers and leave the same ones unmeasured.
    """

    overlap: float = margin_field(
        "m",
        "how deep the open hand overlaps what it collides with; 0 if clear",
        smaller_is_better=True,
    )
    clearance: float = margin_field(
        "m",
        "signed distance of the open hand from what is nearest to it",
        axis="room around the open hand",
    )
    slip: float = margin_field(
        "m",
        "displacement of the target in the hand since the grip, at the origin of G",
        smaller_is_better=True,
        axis="slip in the hand",
    )
    tilt: float = margin_field(
        "rad",
        "rotation of the target in the hand since the grip",
        smaller_is_better=True,
        axis="tilt in the hand",
    )
    pad_force: float = margin_field(
        "N",
        "normal force of the weaker pad along the closing direction",
        axis="normal force of the weaker pad",
    )
    patch_area: float = margin_field(
        "m2",
        "contact patch of the pad whose patch is the smaller one",
        title="patch",
        axis="contact patch of the weaker pad",
        digits=0,
    )
    lift: float = margin_field(
        "m",
        "how far the target's centre of mass rose; with another motion how far it moved"
        " along the straight segments. If the trial was decided early, the rest of the"
        " path counts, too, as geometry shows that it is free",
        digits=0,
    )
    lift_height: float = margin_field(
        "m",
        "length of the lift: as requested, or as far as there is room where less is allowed",
        stage=Stage.REACHABLE,
    )
    others_moved: float = margin_field(
        "m",
        "largest displacement of another object, at its point that moved farthest",
        smaller_is_better=True,
        axis="movement of other objects",
    )
    others_turned: float = margin_field(
        "rad",
        "largest rotation of any other object from how it stood",
        smaller_is_better=True,
        axis="rotation of other objects",
    )
    end_time: float = margin_field(
        "s",
        "simulated time at which the outcome was decided, which ends the trial, often before the"
        " hand is at the top of the lift",
    )
    arm_clearance: float = margin_field(
        "m",
        "smallest clearance of the robot along its path, or signed distance of what blocks it",
        mode="reach",
        stage=Stage.REACHABLE,
        axis="room around the robot along its path",
    )
    joint_excess: float = margin_field(
        "rad",
        "how far the nearest configuration is beyond a joint limit",
        mode="reach",
        stage=Stage.REACHABLE,
        smaller_is_better=True,
        title="beyond a joint limit by",
    )
    duration: float = margin_field(
        "s",
        "duration of the planned motion",
        mode="arm",
        stage=Stage.PLANNED,
        title="planned motion",
        digits=2,
    )
    tracking_error: float = margin_field(
        "rad",
        "largest deviation of a joint from its command",
        mode="arm",
        smaller_is_better=True,
        own_unit=("mrad", 1e3),
    )
    tracking_distance: float = margin_field(
        "m",
        "largest deviation of the origin of G from its commanded position",
        mode="arm",
        smaller_is_better=True,
        axis="error of the hand's path",
    )
    pushed: float = margin_field(
        "m",
        "largest displacement of any point of a free object before the hand closed; for one that"
        " hovers, its fall once it is touched",
        mode="approach",
        smaller_is_better=True,
        title="pushed before closing",
        axis="push before the hand closed",
    )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Margins):
            return NotImplemented
        return self._measured() == other._measured()

    def __hash__(self) -> int:
        return hash(self._measured())

    def _measured(self) -> tuple[float | None, ...]:
        values = (getattr(self, f.name) for f in fields(self))
        return tuple(None if math.isnan(value) else value for value in values)

    def of_trial(self) -> dict[str, float]:
        """Those that a trial measures, by name; NaN where it ended before."""
        of_trial = (f.name for f in fields(self) if f.metadata["stage"] is Stage.EXECUTED)
        return {name: getattr(self, name) for name in of_trial}


@dataclass(frozen=True, kw_only=True)
class TrialFindings:
    """What a trial finds beside its outcome.

    Attributes:
        blocker: the body in the way at the start or met on the way, if any; what a link of the arm
            met is written as "panda_link5 vs shelf".
        reason: for people, where the outcome alone does not say enough: the message of what failed.
        margins: continuous slack.
        confidence: probability that trials which differ by what nobody knows exactly find the same,
            held or not held to the end; see `simulation.confidence`. None where no trial decided,
            and with engines that it is not calibrated for.
        displacements: by instance, how far the farthest point of every other free object was moved
            at most from where it stood at the start [m]; 0 of what nothing touched or stood close
            to. Empty if no trial started or it failed.
        turned: the same of its rotation [rad].
        toppled: names of the instances among them whose axis that was upright is tilted by more
            than 45 degrees at the end, and that lie or stand otherwise than before, separated by
            commas; not what rolled.
        pushed: the same when the hand began to close, and of the target, too: what the approach
            moved [m]. Empty where the trial began at the grasp.
        touched: the first touch that was not planned, as "panda_link5 vs can": of the robot with
            anything before the hand began to close; from then on of a link of the arm with
            anything, and of the hand with anything but target and table. Empty if there was none,
            or where the trial began at the grasp.
    """

    blocker: str = field(
        default="", metadata=TextField("", "the body that was in the way").metadata
    )
    reason: str = field(
        default="",
        metadata=TextField(
            "", "why there is no outcome, or no plan: the message of what failed", replayed=False
        ).metadata,
    )
    margins: Margins | Mapping[str, float] = field(
        default_factory=dict, metadata=MarginsField("", "continuous slack", of=Margins).metadata
    )
    confidence: float | None = field(
        default=None,
        metadata=NumberField(
            DIMENSIONLESS,
            "probability that the same grasp, slightly perturbed, is held again or lost again",
        ).metadata,
    )
    displacements: Mapping[str, float] = field(
        default_factory=dict,
        metadata=InstancesField(
            "m",
            "largest displacement of an object, of the point that moved farthest",
            prefix="moved_",
        ).metadata,
    )
    turned: Mapping[str, float] = field(
        default_factory=dict,
        metadata=InstancesField(
            "rad", "largest rotation of an object from how it stood", prefix="turned_"
        ).metadata,
    )
    toppled: str = field(
        default="",
        metadata=TextField(
            "",
            "the other objects that lie at the end and stood before, as NAME, NAME",
            part="measured",
        ).metadata,
    )
    pushed: Mapping[str, float] = field(
        default_factory=dict,
        metadata=InstancesField(
            "m",
            "displacement of an object before the hand closed, of the point that moved farthest",
            prefix="pushed_",
            mode="approach",
        ).metadata,
    )
    touched: str = field(
        default="",
        metadata=TextField(
            "",
            "first unplanned contact of the arm or hand, as LINK vs BODY",
            mode="approach",
            part="measured",
        ).metadata,
    )

    def of_trial(self) -> dict[str, Any]:
        """The fields that are declared here, by name."""
        return {one.name: getattr(self, one.name) for one in fields(TrialFindings)}


@dataclass(frozen=True, kw_only=True)
class Findings(TrialFindings):
    """What the stages of a judge find beside the outcome, each alone or all together.

    Attributes:
        margins: those that were measured, by the names of `Margins`.
        q_grasp, q_pregrasp: positions of the arm's joints [rad]; empty if none were found.
    """

    margins: Mapping[str, float] = field(
        default_factory=dict, metadata=MarginsField("", "continuous slack", of=Margins).metadata
    )
    q_grasp: tuple[float, ...] = field(
        default=(),
        metadata=JointsField(
            "rad", "position of a joint of the arm at the grasp, from 1", prefix="q_grasp_"
        ).metadata,
    )
    q_pregrasp: tuple[float, ...] = field(
        default=(),
        metadata=JointsField(
            "rad", "position of a joint of the arm at the pregrasp, from 1", prefix="q_pregrasp_"
        ).metadata,
    )


CPU_TIME_COLUMNS: Mapping[Stage, tuple[str, str, Mode]] = {
    Stage.CLEAR: ("cpu_clear", "CPU time of the hand's screen", "hand"),
    Stage.REACHABLE: (
        "cpu_reach",
        "CPU time of the arm's screen and the search for motions",
        "hand",
    ),
    Stage.PLANNED: ("cpu_plan", "CPU time of the motion's timing", "arm"),
    Stage.EXECUTED: ("cpu_trial", "CPU time of the trial", "hand"),
}
"""Column, description and first mode of each stage's CPU time."""


CONTESTED_CONFIDENCE = 0.9
"""An executed verdict with less confidence is contested."""


@dataclass(frozen=True)
class Verdict(Findings):
    """What became of a grasp.

    Attributes:
        outcome: the one outcome.
        stage: the stage that decided; for `simulation_failed` the stage that failed.
        judged_again: preset of the engine that judged a contested grasp again, and gave this
            verdict; empty where it is the run's own.
        outcome_before: the outcome that the run's own engine gave, where another has judged again.
        cpu: CPU time by stage [s].
        interrupted: whether it failed because its worker process was ended from outside, so that
            another try may give an answer.
    """

    outcome: Outcome = field(metadata=TextField("", "how the grasp ended", of=Outcome).metadata)
    stage: Stage = field(
        metadata=TextField(
            "", "the stage that decided the outcome", of=Stage, replayed=False
        ).metadata
    )
    judged_again: str = field(
        default="",
        metadata=TextField(
            "", "the engine that gave the verdict, if not the run's", replayed=False
        ).metadata,
        kw_only=True,
    )
    outcome_before: str = field(
        default="",
        metadata=TextField(
            "", "the outcome by the run's engine, where another judged", replayed=False
        ).metadata,
        kw_only=True,
    )
    cpu: Mapping[Stage, float] = field(
        default_factory=dict,
        metadata=StagesField("s", "CPU time of a stage", times=CPU_TIME_COLUMNS).metadata,
        kw_only=True,
    )
    interrupted: bool = field(default=False, kw_only=True)

    @property
    def contested(self) -> bool:
        """Whether other trials of the same grasp may well end differently, and none has settled
        it."""
        return (
            self.confidence is not None
            and self.confidence < CONTESTED_CONFIDENCE
            and not self.judged_again
        )

    def is_open(self, *, retry_failed: bool = False) -> bool:
        """Whether a later call asks again.

        Args:
            retry_failed: not only where it was interrupted, but wherever the simulation failed.
        """
        return self.interrupted or (retry_failed and self.outcome is Outcome.SIMULATION_FAILED)


class RecordedFields:
    """Fields of a verdict that are written, by who finds them."""

    trial = verdict_fields(TrialFindings)  # Findings of a trial.
    stages = verdict_fields(Findings)  # Findings of the stages of a judge.
    # All written fields in the order of files: outcome and stage first.
    verdict = tuple(
        sorted(verdict_fields(Verdict), key=lambda one: one.name not in ("outcome", "stage"))
    )


class MarginNames:
    """Names of the margins, by what they have in common."""

    all = tuple(one.name for one in fields(Margins))  # In the order of tables.
    # Names of the margins of which a smaller one is better.
    smaller_is_better = frozenset(
        one.name for one in fields(Margins) if one.metadata["smaller_is_better"]
    )
    # Length of the lift that was asked for, or for which there is room.
    lift_height = "lift_height"
    # Measured by the arm's screen.
    arm_screen = tuple(
        one.name for one in fields(Margins) if one.metadata["stage"] is Stage.REACHABLE
    )
    trial = tuple(Margins().of_trial())  # Measured by a trial.


CPU_COLUMNS = {stage: name for stage, (name, _, _) in CPU_TIME_COLUMNS.items()}
"""Column of the CPU time of each stage."""
INSTANCE_PREFIXES = {
    one.name: one.prefix for one in RecordedFields.verdict if isinstance(one, InstancesField)
}
"""Prefixes of the columns of displacements; the instance's name follows."""
MOVED_PREFIX, TURNED_PREFIX, PUSHED_PREFIX = (
    INSTANCE_PREFIXES[name] for name in ("displacements", "turned", "pushed")
)


def fields_of_part(shape: TableShape, part: VerdictPart) -> list[VerdictField]:
    """The fields that a part of a row has in tables of a shape."""
    return [one for one in RecordedFields.verdict if one.part == part and shape.has(one.mode)]


def display_order(
    first: Sequence[str], names: Sequence[str], *, without: Sequence[str]
) -> list[str]:
    """Names in an order for people: the first ones, then the others, so that a new one is shown
    without being named; those aside that are shown elsewhere, or to nobody."""
    return [*first, *(name for name in names if name not in {*first, *without})]


def merge_findings(stages: Sequence[Findings]) -> dict[str, Any]:
    """What several stages found together, by field; see `VerdictField.merge`."""
    return {
        one.name: one.merge([getattr(s, one.name) for s in stages]) for one in RecordedFields.stages
    }
