"""Objects that stand in each other's places, and objects that are not part of the scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from burg_drake.cameras.placement.alignment import Aligner, Alignment
from burg_drake.cameras.placement.document import ExtraObject
from burg_drake.cameras.placement.localization import ObjectLocation, best_alignment
from burg_drake.cameras.placement.object_search import (
    SEARCH_RANGE,
    Placed,
    find_candidates,
    promising_places,
    silhouette_support,
    unexplained_evidence,
)
from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.pinhole_view import PinholeView, sample_nearest, window_slices
from burg_drake.core import Array, Booleans, transform_points

MIN_EXTRA_EVIDENCE = 0.5  # Evidence at which a pixel shows an object.
KNOWN_MARGIN = 6e-3  # Metres around known silhouettes that are ignored.
MIN_EXTRA_WIDTH = 0.012  # Metres. Thinner regions are unexplained edges.


def find_exchanged_objects(
    aligner: Aligner,
    shapes: dict[str, TargetShape],
    located: dict[str, ObjectLocation],
    doubtful: list[str],
) -> tuple[dict[str, tuple[str, Placed]], set[str]]:
    """Finds objects that stand in other objects' places.

    Args:
        aligner: of the image.
        shapes: the objects by name.
        located: locations of the objects by name.
        doubtful: names of the objects that were not found reliably; only they are tested.

    Returns:
        By the name of the place: name of the object that stands there, its shape with the place as
        target, and its displacement from that target. And the names of places that are without
        their own objects, but may hold other objects of the scene that were not found.
    """
    reliable = {
        name: (shapes[name], found.alignment.q)
        for name, found in located.items()
        if name not in doubtful and found.alignment is not None
    }
    others = aligner.view.depth(reliable.values())
    evidence = unexplained_evidence(aligner, reliable)
    own = {
        name: _score_fit(aligner, shapes[name], located[name].alignment, others)
        for name in doubtful
    }
    rated = []
    for place in doubtful:
        for name in doubtful:
            if name == place:
                continue
            shape = shape_at_place(shapes[name], shapes[place])
            starts = promising_places(find_candidates(aligner.view, shape, evidence))
            found = best_alignment(aligner, shape, starts, others, far=True)
            fit = _score_fit(aligner, shape, found, others)
            # Lead over the object that belongs there; the score is 3 at most.
            is_clear = fit.total > max(own[place].total, own[name].total) + 0.5
            # Fraction of the outline that is visible and agrees.
            if found is not None and fit.good and fit.shown > 0.4 and is_clear:
                rated.append((fit.total, place, name, (shape, found.q)))
    occupants: dict[str, tuple[str, Placed]] = {}
    for _, place, name, placed in sorted(rated, key=lambda r: -r[0]):
        if place not in occupants and name not in {other for other, _ in occupants.values()}:
            occupants[place] = name, placed
    elsewhere = {name for name, _ in occupants.values()}
    missing = {name for name in doubtful if not own[name].good} - elsewhere
    empty = {place for place in missing | elsewhere if place not in occupants and missing - {place}}
    return occupants, empty


def shape_at_place(shape: TargetShape, place: TargetShape) -> TargetShape:
    """Moves an object's target to the reference point of another object's target."""
    X_SO = shape.X_SO.copy()
    X_SO[:2, 3] += (place.p_SR - shape.p_SR)[:2]
    return replace(shape, X_SO=X_SO)


@dataclass(frozen=True)
class _FitScore:
    """How well an object fits where it was aligned.

    Attributes:
        total: sum of agreement, support and colour similarity.
        good: whether each of the three is high enough.
        shown: share of the object's outline that is visible and agrees.
    """

    total: float = 0.0
    good: bool = False
    shown: float = 0.0


def _score_fit(
    aligner: Aligner, shape: TargetShape, found: Alignment | None, others: Array
) -> _FitScore:
    if found is None:
        return _FitScore()
    support, _ = silhouette_support(aligner.view, shape, found.q, aligner.evidence, others)
    similarity = aligner.color_similarity(shape, found.q, others)
    # Colours are compared where they are known.
    colors_match = similarity > 0.4 or not aligner.sees_colors or shape.colors is None
    _, seen = aligner.view.seen(shape, found.q, others)
    return _FitScore(
        float(np.clip(found.agreement, 0.0, 1.0)) + support + similarity,
        found.agreement >= 0.7 and support >= 0.6 and colors_match,
        found.coverage * seen,
    )


def find_extra_objects(
    aligner: Aligner, placed: Iterable[Placed], p_SR: Sequence[Array] = ()
) -> tuple[ExtraObject, ...]:
    """Finds objects outside the scene by unexplained evidence, the largest first.

    Args:
        aligner: of the image.
        placed: all objects that were found, with their displacements.
        p_SR: (3,) reference points of places where an object of the scene that was not found may
            stand. Evidence there is ignored.
    """
    view, placed = aligner.view, list(placed)
    # Pixels per metre of the board, in the middle of the image.
    pitch = float(_pixel_area(view, _points_on_board(view, np.array([view.size]) / 2.0))[0] ** -0.5)
    unexplained = aligner.evidence > MIN_EXTRA_EVIDENCE
    for shape, q in placed:
        window = view.window(shape, q, KNOWN_MARGIN * pitch + 2.0)
        mask = np.isfinite(view.buffer(shape, q, window)).astype(np.uint8)
        size = 2 * round(KNOWN_MARGIN * pitch) + 1
        unexplained[window_slices(window)] &= cv2.dilate(mask, np.ones((size, size), np.uint8)) == 0
    size = max(2 * round(MIN_EXTRA_WIDTH * pitch / 2) + 1, 3)
    disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    unexplained = cv2.morphologyEx(unexplained.astype(np.uint8), cv2.MORPH_OPEN, disk)
    size = 2 * round(0.02 * pitch / 2) + 1  # Metres within which regions belong to one object.
    grown = cv2.dilate(unexplained, np.ones((size, size), np.uint8))
    count, labels = cv2.connectedComponents(grown)
    hidden = _HiddenBoard(aligner, placed)
    labels *= unexplained
    found = [_describe_region(view, labels == k, hidden) for k in range(1, count)]
    large = []
    for area, extra in found:
        reach = SEARCH_RANGE + extra.width / 2.0
        near = any(np.hypot(*(np.array(extra.position) - p[:2])) < reach for p in p_SR)
        if area > 5e-4 and not near:  # Square metres covered on the board.
            large.append((area, extra))
    return tuple(extra for _, extra in sorted(large, key=lambda f: -f[0]))


class _HiddenBoard:
    """The board's area hidden behind objects that were found."""

    def __init__(self, aligner: Aligner, placed: list[Placed]) -> None:
        self._view = aligner.view
        shows_object = aligner.evidence > MIN_EXTRA_EVIDENCE
        self._covered = np.isfinite(self._view.depth(placed)) | shows_object
        corners = (transform_points(s.displacement(q), s.p_SV)[:, :2] for s, q in placed)
        self._contact_areas = [cv2.convexHull(p.astype(np.float32)) for p in corners]

    def extent(self, start: Array, toward: Array) -> float:
        """Length of the hidden and unoccupied board from a point (2,) in a direction (2,) [m]."""
        step = KNOWN_MARGIN / 2
        distances = np.arange(KNOWN_MARGIN, 0.15, step)  # Metres.
        p_S = start + distances[:, None] * toward
        _, pixels = self._view.project(np.column_stack([p_S, np.zeros(len(p_S))]))
        hidden = sample_nearest(self._covered, pixels, False).astype(bool)
        in_contact = [
            any(cv2.pointPolygonTest(f, p, False) >= 0 for f in self._contact_areas) for p in p_S
        ]
        return step * int(np.argmin(np.append(hidden & ~np.array(in_contact), False)))


def _describe_region(
    view: PinholeView, mask: Booleans, hidden: _HiddenBoard
) -> tuple[float, ExtraObject]:
    """Area of the board behind an image region [m²], and the extra object there.

    The extra object is assumed to stand at the near end of the area that it hides, and to be as
    deep as wide. If a known object hides the near end, it is put in the middle of the possible
    places.
    """
    row, column = np.nonzero(mask)
    p_S = _points_on_board(view, np.stack([column, row], axis=-1).astype(float))
    area = float(_pixel_area(view, p_S).sum())
    arm = p_S - view.X_SC[:2, 3]
    forward = arm.mean(axis=0) / max(float(np.linalg.norm(arm.mean(axis=0))), 1e-9)
    across = np.array([-forward[1], forward[0]])
    depths, side = arm @ forward, arm @ across
    nearest_depth = float(np.quantile(depths, 0.02))
    if nearest_depth < MIN_EXTRA_WIDTH:  # the camera looks straight down on it
        return area, _build_extra_object(p_S.mean(axis=0), 2.0 * float(np.sqrt(area / np.pi)))
    # The hidden area widens away from the point below the camera, like a shadow.
    left, right = np.quantile(side / np.maximum(depths, 1e-3), [0.02, 0.98]).tolist()
    widening = forward + (left + right) / 2 * across
    nearest_depth -= hidden.extent(view.X_SC[:2, 3] + nearest_depth * widening, -forward) / 2.0
    width = max((right - left) * nearest_depth, MIN_EXTRA_WIDTH)
    middle = view.X_SC[:2, 3] + (nearest_depth + width / 2) * widening
    return area, _build_extra_object(middle, width)


def _build_extra_object(position: Array, width: float) -> ExtraObject:
    x, y = np.round(position, 4).tolist()
    return ExtraObject(position=(x, y), width=round(width, 4))


def _points_on_board(view: PinholeView, pixels: Array) -> Array:
    """(N, 2) points of the board at image points (N, 2)."""
    H_pixel_S = view.K @ view.X_CS[:3][:, [0, 1, 3]]
    p = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(H_pixel_S).T
    return np.asarray(p[:, :2] / p[:, 2:])


def _pixel_area(view: PinholeView, p_S: Array) -> Array:
    """(N,) area of the board that a pixel covers at points (N, 2) [m²]."""
    J = view.jacobian(np.column_stack([p_S, np.zeros(len(p_S))]))[:, :, :2]
    return np.asarray(1.0 / np.maximum(np.abs(np.linalg.det(J)), 1e-9))
