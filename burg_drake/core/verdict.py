"""The verdict of a grasp: its fields, margins and columns."""

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
    """Continuous measures of how clear an outcome is, in SI units; NaN if not measured.

    Margins are equal if they have the same numbers, with NaN equal to NaN.
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
        " path counts, too, as geometry shows that it is free. nan if the hand was shaken",
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
        """Margins that a trial measures, by name; NaN if it ended earlier."""
        of_trial = (f.name for f in fields(self) if f.metadata["stage"] is Stage.EXECUTED)
        return {name: getattr(self, name) for name in of_trial}


@dataclass(frozen=True, kw_only=True)
class TrialFindings:
    """Results of a trial besides its outcome.

    Attributes:
        blocker: the obstacle at the start or during the motion, if any; for a link of the arm with
            the link, as "panda_link5 vs shelf".
        reason: message of the failure, if the outcome alone is not clear.
        margins: margins of the outcome.
        confidence: probability that an independent model of contact, with slightly different
            friction and hand pose, finds the same: that the target is held to the end, or that it
            is lost; see `simulation.confidence`. None if no trial decided, or the engine is not
            calibrated.
        displacements: largest displacement of any point of every other free object from its start
            [m], by instance; 0 if nothing touched the object or its neighbours. Empty if no trial
            started or it failed.
        turned: largest rotation of these objects [rad], by instance.
        toppled: names of these objects whose initially upright axis is tilted by more than 45
            degrees at the end, and that rest in another way than before, separated by commas;
            without objects that rolled.
        pushed: displacements by the approach, until the hand began to close, including the target
            [m]. Empty if the trial began at the grasp.
        touched: the first unplanned contact, as "panda_link5 vs can": any contact of the robot
            before the hand began to close; afterwards any contact of the arm's links, and contacts
            of the hand except with target and table. Empty if there was none, or if the trial began
            at the grasp.
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
        default_factory=dict,
        metadata=MarginsField("", "continuous slack", margins=Margins).metadata,
    )
    confidence: float | None = field(
        default=None,
        metadata=NumberField(
            DIMENSIONLESS,
            "probability that an independent model of contact, with slightly different friction and"
            " hand pose, also finds the object held, or lost",
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
        """The fields of `TrialFindings`, by name."""
        return {one.name: getattr(self, one.name) for one in fields(TrialFindings)}


@dataclass(frozen=True, kw_only=True)
class Findings(TrialFindings):
    """Results of a judge's stages besides the outcome, of one stage or all.

    Attributes:
        margins: measured margins, by the names of `Margins`.
        q_grasp, q_pregrasp: positions of the arm's joints [rad]; empty if not found.
    """

    margins: Mapping[str, float] = field(
        default_factory=dict,
        metadata=MarginsField("", "continuous slack", margins=Margins).metadata,
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


ONE_BY_ONE = "one by one on the CPU"
"""`Verdict.device` of grasps that an engine with parallel trials executes on the CPU instead."""
CONTESTED_CONFIDENCE = 0.9
"""An executed verdict with less confidence is contested."""


@dataclass(frozen=True)
class Verdict(Findings):
    """The verdict of a grasp.

    Attributes:
        outcome: the outcome.
        stage: the stage that decided; for `simulation_failed` the stage that failed.
        judged_again: preset of the engine that judged a contested grasp again, and gave this
            verdict; empty for the run's own engine.
        outcome_before: outcome from the run's own engine, if another engine judged again.
        cpu: CPU time by stage [s].
        interrupted: whether it failed because its worker process was ended from outside, so that a
            retry may succeed.
        device: devices of the process that executed the grasp by an engine with parallel trials,
            or `ONE_BY_ONE`; empty for other engines, and if an earlier stage decided. Sessions
            count it; journals and tables do not have it.
    """

    outcome: Outcome = field(
        metadata=TextField("", "how the grasp ended", value_type=Outcome).metadata
    )
    stage: Stage = field(
        metadata=TextField(
            "", "the stage that decided the outcome", value_type=Stage, replayed=False
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
    device: str = field(default="", compare=False, kw_only=True)

    @property
    def contested(self) -> bool:
        """Whether the confidence is low, and no other engine has judged the grasp again."""
        return (
            self.confidence is not None
            and self.confidence < CONTESTED_CONFIDENCE
            and not self.judged_again
        )

    def is_open(self, *, retry_failed: bool = False) -> bool:
        """Whether the grasp has to be judged again.

        Args:
            retry_failed: judge again all failed simulations, not only interrupted ones.
        """
        return self.interrupted or (retry_failed and self.outcome is Outcome.SIMULATION_FAILED)


class RecordedFields:
    """Written fields of a verdict, by their source."""

    trial = verdict_fields(TrialFindings)  # Findings of a trial.
    stages = verdict_fields(Findings)  # Findings of the stages of a judge.
    # All written fields in the order of files: outcome and stage first.
    verdict = tuple(
        sorted(verdict_fields(Verdict), key=lambda one: one.name not in ("outcome", "stage"))
    )


class MarginNames:
    """Names of the margins, by group."""

    all = tuple(one.name for one in fields(Margins))  # In the order of tables.
    # Names of the margins for which smaller is better.
    smaller_is_better = frozenset(
        one.name for one in fields(Margins) if one.metadata["smaller_is_better"]
    )
    # Length of the requested lift, or of the free part of it.
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
    """The fields in a part of a row, for tables of a shape."""
    return [one for one in RecordedFields.verdict if one.part == part and shape.includes(one.mode)]


def display_order(
    first: Sequence[str], names: Sequence[str], *, without: Sequence[str]
) -> list[str]:
    """Names in display order: those in `first`, then all others, so that new names are included;
    without those in `without`."""
    return [*first, *(name for name in names if name not in {*first, *without})]


def merge_findings(stages: Sequence[Findings]) -> dict[str, Any]:
    """Merges the findings of several stages by field; see `VerdictField.merge`."""
    return {
        one.name: one.merge([getattr(s, one.name) for s in stages]) for one in RecordedFields.stages
    }
