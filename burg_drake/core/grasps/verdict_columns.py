"""What follows from the declaration of a verdict: its fields in the order of files, and the names
of their columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

from burg_drake.core.grasps.outcome import Stage
from burg_drake.core.grasps.verdict import CPU_TIMES, Findings, Margins, TrialFindings, Verdict
from burg_drake.core.grasps.verdict_field import (
    InstancesField,
    TableShape,
    VerdictField,
    VerdictPart,
    verdict_fields,
)

TRIAL_FINDINGS = verdict_fields(TrialFindings)
"""What rows of tables tell of a trial."""
FINDINGS = verdict_fields(Findings)
"""What stages find."""
VERDICT_FIELDS = tuple(
    sorted(verdict_fields(Verdict), key=lambda one: one.name not in ("outcome", "stage"))
)
"""All fields that are written, in the order of files: how it ended, then why."""

MARGINS = tuple(one.name for one in fields(Margins))
"""Names of all margins, in the order of tables."""
SMALLER_IS_BETTER = frozenset(
    one.name for one in fields(Margins) if one.metadata["smaller_is_better"]
)
"""Names of the margins of which a smaller one is better."""
LIFT_HEIGHT = "lift_height"
"""Margin: length of the lift that was asked for, or for which there is room."""
ARM_SCREEN_MARGINS = tuple(
    one.name for one in fields(Margins) if one.metadata["stage"] is Stage.REACHABLE
)
"""Margins that the arm's screen measures."""
TRIAL_MARGINS = tuple(Margins().of_trial())
"""Margins that a trial measures."""
CPU_COLUMNS = {stage: name for stage, (name, _, _) in CPU_TIMES.items()}
"""Columns of the CPU time of each stage."""
PREFIXES = {one.name: one.prefix for one in VERDICT_FIELDS if isinstance(one, InstancesField)}
"""What columns of displacements begin with; the instance's name follows."""
MOVED, TURNED, PUSHED = (PREFIXES[name] for name in ("displacements", "turned", "pushed"))


def fields_in(shape: TableShape, part: VerdictPart) -> list[VerdictField]:
    """The fields that a part of a row has in tables of a shape."""
    return [one for one in VERDICT_FIELDS if one.part == part and shape.has(one.mode)]


def shown_order(first: Sequence[str], names: Sequence[str], *, without: Sequence[str]) -> list[str]:
    """Names in an order for people: the first ones, then the others, so that a new one is shown
    without being named; those aside that are shown elsewhere, or to nobody."""
    return [*first, *(name for name in names if name not in {*first, *without})]


def joined_findings(stages: Sequence[Findings]) -> dict[str, Any]:
    """What several stages found together, by field; see `VerdictField.joined`."""
    return {one.name: one.joined([getattr(s, one.name) for s in stages]) for one in FINDINGS}
