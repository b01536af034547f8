"""One trial as a row of a table tells it: enough to execute it again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeVar

import numpy as np

from burg_drake.core import Array, InvalidInputError, check_pose, nearest, quoted
from burg_drake.core.grasps import LIFT_HEIGHT, TRIAL_FINDINGS, Outcome, Stage, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.records.origin import ORIGIN_TEXT

Member = TypeVar("Member", bound=StrEnum)

LARGEST = 1e6
"""Of mass [kg] and friction; what is beyond cannot be simulated."""
NEEDED = ("id", "instance", "outcome", "stage", "X_OG", "engine", *ORIGIN_TEXT)
"""Columns without which a row cannot be executed again."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RecordedTrial:
    """A grasp and what became of it.

    Attributes:
        id: of the grasp, or of this trial of it.
        instance: name of the target in the scene.
        object: its name in the library.
        X_OG: (4, 4) grasp in the target's frame.
        width: distance of the contacts [m].
        score: the sampler's.
        friction: coefficient in place of the library's.
        mass: in place of the library's [kg].
        verdict: what became of it; None if nobody has judged it.
    """

    id: str
    instance: str
    object: str = ""
    X_OG: Array
    width: float = math.nan
    score: float = math.nan
    friction: float | None = None
    mass: float | None = None
    verdict: Verdict | None = None

    @property
    def lift(self) -> float | None:
        """Length of the lift that was executed, in place of the motion's [m]; None if it is not
        known, which it is not of older releases."""
        height = math.nan if self.verdict is None else self.verdict.margins.get(LIFT_HEIGHT)
        return None if height is None or math.isnan(height) else height

    @property
    def candidate(self) -> Candidate:
        """What a judge has to know."""
        return Candidate(
            self.id,
            self.instance,
            self.X_OG,
            self.friction,
            self.mass,
            width=self.width,
            lift=self.lift,
        )


def pose_text(X_OG: Array) -> str:
    """The upper three rows of a pose (4, 4), one after the other; every bit is kept."""
    return " ".join(map(repr, X_OG[:3].ravel().tolist()))


def pose_from_text(text: str, where: str) -> Array:
    """The pose (4, 4) that `pose_text` wrote.

    Raises:
        InvalidInputError: the text is something else.
    """
    words, numbers = text.split(), []
    expected = "it must be the 12 numbers of the upper three rows of the pose"
    for word in words:
        try:
            numbers.append(float(word))
        except ValueError as error:
            raise InvalidInputError(f"{where}: X_OG contains {quoted(word)}; {expected}") from error
    if len(words) != 12:
        raise InvalidInputError(f"{where}: X_OG has {len(words)} numbers; {expected}")
    upper = np.array(numbers).reshape(3, 4)
    return check_pose(np.vstack([upper, (0.0, 0.0, 0.0, 1.0)]), f"{where}: X_OG")


def read_trial(row: Mapping[str, Any], where: str) -> RecordedTrial:
    """The trial that a row tells.

    Args:
        row: cells by column.
        where: names the row in messages.

    Raises:
        InvalidInputError: columns are missing, or a cell cannot be read.
    """
    missing = [name for name in NEEDED if name not in row]
    if missing:
        raise InvalidInputError(
            f"{where}: column {', '.join(missing)} is missing (older releases did not"
            " write it), so this row cannot be replayed by itself; give the folder of"
            " its run"
        )
    empty = [name for name in NEEDED if row[name] == ""]
    if empty:
        raise InvalidInputError(
            f"{where}: {', '.join(empty)} is empty, without which a row alone cannot be replayed;"
            " give the folder of its run"
        )
    outcome = _member(Outcome, row["outcome"], f"{where}: outcome")
    stage = _member(Stage, row["stage"], f"{where}: stage")
    findings = {one.name: one.from_row(row) for one in TRIAL_FINDINGS}
    return RecordedTrial(
        id=row["id"],
        instance=row["instance"],
        object=row.get("object", ""),
        X_OG=pose_from_text(row["X_OG"], where),
        width=_number(row, "width", where),
        friction=_given(row, "friction", where),
        mass=_given(row, "mass", where),
        verdict=Verdict(outcome, stage, **findings),
    )


def _member(kind: type[Member], text: str, where: str) -> Member:
    known = [member.value for member in kind]
    if text not in known:
        raise InvalidInputError(
            f"{where} {quoted(text)} is not known to this release; {nearest(text, known)}"
        )
    return kind(text)


def _given(row: Mapping[str, Any], name: str, where: str) -> float | None:
    """A property of the object in place of the library's; None if the row tells none."""
    value = _number(row, name, where)
    if math.isnan(value):
        return None
    if value < 0.0 or value > LARGEST or (name == "mass" and value == 0.0):
        raise InvalidInputError(
            f"{where}: {name} is {value:g}; it must be above 0 and at most {LARGEST:g}"
        )
    return value


def _number(row: Mapping[str, Any], name: str, where: str) -> float:
    """NaN where there is none."""
    value = row.get(name, math.nan)
    try:
        return float(value)
    except ValueError as error:
        raise InvalidInputError(f"{where}: {name} is {quoted(value)}, not a number") from error
