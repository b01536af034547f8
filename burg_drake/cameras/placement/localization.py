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
    differ,
    window_slices,
)
from burg_drake.cameras.placement.candidates import Placed, assigned_places, support_of
from burg_drake.cameras.placement.rotation_ambiguity import with_rotation_ambiguity
from burg_drake.core import Array

TURNED = np.deg2rad(40.0)
"""Farther from the target's angle an object must not only look as good, but better [rad]."""
RIM = 0.04
"""How far beside the silhouette it is looked at for that, as a share of the image's width."""
WEAK = 0.7
"""Agreement below which an object is looked for once more, when the others have their places."""
SUPPORTED = 0.35
"""Mean evidence in the silhouette below which an object is not there."""
BEYOND = 0.06
"""Farther from its target nothing is an object's place [m]."""
FITS_WELL, NUDGE = 0.93, np.deg2rad(4.0)
"""Agreement below which an alignment may have caught on a wrong edge, and by how much the object is
turned to get it off [rad]."""
RING = 5.0
"""How wide, beside the silhouette and what the evidence smears of it, nothing should stand
[pixels]."""


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
        likeness: of its colors to those of its mesh, from 0 to 1; 0.5 where either has none.
    """

    alignment: Alignment | None
    in_image: float
    seen: float
    support: float
    spill: float
    likeness: float


def locate_objects(aligner: Aligner, shapes: dict[str, TargetShape]) -> dict[str, Located]:
    """Finds and aligns the objects of a scene.

    Args:
        aligner: of the image.
        shapes: the objects by name.
    """
    q = assigned_places(aligner, shapes, {})
    aligned: dict[str, Alignment] = {}
    _align(aligner, shapes, q, aligned, list(q), far=True)
    # one that took another's place left that one without, and itself fits badly
    weak = [n for n in shapes if n not in aligned or aligned[n].agreement < WEAK]
    if weak:
        before = {name: (aligned.pop(name), q.pop(name)) for name in weak if name in aligned}
        found = assigned_places(
            aligner, {name: shapes[name] for name in weak}, _placed(shapes, aligned)
        )
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
        starts = q[name] if far else _nudged(shapes[name], aligned[name])
        best = best_alignment(aligner, shapes[name], starts, others, far)
        if best is not None and not far:
            best = replace(best, ambiguous=aligned[name].ambiguous)
        if best is None:
            del q[name]
            aligned.pop(name, None)
        else:
            aligned[name], q[name] = best, [best.q]


def _nudged(shape: TargetShape, found: Alignment) -> list[Array]:
    """Where to begin the last alignment: where an object was found, and turned a little from there
    if not all fits, as outlines catch on wrong edges."""
    if shape.symmetric or found.agreement > FITS_WELL:
        return [found.q]
    return [found.q + np.array([0.0, 0.0, turn]) for turn in (0.0, NUDGE, -NUDGE)]


def _others(
    view: PinholeView, shapes: dict[str, TargetShape], q: dict[str, list[Array]], name: str
) -> Array:
    """(H, W) depth of all objects that were found but one."""
    return view.depth((shapes[other], q[other][0]) for other in q if other != name)


def best_alignment(
    aligner: Aligner, shape: TargetShape, starts: list[Array], others: Array, far: bool
) -> Alignment | None:
    """The alignment that agrees best with the image; if several do, near the target's angle."""
    rated: list[tuple[float, Alignment]] = []
    for start in starts:
        found = aligner.align(shape, start, others, far=far)
        if found is None or np.hypot(*found.q[:2]) > BEYOND:
            continue
        support, _ = support_of(aligner.view, shape, found.q, aligner.evidence, others)
        rating = found.agreement + found.coverage + support
        rating += aligner.likeness(shape, found.q, others)
        rating -= _disagreement(aligner, shape, found.q, others)
        if abs(_wrapped(found.q[2])) > TURNED:
            rating -= aligner.required_gain
        rated.append((rating, found))
        if rating > aligner.convincing_rating:
            break
    if not rated:
        return None
    score, best = max(rated, key=lambda r: r[0])
    rivals = (
        rating
        for rating, found in rated
        if differ(found, best) and not shape.looks_alike(found.q, best.q)
    )
    ambiguous = max(rivals, default=-np.inf) > score - aligner.clearly
    return replace(best, q=_least_turned(shape, best.q), ambiguous=ambiguous)


def _least_turned(shape: TargetShape, q: Array) -> Array:
    """Of the displacements that look like this one, as a box's does after half a turn, the one
    nearest to the target's angle."""
    alike = [q]
    for quarter in (1, 2, 3) if abs(_wrapped(q[2])) > TURNED else ():
        other = q + np.array([0.0, 0.0, quarter * np.pi / 2])
        other[2] = _wrapped(other[2])
        if shape.looks_alike(q, other):
            alike.append(other)
    return min(alike, key=lambda p: abs(_wrapped(p[2])))


def _wrapped(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


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
    support, _ = support_of(view, shape, at, aligner.evidence, others)
    near = 2.0 + aligner.smear
    window = view.window(shape, at, near + RING + 1.0)
    part = window_slices(window)
    mask = np.isfinite(view.buffer(shape, at, window)).astype(np.uint8)
    away = cv2.distanceTransform(1 - mask, cv2.DIST_L2, 3) if mask.any() else np.zeros(mask.shape)
    ring = (away > near) & (away < near + RING) & ~np.isfinite(others[part])
    around = aligner.evidence[part][ring]
    spill = float(np.maximum(around, 0.0).sum() / max(np.abs(around).sum(), 1.0))
    alike = aligner.likeness(shape, at, others) if aligner.sees_colors else 0.5
    return Located(alignment, in_image, seen, support, spill, alike)
