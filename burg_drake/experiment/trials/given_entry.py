"""What is given to be entered for a trial, before anything is written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from burg_drake.core import InvalidInputError, UnknownNameError, nearest, quoted
from burg_drake.core.grasps import RealOutcome
from burg_drake.experiment.trials.entries import FIELDS
from burg_drake.experiment.trials.sheet import RealTrial, RobotReport

EMPTY: dict[str, Any] = {
    **dict.fromkeys(("time", "operator", "note", "photo"), ""),
    "outcome": None,
    "placement": {},
    "robot": None,
}
"""Fields of a trial that nothing has been entered for."""

WORDS = ("operator", "note")
"""Fields that people write."""


def real_outcome(name: str) -> RealOutcome:
    """The outcome of a name.

    Raises:
        InvalidInputError: there is none; the message names the nearest.
    """
    known = [outcome.value for outcome in RealOutcome]
    if name not in known:
        meant = nearest(name, known, ordered=True)
        raise InvalidInputError(f"there is no outcome {quoted(name)}; {meant}")
    return RealOutcome(name)


def checked(entry: Mapping[str, Any]) -> dict[str, Any]:
    """An entry whose fields exist, with the outcome as such and without blanks around words."""
    for name, value in entry.items():
        if name not in EMPTY:
            raise UnknownNameError(f"a trial has no entry {quoted(name)}; {nearest(name, FIELDS)}")
        if isinstance(value, str) and "\0" in value:
            raise InvalidInputError(f"{name} has a NUL character: {quoted(value)}")
    outcome = entry.get("outcome")
    words = {name: entry[name].strip() for name in WORDS if isinstance(entry.get(name), str)}
    return {
        **entry,
        **words,
        **({} if outcome is None else {"outcome": real_outcome(outcome)}),
    }


def merged(trial: RealTrial, given: Mapping[str, Any]) -> dict[str, Any]:
    """With a report of the robot that has what is told besides what is known."""
    robot = given.get("robot")
    if not isinstance(robot, Mapping):
        return dict(given)
    return {**given, "robot": replace(trial.robot or RobotReport(), **robot)}


def includes(value: Any, present: Any) -> bool:
    """Whether a value says all that is there."""
    if isinstance(value, RobotReport) and isinstance(present, RobotReport):
        return all(v in (None, getattr(value, k)) for k, v in vars(present).items())
    return bool(value == present)
