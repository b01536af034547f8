"""Objects that stand on each other's places.

An object that was not found where it belongs, or only fits badly there, may stand where another one
belongs that was not found either. So the shape of the one is looked for around the target of the
other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.cameras.placement.alignment import Aligner, Alignment, TargetShape
from burg_drake.cameras.placement.candidates import (
    Placed,
    candidates,
    promising,
    support_of,
    uncovered,
)
from burg_drake.cameras.placement.localization import Located, best_alignment
from burg_drake.core import Array

MIN_AGREEMENT = 0.7
"""Agreement of what is seen of an object's outline from which on it may stand in a place."""
MIN_OUTLINE_SHARE = 0.4
"""Share of its outline that is seen and agrees from which on it is said to stand in another's
place: with less, an object behind another one fits many things."""
MIN_SILHOUETTE_EVIDENCE = 0.6
"""Mean evidence in its silhouette for that."""
MIN_COLOR_LIKENESS = 0.4
"""Likeness of its colors for that, where they are known."""
MIN_SCORE_GAIN = 0.5
"""By how much better than the object that belongs there, and than in its own place, it has to fit:
in the sum of agreement, evidence and likeness, which is 3 at most."""


def exchanged_objects(
    aligner: Aligner,
    shapes: dict[str, TargetShape],
    located: dict[str, Located],
    doubtful: list[str],
) -> tuple[dict[str, tuple[str, Placed]], set[str]]:
    """Which object stands in the place of which, and where exactly.

    Args:
        aligner: of the image.
        shapes: the objects by name.
        located: what was found.
        doubtful: names of those that were not found for sure, the only ones looked at.

    Returns:
        By the name of the place: the name of what stands there, its shape as if that were its
        target, and its displacement from there. And the names of places in which their own objects
        do not stand, but others of the scene may that were not found anywhere.
    """
    sure = {
        name: (shapes[name], found.alignment.q)
        for name, found in located.items()
        if name not in doubtful and found.alignment is not None
    }
    others = aligner.view.depth(sure.values())
    own = {name: _fit(aligner, shapes[name], located[name].alignment, others) for name in doubtful}
    rated = []
    for place in doubtful:
        for name in doubtful:
            if name == place:
                continue
            shape = at_place_of(shapes[name], shapes[place])
            found = _found(aligner, shape, sure, others)
            fit = _fit(aligner, shape, found, others)
            clear = fit.total > max(own[place].total, own[name].total) + MIN_SCORE_GAIN
            if found is not None and fit.good and fit.shown > MIN_OUTLINE_SHARE and clear:
                rated.append((fit.total, place, name, (shape, found.q)))
    stands: dict[str, tuple[str, Placed]] = {}
    for _, place, name, placed in sorted(rated, key=lambda r: -r[0]):
        if place not in stands and name not in {other for other, _ in stands.values()}:
            stands[place] = name, placed
    elsewhere = {name for name, _ in stands.values()}
    lost = {name for name in doubtful if not own[name].good} - elsewhere
    empty = {place for place in lost | elsewhere if place not in stands and lost - {place}}
    return stands, empty


def at_place_of(shape: TargetShape, place: TargetShape) -> TargetShape:
    """An object as if its target were where another one's reference point belongs."""
    X_SO = shape.X_SO.copy()
    X_SO[:2, 3] += (place.p_SR - shape.p_SR)[:2]
    return replace(shape, X_SO=X_SO)


def _found(
    aligner: Aligner, shape: TargetShape, sure: dict[str, Placed], others: Array
) -> Alignment | None:
    evidence = uncovered(aligner, sure)
    starts = promising(candidates(aligner.view, shape, evidence))
    return best_alignment(aligner, shape, starts, others, far=True)


@dataclass(frozen=True)
class _Fit:
    """How well an object fits where it was aligned.

    Attributes:
        total: agreement, evidence and likeness together.
        good: none of them is too low.
        shown: share of its outline that is seen and agrees.
    """

    total: float = 0.0
    good: bool = False
    shown: float = 0.0


def _fit(aligner: Aligner, shape: TargetShape, found: Alignment | None, others: Array) -> _Fit:
    if found is None:
        return _Fit()
    filled, _ = support_of(aligner.view, shape, found.q, aligner.evidence, others)
    alike = aligner.likeness(shape, found.q, others)
    colored = alike > MIN_COLOR_LIKENESS or not aligner.sees_colors or shape.colors is None
    _, seen = aligner.view.seen(shape, found.q, others)
    return _Fit(
        float(np.clip(found.agreement, 0.0, 1.0)) + filled + alike,
        found.agreement >= MIN_AGREEMENT and filled >= MIN_SILHOUETTE_EVIDENCE and colored,
        found.coverage * seen,
    )
