"""Finds all objects of a scene in one image, though they hide each other.

The clearest object first: what it covers is explained, and no other object is looked for there.
Then each is aligned with the others where they have been found, twice, as a better neighbour makes
a better outline.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from burg_drake.cameras.placement_alignment import Alignment, apart
from burg_drake.cameras.placement_raster import Window
from burg_drake.cameras.placement_search import Found, find
from burg_drake.cameras.placement_shape import Shape
from burg_drake.cameras.placement_view import View, part_of
from burg_drake.core.frames import Array

CONVINCING = 2.8
"""Sum of agreement, coverage and support of a place near the target's angle at which no other is
tried."""
TURNED = np.deg2rad(40.0)
"""Farther from the target's angle an object must not only look as good, but better [rad]:"""
BETTER = 0.15
"""by this in that sum."""
CLEARLY = 0.08
"""By how much that sum must be larger than at any other place to be sure."""
SUPPORTED = 0.35
"""Mean evidence in the silhouette below which an object is not there."""
RING = (2.0, 7.0)
"""Where, beside the silhouette, nothing should stand [pixels]."""


class Aligner(Protocol):
    """Aligns an object with an image."""

    view: View
    evidence: Array

    def align(self, shape: Shape, q: Array, others: Array, *, far: bool = True) -> Alignment | None:
        """Aligns an object; None if the image does not determine where it is."""


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


def locate(aligner: Aligner, shapes: dict[str, Shape]) -> dict[str, Located]:
    """Finds and aligns the objects of a scene.

    Args:
        aligner: of the image.
        shapes: the objects by name.
    """
    q = _assigned(aligner, shapes)
    aligned: dict[str, Alignment] = {}
    for far in (True, False):
        for name in list(q):
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
    return {name: _summed_up(aligner, shapes, q, name, aligned.get(name)) for name in shapes}


def _assigned(aligner: Aligner, shapes: dict[str, Shape]) -> dict[str, list[Array]]:
    """Candidate displacements of the objects that seem to be there, best first."""
    view, evidence = aligner.view, aligner.evidence.copy()
    waiting = {name: find(view, shape, evidence) for name, shape in shapes.items()}
    assigned: dict[str, list[Array]] = {}
    while waiting:
        rated = {n: _rating(view, shapes[n], found, evidence) for n, found in waiting.items()}
        name = max(rated, key=lambda n: rated[n])
        if rated[name] < SUPPORTED:
            break
        assigned[name] = [found.q for found in waiting.pop(name)]
        window = _cover(view, shapes[name], assigned[name][0], evidence)
        for other, found in waiting.items():
            if _overlap(window, view.window(shapes[other], found[0].q, 20.0)):
                waiting[other] = find(view, shapes[other], evidence)
    return assigned


def _rating(view: View, shape: Shape, found: list[Found], evidence: Array) -> float:
    """How sure it is that an object is where it was found: its support, more for a large one."""
    support, area = _support(view, shape, found[0].q, evidence, None)
    return support if area > 30.0 else -1.0


def _support(
    view: View, shape: Shape, q: Array, evidence: Array, others: Array | None
) -> tuple[float, float]:
    """Mean evidence in the silhouette where there is any, and how many pixels that are."""
    window = view.window(shape, q, 2.0)
    depth = view.buffer(shape, q, window)
    part = part_of(window)
    mask = np.isfinite(depth) if others is None else depth < others[part]
    weight = np.abs(evidence[part])[mask].sum()
    return float(evidence[part][mask].sum() / max(weight, 1.0)), float(weight)


def _cover(view: View, shape: Shape, q: Array, evidence: Array) -> Window:
    """Takes away the evidence that an object explains; returns where that was."""
    window = view.window(shape, q, 8.0)
    mask = np.isfinite(view.buffer(shape, q, window)).astype(np.uint8)
    grown = cv2.dilate(mask, np.ones((7, 7), np.uint8)) > 0
    part = evidence[part_of(window)]
    part[grown] = 0.0
    return window


def _overlap(a: Window, b: Window) -> bool:
    across = a.left < b.left + b.width and b.left < a.left + a.width
    return across and a.top < b.top + b.height and b.top < a.top + a.height


def _others(view: View, shapes: dict[str, Shape], q: dict[str, list[Array]], name: str) -> Array:
    """(H, W) depth of all objects that were found but one."""
    return view.depth((shapes[other], q[other][0]) for other in q if other != name)


def _best(
    aligner: Aligner, shape: Shape, starts: list[Array], others: Array, far: bool
) -> Alignment | None:
    """The alignment that agrees best with the image; if several do, near the target's angle."""
    rated: list[tuple[float, Alignment]] = []
    for start in starts:
        found = aligner.align(shape, start, others, far=far)
        if found is None:
            continue
        support, _ = _support(aligner.view, shape, found.q, aligner.evidence, others)
        rating = found.agreement + found.coverage + support
        if abs((found.q[2] + np.pi) % (2.0 * np.pi) - np.pi) > TURNED:
            rating -= BETTER
        rated.append((rating, found))
        if rating > CONVINCING:
            break
    if not rated:
        return None
    score, best = max(rated, key=lambda r: r[0])
    rivals = (rating for rating, found in rated if apart(found, best))
    return replace(best, ambiguous=max(rivals, default=-np.inf) > score - CLEARLY)


def _summed_up(
    aligner: Aligner,
    shapes: dict[str, Shape],
    q: dict[str, list[Array]],
    name: str,
    alignment: Alignment | None,
) -> Located:
    view, shape = aligner.view, shapes[name]
    at = np.zeros(3) if alignment is None else alignment.q
    others = _others(view, shapes, q, name)
    in_image, seen = view.seen(shape, at, others)
    support, _ = _support(view, shape, at, aligner.evidence, others)
    window = view.window(shape, at, RING[1] + 1.0)
    part = part_of(window)
    mask = np.isfinite(view.buffer(shape, at, window)).astype(np.uint8)
    away = cv2.distanceTransform(1 - mask, cv2.DIST_L2, 3) if mask.any() else np.zeros(mask.shape)
    ring = (away > RING[0]) & (away < RING[1]) & ~np.isfinite(others[part])
    around = aligner.evidence[part][ring]
    spill = float(np.maximum(around, 0.0).sum() / max(np.abs(around).sum(), 1.0))
    return Located(alignment, in_image, seen, support, spill)
