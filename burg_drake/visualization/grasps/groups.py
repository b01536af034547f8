"""Grasps put into groups of one colour each: by outcome, by a number, or by a name."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from burg_drake.core.grasps import Outcome
from burg_drake.core.terminal import CATEGORIES
from burg_drake.visualization.style import (
    BINS,
    GROUPS,
    OTHERS,
    UNJUDGED,
    UNKNOWN,
    ColorScale,
    Rgba,
    group_of,
    scale_of,
)


@dataclass(frozen=True, eq=False)
class GraspGroup:
    """Grasps that are drawn as one mesh.

    Attributes:
        key: tells the group from the others; part of its path in Meshcat.
        label: for legends; groups of the same label are one line there.
        rgba: colour.
        members: (M,) indices of the grasps.
    """

    key: str
    label: str
    rgba: Rgba
    members: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class NumberGroups:
    """Grasps by a number.

    Attributes:
        scale: which colours the numbers have.
        bins: (N,) bin of each grasp; -1 where the number is not known.
        beyond: how many numbers are below and above the scale.
        groups: of the bins that are not empty, lowest first, then of what is not known.
    """

    scale: ColorScale
    bins: NDArray[np.int64]
    beyond: tuple[int, int]
    groups: tuple[GraspGroup, ...]

    @property
    def counts(self) -> NDArray[np.int64]:
        """(BINS,) number of grasps in each bin."""
        return np.bincount(self.bins[self.bins >= 0], minlength=BINS)


def by_number(values: ArrayLike, limits: tuple[float, float] | None = None) -> NumberGroups:
    """Groups grasps by numbers (N,); NaN where one is not known.

    Args:
        values: (N,).
        limits: ends of the colour scale; they follow from the values if None.

    Raises:
        InvalidInputError: the limits do not rise.
    """
    numbers = np.asarray(values, dtype=float)
    scale = scale_of(numbers, limits)
    bins = scale.bins(numbers)
    colors = scale.colors()
    groups = [
        GraspGroup(bin_key(k), "", (*colors[k].tolist(), 1.0), np.flatnonzero(bins == k))
        for k in np.unique(bins[bins >= 0]).tolist()
    ]
    if (bins < 0).any():
        groups.append(GraspGroup("unknown", "not known", UNKNOWN, np.flatnonzero(bins < 0)))
    return NumberGroups(scale, bins, scale.beyond(numbers), tuple(groups))


def bin_key(bin: int) -> str:
    """The key of a bin's group."""
    return f"{bin:02d}"


def by_name(names: Sequence[str]) -> tuple[GraspGroup, ...]:
    """Groups grasps by names (N,), the most frequent first; empty ones are not known.

    Names that are outcomes, all of them, get the colours of outcomes.
    """
    texts = np.asarray(names, dtype=str)
    counts = Counter(texts[texts != ""].tolist())
    if counts and set(counts) <= {outcome.value for outcome in Outcome}:
        return by_outcome([Outcome(text) if text else None for text in texts.tolist()])
    ranked = sorted(counts, key=lambda name: (-counts[name], name))
    own = ranked[: len(CATEGORIES)]
    groups = [
        GraspGroup(f"name_{k}", name, rgba, np.flatnonzero(texts == name))
        for k, (name, rgba) in enumerate(zip(own, CATEGORIES, strict=False))
    ]
    rest = ranked[len(own) :]
    if rest:
        label = f"{len(rest)} other{'' if len(rest) == 1 else 's'}"
        groups.append(GraspGroup("others", label, OTHERS, np.flatnonzero(np.isin(texts, rest))))
    if (texts == "").any():
        groups.append(GraspGroup("unknown", "not known", UNKNOWN, np.flatnonzero(texts == "")))
    return tuple(groups)


def by_outcome(outcomes: Sequence[Outcome | None]) -> tuple[GraspGroup, ...]:
    """Groups grasps by outcomes (N,), best first; None for grasps that nobody judged."""
    index: dict[Outcome | None, list[int]] = {}
    for i, outcome in enumerate(outcomes):
        index.setdefault(outcome, []).append(i)
    order = [outcome for group in GROUPS for outcome in group.outcomes]
    return tuple(
        GraspGroup(
            outcome or "not_judged",
            group_of(outcome).name,
            group_of(outcome).rgba,
            np.array(index[outcome], dtype=np.int64),
        )
        for outcome in (*order, None)
        if outcome in index
    )


def all_alike(count: int) -> tuple[GraspGroup, ...]:
    """All grasps in one group."""
    return (GraspGroup("all", "grasps", UNJUDGED.rgba, np.arange(count)),) if count else ()
