"""How well the scores of a set rank its grasps, judged by one of its columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import GraspSet, Outcome, Stage
from burg_drake.grasping.comparison.average_precision import (
    FRICTIONS,
    TopPrecision,
    precision_at_top,
    precision_recall,
)

FRICTION_NEEDED = "friction_needed"
"""Column of least friction coefficients; it is judged at GraspNet-1Billion's coefficients."""
CLEARANCE = "clearance"
"""Column of signed clearances [m]; one below 0 is a collision."""
SCREENED = ("screened", "outcome")
"""Columns of outcomes of which those of the stage `clear` are collisions."""
COLLISIONS = tuple(outcome.value for outcome in Outcome if outcome.stage is Stage.CLEAR)
"""Outcomes of the screen."""


@dataclass(frozen=True, eq=False)
class Ranking:
    """Scores held against a column.

    Attributes:
        column: its name.
        criteria: what makes a grasp good, such as `lifted` or `mu 0.4`.
        grasps: how many are judged.
        good: how many of them are good, by criterion.
        average_precision: area under precision over recall, without suppression, by criterion.
        top: GraspNet-1Billion's figure.
        colliding: grasps that are bad at any friction because the hand collides, as in
            GraspNet-1Billion's figure; None where the column says itself which grasps are good, or
            no column tells collisions.
    """

    column: str
    criteria: tuple[str, ...]
    grasps: int
    good: tuple[int, ...]
    average_precision: tuple[float, ...]
    top: TopPrecision
    colliding: int | None = None


def rank_by(grasps: GraspSet, column: str) -> Ranking:
    """Judges the scores of a set.

    Args:
        grasps: with scores; of equal scores none is better.
        column: `friction_needed`, judged at several coefficients, where what collides is bad (a
            negative `clearance`, or so `screened` or `outcome`); outcomes, of which `lifted` is
            good, or `reachable` where there were no trials, and grasps without an outcome are left
            out; or truth values or 0 and 1, where NaN is left out, too.

    Raises:
        UnknownNameError: there is no such column.
        InvalidInputError: the column holds something else or nothing, or no grasp has a score.
    """
    criteria, judged, good = _judge(grasps.column(column), column)
    colliding = _colliding(grasps) if column == FRICTION_NEEDED else None
    if colliding is not None:
        good = good & ~colliding[:, None]
    if not judged.any():
        raise InvalidInputError(
            f"column {column!r} has no values, so that no grasp can be ranked by it"
        )
    grasps, good = grasps.select(judged), good[judged]
    if not np.isfinite(grasps.score).any():
        raise InvalidInputError(
            "average precision ranks grasps by score, but no grasp with a value of "
            f"{column!r} has a score"
        )
    curves = [precision_recall(grasps.score, of_one) for of_one in good.T]
    return Ranking(
        column=column,
        criteria=criteria,
        grasps=len(grasps),
        good=tuple(good.sum(axis=0).tolist()),
        average_precision=tuple(curve.ap for curve in curves),
        top=precision_at_top(grasps, good),
        colliding=None if colliding is None else int(colliding.sum()),
    )


def _colliding(grasps: GraspSet) -> NDArray[np.bool_] | None:
    """(N,) whether some column tells that the hand collides; None if none tells anything."""
    known = colliding = np.full(len(grasps), False)
    for name, values in grasps.columns.items():
        if name == CLEARANCE and values.dtype.kind == "f":
            known, colliding = known | ~np.isnan(values), colliding | (values < 0.0)
        elif name in SCREENED and values.dtype.kind == "U":
            known, colliding = known | (values != ""), colliding | np.isin(values, COLLISIONS)
    return colliding if known.any() else None


def _judge(
    values: NDArray[Any], name: str
) -> tuple[tuple[str, ...], NDArray[np.bool_], NDArray[np.bool_]]:
    """Names of the criteria, (N,) whether a grasp is judged, (N, L) whether it is good."""
    if values.dtype.kind == "b":
        return (name,), np.full(len(values), True), values[:, None]
    if values.dtype.kind == "U":
        if set(values.tolist()) <= {*Outcome, ""}:
            tried = Outcome.REACHABLE not in values
            best = Outcome.LIFTED if tried else Outcome.REACHABLE
            return (best.value,), values != "", (values == best)[:, None]
    elif name == FRICTION_NEEDED:
        names = tuple(f"mu {mu:g}" for mu in FRICTIONS)
        return names, np.full(len(values), True), values[:, None] <= np.array(FRICTIONS)
    elif np.isin(values[~np.isnan(values)], (0, 1)).all():
        return (name,), ~np.isnan(values), (values == 1)[:, None]
    raise InvalidInputError(
        f"column {name!r} does not say which grasps are good; give {FRICTION_NEEDED}, a"
        " column of outcomes, or a column of true/false or 0/1"
    )
