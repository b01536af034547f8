"""Locate all objects of a scene in one image, including occluded and rotation-ambiguous ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from burg_drake.cameras.placement.alignment import (
    Aligner,
    Alignment,
    are_different_places,
)
from burg_drake.cameras.placement.object_search import (
    SilhouetteSearch,
    assign_candidates,
    silhouette_support,
)
from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.pinhole_view import ImageWindow, PinholeView, window_slices
from burg_drake.core import Array, wrap_to_pi

LARGE_TURN = np.deg2rad(40.0)
"""Radians from the target's angle; beyond, an object must fit better, not just as well."""
MIN_OBJECT_SUPPORT = 0.35
"""Mean evidence in the silhouette below which an object is absent."""


@dataclass(frozen=True, eq=False)
class ObjectLocation:
    """The location of one object.

    Attributes:
        alignment: alignment of the object; None if it was not found.
        in_image: share of the object's silhouette that is in the image; of the silhouette at the
            target if the object was not found.
        seen: share of that silhouette that is in the image and not hidden by other objects.
        support: mean evidence in the silhouette, where there is any, in [-1, 1].
        spill: share of the evidence around the silhouette that shows unknown objects.
        color_similarity: colour similarity of image and mesh, 0 to 1; 0.5 if either has no
            colours.
    """

    alignment: Alignment | None
    in_image: float
    seen: float
    support: float
    spill: float
    color_similarity: float


def locate_objects(aligner: Aligner, shapes: dict[str, TargetShape]) -> dict[str, ObjectLocation]:
    """Finds and aligns the objects of a scene.

    Args:
        aligner: of the image.
        shapes: the objects by name.
    """
    q = assign_candidates(aligner, shapes, {})
    aligned: dict[str, Alignment] = {}
    _align_objects(aligner, shapes, q, aligned, list(q), far=True)
    # an object found in another's place fits badly, and the other was not found
    poorly_aligned = [n for n in shapes if n not in aligned or aligned[n].agreement < 0.7]
    if poorly_aligned:
        before = {
            name: (aligned.pop(name), q.pop(name)) for name in poorly_aligned if name in aligned
        }
        placed = {name: (shapes[name], alignment.q) for name, alignment in aligned.items()}
        found = assign_candidates(aligner, {name: shapes[name] for name in poorly_aligned}, placed)
        q |= found
        _align_objects(aligner, shapes, q, aligned, list(found), far=True)
        for name, (alignment, start) in before.items():
            if name not in aligned:
                aligned[name], q[name] = alignment, start
    _align_objects(aligner, shapes, q, aligned, list(q), far=False)
    return {name: _build_location(aligner, shapes, q, name, aligned.get(name)) for name in shapes}


def _align_objects(
    aligner: Aligner,
    shapes: dict[str, TargetShape],
    q: dict[str, list[Array]],
    aligned: dict[str, Alignment],
    names: list[str],
    *,
    far: bool,
) -> None:
    """Aligns objects from their candidates or current places; leaves out failures."""
    for name in names:
        others = _depth_of_others(aligner.view, shapes, q, name)
        starts = q[name] if far else _nudged_starts(shapes[name], aligned[name])
        best = best_alignment(aligner, shapes[name], starts, others, far)
        if best is not None and not far:
            best = replace(best, ambiguous=aligned[name].ambiguous)
        if best is None:
            del q[name]
            aligned.pop(name, None)
        else:
            aligned[name], q[name] = best, [best.q]


def _nudged_starts(shape: TargetShape, found: Alignment) -> list[Array]:
    """Starts of the last alignment: the current place, and small turns from it unless nearly all
    of the outline fits, as an outline may lock onto wrong edges.
    """
    if shape.symmetric or found.agreement > 0.93:
        return [found.q]
    return [found.q + np.array([0.0, 0.0, turn]) for turn in np.deg2rad((0.0, 4.0, -4.0))]


def _depth_of_others(
    view: PinholeView, shapes: dict[str, TargetShape], q: dict[str, list[Array]], name: str
) -> Array:
    """(H, W) depth of all objects that were found except one."""
    return view.depth((shapes[other], q[other][0]) for other in q if other != name)


def best_alignment(
    aligner: Aligner, shape: TargetShape, starts: list[Array], others: Array, far: bool
) -> Alignment | None:
    """The alignment with the best rating; a place far from the target's angle needs a rating that
    is higher by `Aligner.required_gain`.
    """
    rated: list[tuple[float, Alignment]] = []
    for start in starts:
        found = aligner.align(shape, start, others, far=far)
        if found is None or np.hypot(*found.q[:2]) > 0.06:  # Metres from the target.
            continue
        support, _ = silhouette_support(aligner.view, shape, found.q, aligner.evidence, others)
        rating = found.agreement + found.coverage + support
        rating += aligner.color_similarity(shape, found.q, others)
        rating -= _depth_disagreement(aligner, shape, found.q, others)
        if abs(wrap_to_pi(found.q[2])) > LARGE_TURN:
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
        if are_different_places(found, best) and not shape.looks_alike(found.q, best.q)
    )
    ambiguous = max(rivals, default=-np.inf) > score - aligner.min_rating_margin
    return replace(best, q=_least_turned(shape, best.q), ambiguous=ambiguous)


def _least_turned(shape: TargetShape, q: Array) -> Array:
    """Of the displacements at which the object looks the same, as a box does after half a turn,
    the one nearest to the target's angle.
    """
    alike = [q]
    for quarter in (1, 2, 3) if abs(wrap_to_pi(q[2])) > LARGE_TURN else ():
        other = q + np.array([0.0, 0.0, quarter * np.pi / 2])
        other[2] = wrap_to_pi(other[2])
        if shape.looks_alike(q, other):
            alike.append(other)
    return min(alike, key=lambda p: abs(wrap_to_pi(p[2])))


def _depth_disagreement(aligner: Aligner, shape: TargetShape, q: Array, others: Array) -> float:
    """Area of a depth image that disagrees, relative to the silhouette; 0 for a photo, where
    shadows disagree as well.
    """
    if not aligner.checks_depth:
        return 0.0
    # Width of the compared rim, as a fraction of the image's width.
    window = aligner.view.window(shape, q, 0.04 * aligner.view.size[0])
    wrong, area = aligner.mismatch(shape, q, others, window)
    return min(wrong / max(area, 1.0), 1.0)


def _build_location(
    aligner: Aligner,
    shapes: dict[str, TargetShape],
    q: dict[str, list[Array]],
    name: str,
    alignment: Alignment | None,
) -> ObjectLocation:
    ring_width = 5.0  # Pixels beside the silhouette that should be free.
    view, shape = aligner.view, shapes[name]
    at = np.zeros(3) if alignment is None else alignment.q
    others = _depth_of_others(view, shapes, q, name)
    if alignment is not None:
        alignment = add_rotation_ambiguity(aligner, shape, alignment, others)
    in_image, seen = view.seen(shape, at, others)
    support, _ = silhouette_support(view, shape, at, aligner.evidence, others)
    near = 2.0 + aligner.smear
    window = view.window(shape, at, near + ring_width + 1.0)
    part = window_slices(window)
    mask = np.isfinite(view.buffer(shape, at, window)).astype(np.uint8)
    away = cv2.distanceTransform(1 - mask, cv2.DIST_L2, 3) if mask.any() else np.zeros(mask.shape)
    ring = (away > near) & (away < near + ring_width) & ~np.isfinite(others[part])
    around = aligner.evidence[part][ring]
    spill = float(np.maximum(around, 0.0).sum() / max(np.abs(around).sum(), 1.0))
    likeness = aligner.color_similarity(shape, at, others) if aligner.sees_colors else 0.5
    return ObjectLocation(alignment, in_image, seen, support, spill, likeness)


_POSITIVE_TURNS = np.deg2rad((8.0, 15.0, 25.0, 40.0, 60.0, 85.0, 110.0, 135.0, 160.0))  # Radians.
AMBIGUITY_TEST_ANGLES = np.concatenate(
    [np.stack([_POSITIVE_TURNS, -_POSITIVE_TURNS], axis=1).ravel(), [np.pi]]
)
"""Radians by which an object is turned to test for rotational ambiguity."""
TURNING_SHIFT = 0.025
"""Metres by which an object may shift while it is turned."""


def add_rotation_ambiguity(
    aligner: Aligner, shape: TargetShape, found: Alignment, others: Array
) -> Alignment:
    """The alignment with all other angles at which the object fits as well.

    Args:
        aligner: of the image.
        shape: the object.
        found: its alignment.
        others: (H, W) depth of other objects, infinity where there is none.
    """
    if shape.symmetric:
        return found
    window = _turning_window(aligner.view, shape, found.q)
    mismatch, area = aligner.mismatch(shape, found.q, others, window)
    # Raster pixels. Increase of the mismatch up to which another angle fits as well.
    tolerance = 0.01 * area + 12.0 * (aligner.view.size[0] / 640) ** 2 * window.scale**2
    evidence = np.where(np.isfinite(others), 0.0, aligner.evidence)
    search = SilhouetteSearch(aligner.view, shape, evidence)
    fitting = []
    for turn in AMBIGUITY_TEST_ANGLES:
        q = search.best_displacement(found.q + np.array([0.0, 0.0, turn]), TURNING_SHIFT)
        increase = aligner.mismatch(shape, q, others, window)[0] - mismatch
        if increase > 2.0 * tolerance:  # Twice the tolerance, as the place is not exact yet.
            continue
        exact = aligner.align(shape, q, others, far=False, turn=False)
        if exact is None:
            continue
        increase = aligner.mismatch(shape, exact.q, others, window)[0] - mismatch
        worse = max(increase, 0.0) / tolerance + _fit_loss(found, exact, aligner.residual_floor)
        if worse < 1.0 and not shape.looks_alike(found.q, exact.q):
            fitting.append(exact.q - found.q)
    if not fitting:
        return found
    steps = np.array(fitting)
    covariance = found.covariance + steps.T @ steps / (len(steps) + 1)
    return replace(found, covariance=covariance, equivalent_turns=tuple(steps[:, 2]))


def _fit_loss(found: Alignment, other: Alignment, residual_floor: float) -> float:
    """Loss of fit from one alignment to another; 1 is significant."""
    missing = max(found.coverage - other.coverage, found.agreement - other.agreement, 0.0)
    rougher = other.residual / max(found.residual, residual_floor) - 1.0
    # A loss of agreement of 0.1, or residuals larger by half, tell two angles apart.
    return missing / 0.1 + max(rougher, 0.0) / 0.5


def _turning_window(view: PinholeView, shape: TargetShape, q: Array) -> ImageWindow:
    """Window of the image area that an object may cover while it is turned."""
    distance = np.linalg.norm(shape.p_SV[:, :2] - shape.p_SR[:2], axis=1)
    reach = float(distance.max()) + TURNING_SHIFT / 2
    top = float(shape.p_SV[:, 2].max())
    corner = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 1)])
    box = shape.p_SR + (q[0], q[1], 0.0) + corner * (reach, reach, top)
    _, pixels = view.project(box)
    return view.window_of(pixels, 1.0).with_raster(2500)
