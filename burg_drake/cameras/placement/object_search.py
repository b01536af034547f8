"""Search for places where silhouettes of objects cover evidence that the board does not explain."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from burg_drake.cameras.placement.alignment import Aligner
from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.pinhole_view import ImageWindow, PinholeView, window_slices
from burg_drake.core import Array, wrap_to_pi

SEARCH_RANGE = 0.05
"""Metres from its target within which an object is searched."""
NEAR_SEARCH_ANGLES = np.deg2rad((0.0, -10.0, 10.0, -20.0, 20.0, -30.0, 30.0))
"""Radians from the target's angle."""
FAR_SEARCH_ANGLES = np.deg2rad(np.arange(50.0, 311.0, 20.0))
"""Radians from the target's angle."""
FINE_SEARCH_ANGLE = np.deg2rad(5.0)
"""Radians. Second, finer step of the angle."""
DISTANCE_PENALTY = 0.03
"""Score lost at the full search range, so that the nearest of equal places wins."""


@dataclass(frozen=True, eq=False)
class SearchResult:
    """A candidate place of an object.

    Attributes:
        q: (3,) displacement, see `TargetShape.displacement`.
        score: mean evidence in the silhouette, less `DISTANCE_PENALTY`; at most 1.
    """

    q: Array
    score: float


def find_places(view: PinholeView, shape: TargetShape, evidence: Array) -> list[SearchResult]:
    """Finds candidate places of an object: those near the target's angle first, then the others,
    each best first.

    Args:
        view: the camera.
        shape: the object.
        evidence: (H, W) in [-1, 1].
    """
    search = SilhouetteSearch(view, shape, evidence)
    if shape.symmetric:
        return [search.best_translation(0.0, search.best_translation(0.0).q)]
    return search.search_angles(NEAR_SEARCH_ANGLES) + search.search_angles(FAR_SEARCH_ANGLES)


class SilhouetteSearch:
    """Searches one shape in the evidence, at a coarse scale."""

    def __init__(self, view: PinholeView, shape: TargetShape, evidence: Array) -> None:
        self._view, self._shape = view, shape
        self._scale = min(1.0, 320 / view.size[0])  # Columns of the scaled image.
        size = (round(view.size[0] * self._scale), round(view.size[1] * self._scale))
        self._evidence = cv2.resize(evidence.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        top = float(shape.p_SV[:, 2].max())
        self._center = shape.p_SR + np.array([0.0, 0.0, top / 2])

    def search_angles(self, turns: Array) -> list[SearchResult]:
        """The best places at given angles, refined around the best ones."""
        rough = sorted(
            (self.best_translation(float(turn)) for turn in turns), key=lambda f: -f.score
        )
        found = [self.best_translation(f.q[2], f.q) for f in rough[:5]]
        found.sort(key=lambda f: -f.score)
        found += [
            self.best_translation(f.q[2] + side * FINE_SEARCH_ANGLE, f.q)
            for f in found[:2]
            for side in (-1, 1)
        ]
        return _drop_duplicates(sorted(found, key=lambda f: -f.score))[:3]

    def best_translation(self, turn: float, start: Array | None = None) -> SearchResult:
        """The best translation at an angle, anywhere or near a start; from a start it is more
        accurate, as the silhouette changes with its place.
        """
        near = start if start is not None else np.zeros(2)
        reach = SEARCH_RANGE if start is None else SEARCH_RANGE / 4
        q, score = self._correlate(np.array([near[0], near[1], turn]), reach)
        off = np.hypot(q[0], q[1]) / SEARCH_RANGE
        return SearchResult(q, score - DISTANCE_PENALTY * min(off, 2.0) ** 2)

    def best_displacement(self, q: Array, reach: float) -> Array:
        """The best displacement at the angle of `q`, up to `reach` [m] from it."""
        return self._correlate(q, reach)[0]

    def _correlate(self, q: Array, reach: float) -> tuple[Array, float]:
        """Correlates once; returns the displacement at the peak and its mean evidence."""
        view, scale = self._view, self._scale
        window = _snap_to_scale(view.window(self._shape, q, 1.0), scale)
        mask = np.isfinite(view.buffer(self._shape, q, window)).astype(np.float32)
        if mask.sum() < 4:
            return q, -1.0
        J = view.jacobian((self._center + q * (1.0, 1.0, 0.0))[None])[0, :, :2] * scale
        pad = int(np.ceil(reach * np.linalg.norm(J, axis=1).max())) + 1
        left, top = round(window.left * scale), round(window.top * scale)
        around = cv2.copyMakeBorder(
            self._evidence, pad, pad, pad, pad, cv2.BORDER_CONSTANT, value=0.0
        )
        patch = around[top : top + mask.shape[0] + 2 * pad, left : left + mask.shape[1] + 2 * pad]
        score = cv2.matchTemplate(patch, mask, cv2.TM_CCORR) / mask.sum()
        v, u = np.mgrid[: score.shape[0], : score.shape[1]] - pad
        shift = np.stack([u, v], axis=-1) @ np.linalg.inv(J).T
        off = np.linalg.norm(shift, axis=-1)
        # Places beyond `reach` are excluded. The penalty lets a start outside the range come back.
        far = np.hypot(q[0] + shift[..., 0], q[1] + shift[..., 1]) / SEARCH_RANGE
        rated = np.where(off <= reach * 1.01, score - DISTANCE_PENALTY * far**2, -np.inf)
        best = np.unravel_index(int(rated.argmax()), rated.shape)
        return q + np.append(shift[best], 0.0), float(score[best])


def _snap_to_scale(window: ImageWindow, scale: float) -> ImageWindow:
    """A window whose raster's pixels are pixels of the scaled image."""
    n = round(1.0 / scale)
    left, top = window.left // n * n, window.top // n * n
    right = -(-(window.left + window.width) // n) * n
    bottom = -(-(window.top + window.height) // n) * n
    return ImageWindow(left, top, right - left, bottom - top, scale)


def _drop_duplicates(found: list[SearchResult]) -> list[SearchResult]:
    """Drops places that are near better ones."""
    kept: list[SearchResult] = []
    for f in found:
        near = (
            np.hypot(*(f.q[:2] - k.q[:2])) < 0.01
            and abs(wrap_to_pi(f.q[2] - k.q[2])) < 2 * FINE_SEARCH_ANGLE
            for k in kept
        )
        if not any(near):
            kept.append(f)
    return kept


MIN_CANDIDATE_EVIDENCE = 0.2
"""Mean evidence in the silhouette of a candidate place."""

Placed = tuple[TargetShape, Array]
"""An object and its displacement."""


def assign_candidates(
    aligner: Aligner, shapes: dict[str, TargetShape], placed: dict[str, Placed]
) -> dict[str, list[Array]]:
    """Candidate displacements, best first, of the objects that seem present; outside the places of
    the objects that are `placed`.
    """
    view, evidence = aligner.view, unexplained_evidence(aligner, placed)
    waiting = {name: find_candidates(view, shape, evidence) for name, shape in shapes.items()}
    assigned: dict[str, list[Array]] = {}
    while waiting:
        rated = {
            n: _rate_candidate(view, shapes[n], found, evidence) for n, found in waiting.items()
        }
        name = max(rated, key=lambda n: rated[n])
        if rated[name] < MIN_CANDIDATE_EVIDENCE:
            break
        assigned[name] = promising_places(waiting.pop(name))
        window = _remove_explained(view, shapes[name], assigned[name][0], evidence)
        for other, found in waiting.items():
            if window.overlaps(view.window(shapes[other], found[0].q, 20.0)):
                waiting[other] = find_candidates(view, shapes[other], evidence)
    return assigned


def unexplained_evidence(aligner: Aligner, placed: dict[str, Placed]) -> Array:
    """(H, W) evidence that no placed object explains."""
    evidence = aligner.evidence.copy()
    for shape, q in placed.values():
        _remove_explained(aligner.view, shape, q, evidence)
    return evidence


def promising_places(found: list[SearchResult]) -> list[Array]:
    """Displacements of the places that may turn out best, the likeliest first."""
    best = max(f.score for f in found)
    # Score below that of the best place down to which a place is tried.
    return [f.q for i, f in enumerate(found) if i == 0 or f.score > best - 0.12]


def find_candidates(view: PinholeView, shape: TargetShape, evidence: Array) -> list[SearchResult]:
    """Candidate places of an object; if none near its target's angle is good, the best of all
    first.
    """
    found = find_places(view, shape, evidence)
    if _rate_candidate(view, shape, found, evidence) >= MIN_CANDIDATE_EVIDENCE:
        return found
    return sorted(found, key=lambda f: -silhouette_support(view, shape, f.q, evidence, None)[0])


def _rate_candidate(
    view: PinholeView, shape: TargetShape, found: list[SearchResult], evidence: Array
) -> float:
    """Confidence in an object's candidate place: its support, more for a large one."""
    support, area = silhouette_support(view, shape, found[0].q, evidence, None)
    return support if area > 30.0 else -1.0  # Pixels with evidence that a silhouette needs.


def silhouette_support(
    view: PinholeView, shape: TargetShape, q: Array, evidence: Array, others: Array | None
) -> tuple[float, float]:
    """Ratio of signed to absolute evidence in the silhouette, and the absolute sum [pixels]."""
    window = view.window(shape, q, 2.0)
    depth = view.buffer(shape, q, window)
    part = window_slices(window)
    mask = np.isfinite(depth) if others is None else depth < others[part]
    weight = np.abs(evidence[part])[mask].sum()
    return float(evidence[part][mask].sum() / max(weight, 1.0)), float(weight)


def _remove_explained(
    view: PinholeView, shape: TargetShape, q: Array, evidence: Array
) -> ImageWindow:
    """Removes the evidence that an object explains; returns the window of the removed pixels."""
    window = view.window(shape, q, 8.0)
    mask = np.isfinite(view.buffer(shape, q, window)).astype(np.uint8)
    grown = cv2.dilate(mask, np.ones((7, 7), np.uint8)) > 0
    part = evidence[window_slices(window)]
    part[grown] = 0.0
    return window
