"""Where an object is, roughly: the silhouette that covers most of what the board does not explain.

Silhouettes at several angles slide over the evidence (`EmptyBoard.evidence`: +1 something stands
here, -1 the board is seen); sliding is a correlation, which finds all translations at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from burg_drake.cameras.placement.alignment import PinholeView, TargetShape, Window
from burg_drake.core import Array

RANGE = 0.05
"""How far from its target an object is looked for [m]."""
NEAR_TURNS = np.deg2rad((0.0, -10.0, 10.0, -20.0, 20.0, -30.0, 30.0))
FAR_TURNS = np.deg2rad(np.arange(50.0, 311.0, 20.0))
"""Angles that are tried, near the target's, and far from it [rad]."""
STEP = np.deg2rad(5.0)
"""Second, finer steps of the angle."""
WIDTH = 320
"""Columns of the image that the search looks at [pixels]."""
LOOKED = 5
"""Angles, the best ones, at which the place is looked for once more from where it seems to be."""
KEPT = 3
"""Places that are handed on of each kind of angle."""
PRIOR = 0.03
"""What being `RANGE` off costs of the score, so that of places that look alike the nearest wins."""


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Where an object may be.

    Attributes:
        q: (3,) displacement, see `TargetShape.displacement`.
        score: mean evidence in the silhouette, less `PRIOR`; at most 1.
    """

    q: Array
    score: float


def find_places(view: PinholeView, shape: TargetShape, evidence: Array) -> list[SearchResult]:
    """Places where an object may be: those near its target's angle first, each kind best first.

    Args:
        view: the camera.
        shape: the object.
        evidence: (H, W) in [-1, 1].
    """
    search = SilhouetteSearch(view, shape, evidence)
    if shape.symmetric:
        return [search.slide(0.0, search.slide(0.0).q)]
    return search.best(NEAR_TURNS) + search.best(FAR_TURNS)


class SilhouetteSearch:
    """Slides one shape over the evidence, at a coarse scale."""

    def __init__(self, view: PinholeView, shape: TargetShape, evidence: Array) -> None:
        self._view, self._shape = view, shape
        self._scale = min(1.0, WIDTH / view.size[0])
        size = (round(view.size[0] * self._scale), round(view.size[1] * self._scale))
        self._evidence = cv2.resize(evidence.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        top = float(shape.p_SV[:, 2].max())
        self._middle = shape.p_SR + np.array([0.0, 0.0, top / 2])

    def best(self, turns: Array) -> list[SearchResult]:
        """The best places among some angles and those beside the best two."""
        rough = sorted((self.slide(float(turn)) for turn in turns), key=lambda f: -f.score)
        found = [self.slide(f.q[2], f.q) for f in rough[:LOOKED]]
        found.sort(key=lambda f: -f.score)
        found += [self.slide(f.q[2] + side * STEP, f.q) for f in found[:2] for side in (-1, 1)]
        return _distinct(sorted(found, key=lambda f: -f.score))[:KEPT]

    def slide(self, turn: float, start: Array | None = None) -> SearchResult:
        """The best translation at an angle: anywhere, or near to where it seems to be, as the
        silhouette changes with its place."""
        near = start if start is not None else np.zeros(2)
        q, score = self._step(
            np.array([near[0], near[1], turn]), RANGE if start is None else RANGE / 4
        )
        off = np.hypot(q[0], q[1]) / RANGE
        return SearchResult(q, score - PRIOR * min(off, 2.0) ** 2)

    def shifted(self, q: Array, reach: float) -> Array:
        """The best displacement at the angle of another, up to `reach` [m] from it."""
        return self._step(q, reach)[0]

    def _step(self, q: Array, reach: float) -> tuple[Array, float]:
        """One correlation; returns where its peak is, and the mean evidence there."""
        view, scale = self._view, self._scale
        window = view.window(self._shape, q, 1.0)
        window = _aligned(window, scale)
        mask = np.isfinite(view.buffer(self._shape, q, window)).astype(np.float32)
        if mask.sum() < 4:
            return q, -1.0
        J = view.jacobian((self._middle + q * (1.0, 1.0, 0.0))[None])[0, :, :2] * scale
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
        # what is not within the range is not looked for; from outside, the way back is open
        far = np.hypot(q[0] + shift[..., 0], q[1] + shift[..., 1]) / RANGE
        rated = np.where(off <= reach * 1.01, score - PRIOR * far**2, -np.inf)
        best = np.unravel_index(int(rated.argmax()), rated.shape)
        return q + np.append(shift[best], 0.0), float(score[best])


def _aligned(window: Window, scale: float) -> Window:
    """A window whose raster of `scale` shares its pixels with the scaled image."""
    n = round(1.0 / scale)
    left, top = window.left // n * n, window.top // n * n
    right = -(-(window.left + window.width) // n) * n
    bottom = -(-(window.top + window.height) // n) * n
    return Window(left, top, right - left, bottom - top, scale)


def _distinct(found: list[SearchResult]) -> list[SearchResult]:
    """Leaves out places that are near to better ones."""
    kept: list[SearchResult] = []
    for f in found:
        near = (
            np.hypot(*(f.q[:2] - k.q[:2])) < 0.01 and abs(_wrap_angle(f.q[2] - k.q[2])) < 2 * STEP
            for k in kept
        )
        if not any(near):
            kept.append(f)
    return kept


def _wrap_angle(angle: float) -> float:
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)
