"""Finds all objects of a scene in one image, though they hide each other.

The clearest object first: what it covers is explained, and no other object is looked for there.
Then each is aligned with the others where they have been found, twice, as a better neighbour makes
a better outline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from burg_drake.cameras.placement.alignment import (
    Aligner,
    Alignment,
    PinholeView,
    TargetShape,
    Window,
    differ,
    window_slices,
)
from burg_drake.cameras.placement.rotation_ambiguity import with_rotation_ambiguity
from burg_drake.cameras.placement.search import SearchResult, find_places
from burg_drake.core import Array

TURNED = np.deg2rad(40.0)
"""Farther from the target's angle an object must not only look as good, but better [rad]."""
RIM = 0.04
"""How far beside the silhouette it is looked at for that, as a share of the image's width."""
WEAK = 0.7
"""Agreement below which an object is looked for once more, when the others have their places."""
PROMISING = 0.2
"""The same as `SUPPORTED` of a place that is only roughly known."""
SUPPORTED = 0.35
"""Mean evidence in the silhouette below which an object is not there."""
RING = (2.0, 7.0)
"""Where, beside the silhouette, nothing should stand [pixels]."""

Placed = tuple[TargetShape, Array]
"""An object and its displacement."""


@dataclass(frozen=True, eq=False)
class Located:
    """What became of one object.

    Attributes:
        alignment: where it is; None if nothing was found.
        in_image: share of its silhouette that is in the image.
        seen: share that is in the image and not hidden by other objects; of an object that was not
            found, at its target.
        support: mean evidence in the silhouette, where there is any, in [-1, 1].
        spill: how much stands around the silhouette that no object explains, as a share of what is
            looked at there.
    """

    alignment: Alignment | None
    in_image: float
    seen: float
    support: float
    spill: float


def locate_objects(aligner: Aligner, shapes: dict[str, TargetShape]) -> dict[str, Located]:
    """Finds and aligns the objects of a scene.

    Args:
        aligner: of the image.
        shapes: the objects by name.
    """
    q = _assigned(aligner, shapes, {})
    aligned: dict[str, Alignment] = {}
    _align(aligner, shapes, q, aligned, list(q), far=True)
    # one that took another's place left that one without, and itself fits badly
    weak = [n for n in shapes if n not in aligned or aligned[n].agreement < WEAK]
    if weak:
        before = {name: (aligned.pop(name), q.pop(name)) for name in weak if name in aligned}
        found = _assigned(aligner, {name: shapes[name] for name in weak}, _placed(shapes, aligned))
        q |= found
        _align(aligner, shapes, q, aligned, list(found), far=True)
        for name, (alignment, start) in before.items():
            if name not in aligned:
                aligned[name], q[name] = alignment, start
    _align(aligner, shapes, q, aligned, list(q), far=False)
    return {name: _located(aligner, shapes, q, name, aligned.get(name)) for name in shapes}


def _placed(shapes: dict[str, TargetShape], aligned: dict[str, Alignment]) -> dict[str, Placed]:
    return {name: (shapes[name], alignment.q) for name, alignment in aligned.items()}


def _align(
    aligner: Aligner,
    shapes: dict[str, TargetShape],
    q: dict[str, list[Array]],
    aligned: dict[str, Alignment],
    names: list[str],
    *,
    far: bool,
) -> None:
    """Aligns objects, from their candidates or where they are; leaves out what fails."""
    for name in names:
        others = _others(aligner.view, shapes, q, name)
        starts = q[name] if far else [aligned[name].q]
        best = _best(aligner, shapes[name], starts, others, far)
        if best is not None and not far:
            best = replace(best, ambiguous=aligned[name].ambiguous)
        if best is None:
            del q[name]
            aligned.pop(name, None)
        else:
            aligned[name], q[name] = best, [best.q]


def _assigned(
    aligner: Aligner, shapes: dict[str, TargetShape], placed: dict[str, Placed]
) -> dict[str, list[Array]]:
    """Candidate displacements of the objects that seem to be there, best first; not where others
    are already."""
    view, evidence = aligner.view, aligner.evidence.copy()
    for shape, q in placed.values():
        _cover(view, shape, q, evidence)
    waiting = {name: _candidates(view, shape, evidence) for name, shape in shapes.items()}
    assigned: dict[str, list[Array]] = {}
    while waiting:
        rated = {n: _rating(view, shapes[n], found, evidence) for n, found in waiting.items()}
        name = max(rated, key=lambda n: rated[n])
        if rated[name] < PROMISING:
            break
        assigned[name] = [found.q for found in waiting.pop(name)]
        window = _cover(view, shapes[name], assigned[name][0], evidence)
        for other, found in waiting.items():
            if _overlap(window, view.window(shapes[other], found[0].q, 20.0)):
                waiting[other] = _candidates(view, shapes[other], evidence)
    return assigned


def _candidates(view: PinholeView, shape: TargetShape, evidence: Array) -> list[SearchResult]:
    """Where an object may be; if it is not near its target's angle, the best of all first."""
    found = find_places(view, shape, evidence)
    if _rating(view, shape, found, evidence) >= PROMISING:
        return found
    return sorted(found, key=lambda f: -_support(view, shape, f.q, evidence, None)[0])


def _rating(
    view: PinholeView, shape: TargetShape, found: list[SearchResult], evidence: Array
) -> float:
    """How sure it is that an object is where it was found: its support, more for a large one."""
    support, area = _support(view, shape, found[0].q, evidence, None)
    return support if area > 30.0 else -1.0


def _support(
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


def _others(
    view: PinholeView, shapes: dict[str, TargetShape], q: dict[str, list[Array]], name: str
) -> Array:
    """(H, W) depth of all objects that were found but one."""
    return view.depth((shapes[other], q[other][0]) for other in q if other != name)


def _best(
    aligner: Aligner, shape: TargetShape, starts: list[Array], others: Array, far: bool
) -> Alignment | None:
    """The alignment that agrees best with the image; if several do, near the target's angle."""
    rated: list[tuple[float, Alignment]] = []
    for start in starts:
        found = aligner.align(shape, start, others, far=far)
        if found is None:
            continue
        support, _ = _support(aligner.view, shape, found.q, aligner.evidence, others)
        rating = found.agreement + found.coverage + support
        rating -= _disagreement(aligner, shape, found.q, others)
        if abs((found.q[2] + np.pi) % (2.0 * np.pi) - np.pi) > TURNED:
            rating -= aligner.required_gain
        rated.append((rating, found))
        if rating > aligner.convincing_rating:
            break
    if not rated:
        return None
    score, best = max(rated, key=lambda r: r[0])
    rivals = (rating for rating, found in rated if differ(found, best))
    return replace(best, ambiguous=max(rivals, default=-np.inf) > score - aligner.clearly)


def _disagreement(aligner: Aligner, shape: TargetShape, q: Array, others: Array) -> float:
    """How much of an image of distances disagrees, as a share of the silhouette; 0 for a photo,
    where shadows and other things stand out as well."""
    if not aligner.strict:
        return 0.0
    window = aligner.view.window(shape, q, RIM * aligner.view.size[0])
    wrong, area = aligner.misfit(shape, q, others, window)
    return min(wrong / max(area, 1.0), 1.0)


def _located(
    aligner: Aligner,
    shapes: dict[str, TargetShape],
    q: dict[str, list[Array]],
    name: str,
    alignment: Alignment | None,
) -> Located:
    view, shape = aligner.view, shapes[name]
    at = np.zeros(3) if alignment is None else alignment.q
    others = _others(view, shapes, q, name)
    if alignment is not None:
        alignment = with_rotation_ambiguity(aligner, shape, alignment, others)
    in_image, seen = view.seen(shape, at, others)
    support, _ = _support(view, shape, at, aligner.evidence, others)
    window = view.window(shape, at, RING[1] + 1.0)
    part = window_slices(window)
    mask = np.isfinite(view.buffer(shape, at, window)).astype(np.uint8)
    away = cv2.distanceTransform(1 - mask, cv2.DIST_L2, 3) if mask.any() else np.zeros(mask.shape)
    ring = (away > RING[0]) & (away < RING[1]) & ~np.isfinite(others[part])
    around = aligner.evidence[part][ring]
    spill = float(np.maximum(around, 0.0).sum() / max(np.abs(around).sum(), 1.0))
    return Located(alignment, in_image, seen, support, spill)
