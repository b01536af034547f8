"""Average precision of ranked grasps: GraspNet-1Billion's AP, and plain average precision.

GraspNet-1Billion's AP (Fang et al., "GraspNet-1Billion", CVPR 2020) is the share of good grasps
among the best k, averaged over k = 1..50 and over the friction coefficients 0.2, 0.4 ... 1.2. As
in graspnetAPI (`graspnet_eval.py`, `eval_utils.py`, `graspnms.cpp`):

- near grasps are suppressed first, by falling score: less than 30 mm and less than 30 degrees from
  a grasp that is kept;
- the 10 best of each object are kept, then the 50 best of all;
- precision at k divides by k, also where there are fewer than k grasps;
- a grasp is good at a friction coefficient if it needs no more friction.

Differences from graspnetAPI:

- the angle is modulo the swap of the fingers;
- translations are between grasp frames at the tool centre point; graspnetAPI's lie behind the
  finger tips by a depth that differs from grasp to grasp;
- a grasp suppresses grasps of its own object and instance only, and belongs to the object that the
  set names; graspnetAPI assigns the nearest object after suppression;
- collisions and friction are computed by the caller; graspnetAPI takes 1.2, 1.0 ... 0.2 in turn
  until Dex-Net's force closure fails, and counts a grasp in collision as bad;
- equal scores are ordered by identifier, and grasps without a score come last;
- there is one list of grasps; graspnetAPI averages over views and scenes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core import Array, GraspSet, InvalidInputError, Outcome, Stage
from burg_drake.grasping.grasp_distance import (
    by_target,
    grasp_components,
    pair_angle,
    pair_translation,
)

AP_VERSION = 1
"""Raised when the same grasps get another average precision."""


class GraspNetSettings:
    """Constants of graspnetAPI."""

    frictions = (0.2, 0.4, 0.6, 0.8, 1.0, 1.2)  # Friction coefficients at which grasps are judged.
    top = 50  # Length of the list of best grasps.
    per_object = 10  # Grasps of an object that graspnetAPI keeps.
    suppression_distance = 0.03  # Metres. Closer grasps are suppressed.
    suppression_angle = math.radians(30.0)  # Radians. Closer grasps are suppressed.


@dataclass(frozen=True, eq=False)
class TopPrecision:
    """Precision of the best grasps, GraspNet-1Billion's AP.

    Attributes:
        kept: indices of the ranked grasps, best first; at most `top`.
        precision: (top, L) share of good grasps among the best k, for each of L criteria.
        version: `AP_VERSION`.
    """

    kept: NDArray[np.intp]
    precision: Array
    version: int = field(default=AP_VERSION)

    @property
    def ap(self) -> float:
        """Mean over all k and criteria."""
        return float(self.precision.mean())

    @property
    def by_criterion(self) -> Array:
        """(L,) mean over k; with friction coefficients AP_0.2, AP_0.4 and so on."""
        mean: Array = self.precision.mean(axis=0)
        return mean

    @property
    def attainable(self) -> float:
        """`ap` if all kept grasps were good; below 1 if there are fewer than `top`."""
        k = np.arange(1, len(self.precision) + 1)
        return float(np.mean(np.minimum(k, len(self.kept)) / k))


@dataclass(frozen=True, eq=False)
class PrecisionRecall:
    """Curve of precision over recall as the score threshold falls.

    Attributes:
        score: (K,) distinct scores, falling.
        precision: (K,) share of good grasps among those with at least this score.
        recall: (K,) share of all good grasps with at least this score; NaN if none is good.
        version: `AP_VERSION`.
    """

    score: Array
    precision: Array
    recall: Array
    version: int = field(default=AP_VERSION)

    @property
    def ap(self) -> float:
        """Sum of precision times the step in recall; NaN if no grasp is good."""
        return float(np.sum(self.precision * np.diff(self.recall, prepend=0.0)))


def graspnet_ap(
    grasps: GraspSet,
    friction_needed: ArrayLike,
    *,
    frictions: Sequence[float] = GraspNetSettings.frictions,
    top: int = GraspNetSettings.top,
    per_object: int | None = GraspNetSettings.per_object,
) -> TopPrecision:
    """GraspNet-1Billion's AP of the scores of a set.

    Args:
        grasps: N grasps with scores.
        friction_needed: (N,) smallest friction coefficient at which each grasp holds; NaN or
            infinity for grasps that never hold, or collide.
        frictions: coefficients at which grasps are judged.
        top: length of the longest list.
        per_object: largest number of grasps kept per object (and instance); None for all.

    Raises:
        InvalidInputError: the shape does not fit, or a number is out of range.
    """
    needed = np.asarray(friction_needed, dtype=float)
    if needed.shape != (len(grasps),):
        raise InvalidInputError(
            f"friction_needed has shape {needed.shape}; expected ({len(grasps)},)"
        )
    good = needed[:, None] <= np.asarray(frictions, dtype=float)
    return precision_at_top(grasps, good, top=top, per_object=per_object)


def precision_at_top(
    grasps: GraspSet,
    good: ArrayLike,
    *,
    top: int = GraspNetSettings.top,
    per_object: int | None = GraspNetSettings.per_object,
) -> TopPrecision:
    """Precision of the best k grasps after suppression, for k = 1..top.

    Args:
        grasps: N grasps with scores.
        good: (N,) or (N, L) bool: whether each grasp is good, by one or by L criteria.
        top: length of the longest list.
        per_object: largest number of grasps kept per object (and instance); None for all.

    Raises:
        InvalidInputError: the shape does not fit, or a number is out of range.
    """
    if top < 1 or (per_object is not None and per_object < 1):
        raise InvalidInputError(f"top is {top} and per_object {per_object}; give 1 or more")
    criteria = np.asarray(good)
    if criteria.dtype != bool or criteria.ndim not in (1, 2) or len(criteria) != len(grasps):
        raise InvalidInputError(
            f"good has shape {criteria.shape} and type {criteria.dtype};"
            f" expected ({len(grasps)},) or ({len(grasps)}, L) of bool"
        )
    if criteria.ndim == 1:
        criteria = criteria[:, None]
    kept = suppress_near_grasps(grasps, per_object)[:top]
    hits = np.zeros((top, criteria.shape[1]))
    hits[: len(kept)] = criteria[kept]
    return TopPrecision(kept, np.cumsum(hits, axis=0) / np.arange(1, top + 1)[:, None])


def suppress_near_grasps(grasps: GraspSet, per_object: int | None = None) -> NDArray[np.intp]:
    """Greedy suppression of grasps that are near a better one of the same object and instance.

    Args:
        grasps: N grasps with scores.
        per_object: largest number of grasps kept per object (and instance); None for all.

    Returns:
        Indices of the kept grasps, best first.
    """
    order = rank_by_score(grasps)
    rank = np.empty(len(grasps), dtype=np.intp)
    rank[order] = np.arange(len(grasps))
    kept = [np.empty(0, dtype=np.intp)]
    for target in by_target(grasps):
        rows = target[np.argsort(rank[target])]
        stay = _kept_positions(grasp_components(grasps.X_OG[rows]), per_object)
        kept.append(rank[rows[stay]])
    return order[np.sort(np.concatenate(kept))]


def rank_by_score(grasps: GraspSet) -> NDArray[np.intp]:
    """Indices by falling score, then identifier; grasps without a score come last."""
    return np.lexsort((grasps.id, np.where(np.isnan(grasps.score), np.inf, -grasps.score)))


def precision_recall(score: ArrayLike, good: ArrayLike) -> PrecisionRecall:
    """Precision-recall curve of all grasps, without suppression; equal scores are one step.

    Args:
        score: (N,) higher is better; NaN is below every score.
        good: (N,) bool.

    Raises:
        InvalidInputError: the shapes do not fit.
    """
    s, g = np.asarray(score, dtype=float), np.asarray(good)
    if s.ndim != 1 or g.shape != s.shape or g.dtype != bool:
        raise InvalidInputError(
            f"score has shape {s.shape}, good shape {g.shape} and type {g.dtype};"
            " expected (N,) numbers and (N,) bool"
        )
    fall = np.where(np.isnan(s), -np.inf, s)
    order = np.argsort(-fall, kind="stable")
    fall, hits = fall[order], np.cumsum(g[order])
    last = np.flatnonzero(np.append(fall[1:] != fall[:-1], True)[: len(fall)])
    total = int(g.sum())
    recall = hits[last] / total if total else np.full(len(last), np.nan)
    return PrecisionRecall(fall[last], hits[last] / (last + 1), recall)


def _kept_positions(G: Array, limit: int | None) -> list[int]:
    """Indices of the grasps kept by suppression, of (12, N) components in falling order of
    score."""
    kept: list[int] = []
    left = np.arange(G.shape[1])
    while len(left) and (limit is None or len(kept) < limit):
        best, left = left[0], left[1:]
        kept.append(int(best))
        F = G[:, best, None]
        near = pair_translation(G[:, left], F) < GraspNetSettings.suppression_distance
        near[near] = pair_angle(G[:, left[near]], F) < GraspNetSettings.suppression_angle
        left = left[~near]
    return kept


FRICTION_NEEDED = "friction_needed"
"""Column of the smallest friction coefficients, judged at those of GraspNet-1Billion."""
COLLISION_OUTCOMES = tuple(outcome.value for outcome in Outcome if outcome.stage is Stage.CLEAR)
"""Outcomes of the stage `clear`."""


@dataclass(frozen=True, eq=False)
class Ranking:
    """Average precision of scores, judged by a column.

    Attributes:
        column: its name.
        criteria: criteria of good grasps, such as `lifted` or `mu 0.4`.
        grasps: number of judged grasps.
        good: number of good grasps, by criterion.
        average_precision: area under precision over recall, without suppression, by criterion.
        top: GraspNet-1Billion's AP.
        colliding: number of grasps that are bad at any friction because the hand collides, as in
            GraspNet-1Billion's AP; None if the column itself states which grasps are good, or no
            column states collisions.
    """

    column: str
    criteria: tuple[str, ...]
    grasps: int
    good: tuple[int, ...]
    average_precision: tuple[float, ...]
    top: TopPrecision
    colliding: int | None = None


def rank_by(grasps: GraspSet, column: str) -> Ranking:
    """Average precision of the scores of a set, judged by one of its columns.

    Args:
        grasps: grasps with scores; equal scores are ties.
        column: one of three kinds. `friction_needed` is judged at several coefficients; colliding
            grasps (by `clearance`, `screened` or `outcome`) are bad. Of outcomes, `lifted` is good,
            or `reachable` without trials; grasps without an outcome are left out. Of truth values
            or 0 and 1, true is good; NaN is left out.

    Raises:
        UnknownNameError: there is no such column.
        InvalidInputError: the column holds something else or nothing, or no grasp has a score.
    """
    criteria, judged, good = _judge_by_column(grasps.column(column), column)
    colliding = _are_colliding(grasps) if column == FRICTION_NEEDED else None
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
    curves = [precision_recall(grasps.score, is_good) for is_good in good.T]
    return Ranking(
        column=column,
        criteria=criteria,
        grasps=len(grasps),
        good=tuple(good.sum(axis=0).tolist()),
        average_precision=tuple(curve.ap for curve in curves),
        top=precision_at_top(grasps, good),
        colliding=None if colliding is None else int(colliding.sum()),
    )


def _are_colliding(grasps: GraspSet) -> NDArray[np.bool_] | None:
    """(N,) whether any column states that the hand collides; None if no column has values."""
    known = colliding = np.full(len(grasps), False)
    for name, values in grasps.columns.items():
        if name == "clearance" and values.dtype.kind == "f":
            known, colliding = known | ~np.isnan(values), colliding | (values < 0.0)
        elif name in ("screened", "outcome") and values.dtype.kind == "U":
            known = known | (values != "")
            colliding = colliding | np.isin(values, COLLISION_OUTCOMES)
    return colliding if known.any() else None


def _judge_by_column(
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
        limits = GraspNetSettings.frictions
        names = tuple(f"mu {mu:g}" for mu in limits)
        return names, np.full(len(values), True), values[:, None] <= np.array(limits)
    elif np.isin(values[~np.isnan(values)], (0, 1)).all():
        return (name,), ~np.isnan(values), (values == 1)[:, None]
    raise InvalidInputError(
        f"column {name!r} does not say which grasps are good; give {FRICTION_NEEDED}, a"
        " column of outcomes, or a column of true/false or 0/1"
    )
