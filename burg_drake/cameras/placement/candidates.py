"""Where the objects of a scene may be, by the evidence alone: the clearest object first, and where
that is no other one."""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.cameras.placement.alignment import (
    Aligner,
    PinholeView,
    TargetShape,
    Window,
    window_slices,
)
from burg_drake.cameras.placement.search import SearchResult, find_places
from burg_drake.core import Array

PROMISING = 0.2
"""Mean evidence in the silhouette of a place that is only roughly known below which nothing is
there."""
BEHIND = 0.12
"""By how much the evidence of a place may be less than that of another one and still be tried."""
LEAST_PIXELS = 30.0
"""With less evidence in its silhouette an object is not looked for [pixels]."""

Placed = tuple[TargetShape, Array]
"""An object and its displacement."""


def assigned_places(
    aligner: Aligner, shapes: dict[str, TargetShape], placed: dict[str, Placed]
) -> dict[str, list[Array]]:
    """Candidate displacements of the objects that seem to be there, best first; not where others
    are already."""
    view, evidence = aligner.view, uncovered(aligner, placed)
    waiting = {name: candidates(view, shape, evidence) for name, shape in shapes.items()}
    assigned: dict[str, list[Array]] = {}
    while waiting:
        rated = {n: _rating(view, shapes[n], found, evidence) for n, found in waiting.items()}
        name = max(rated, key=lambda n: rated[n])
        if rated[name] < PROMISING:
            break
        assigned[name] = promising(waiting.pop(name))
        window = _cover(view, shapes[name], assigned[name][0], evidence)
        for other, found in waiting.items():
            if _overlap(window, view.window(shapes[other], found[0].q, 20.0)):
                waiting[other] = candidates(view, shapes[other], evidence)
    return assigned


def uncovered(aligner: Aligner, placed: dict[str, Placed]) -> Array:
    """(H, W) the evidence that no object explains that has its place."""
    evidence = aligner.evidence.copy()
    for shape, q in placed.values():
        _cover(aligner.view, shape, q, evidence)
    return evidence


def promising(found: list[SearchResult]) -> list[Array]:
    """The displacements of places that may turn out to be the best, the likeliest first."""
    best = max(f.score for f in found)
    return [f.q for i, f in enumerate(found) if i == 0 or f.score > best - BEHIND]


def candidates(view: PinholeView, shape: TargetShape, evidence: Array) -> list[SearchResult]:
    """Where an object may be; if it is not near its target's angle, the best of all first."""
    found = find_places(view, shape, evidence)
    if _rating(view, shape, found, evidence) >= PROMISING:
        return found
    return sorted(found, key=lambda f: -support_of(view, shape, f.q, evidence, None)[0])


def _rating(
    view: PinholeView, shape: TargetShape, found: list[SearchResult], evidence: Array
) -> float:
    """How sure it is that an object is where it was found: its support, more for a large one."""
    support, area = support_of(view, shape, found[0].q, evidence, None)
    return support if area > LEAST_PIXELS else -1.0


def support_of(
    view: PinholeView, shape: TargetShape, q: Array, evidence: Array, others: Array | None
) -> tuple[float, float]:
    """Mean evidence in the silhouette where there is any, and how many pixels that are."""
    window = view.window(shape, q, 2.0)
    depth = view.buffer(shape, q, window)
    part = window_slices(window)
    mask = np.isfinite(depth) if others is None else depth < others[part]
    weight = np.abs(evidence[part])[mask].sum()
    return float(evidence[part][mask].sum() / max(weight, 1.0)), float(weight)


def _cover(view: PinholeView, shape: TargetShape, q: Array, evidence: Array) -> Window:
    """Takes away the evidence that an object explains; returns where that was."""
    window = view.window(shape, q, 8.0)
    mask = np.isfinite(view.buffer(shape, q, window)).astype(np.uint8)
    grown = cv2.dilate(mask, np.ones((7, 7), np.uint8)) > 0
    part = evidence[window_slices(window)]
    part[grown] = 0.0
    return window


def _overlap(a: Window, b: Window) -> bool:
    across = a.left < b.left + b.width and b.left < a.left + a.width
    return across and a.top < b.top + b.height and b.top < a.top + a.height
