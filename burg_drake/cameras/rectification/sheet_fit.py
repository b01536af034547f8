"""How a board's sheet lies in an image of a camera that nobody has calibrated.

The corners of its markers give a homography from the sheet to an image without lens distortion, and
one coefficient that bends it about the image's middle, as most lenses do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from burg_drake.cameras.pose import (
    MISPLACED,
    MarkerDetector,
    grey_image,
    other_markers,
    side_lengths,
)
from burg_drake.core import Array, InvalidInputError
from burg_drake.scene.document import Board

ENOUGH_FOR_LENS = 6
"""Markers from which on the lens is fitted, too."""
LENS_LIMIT = 0.3
"""Largest coefficient: a corner of the image is moved by so much of its distance from the middle.
"""
LENIENT = 0.1
"""Share of a marker's side that corners may be off without a lens; one that stands elsewhere is off
by more than a side."""
LENS_GAIN = 0.5
"""The bend counts if the misfit with it is less than this share of that without it."""
SHARP = 0.5
"""Error of corners that are well seen [pixels]."""
FAR_OFF = 0.05
"""Share of a marker's side that corners may be off on average; with more it is another board."""


@dataclass(frozen=True, eq=False)
class SheetFit:
    """A sheet in an image.

    Attributes:
        H: (3, 3) homography from x and y of the scene frame [m] to undistorted image coordinates,
            which have their origin in the image's middle and half its diagonal as their unit.
        distortion: what a lens adds to a distance r from the middle: `r (1 + distortion r^2)`.
        middle: (2,) [pixels].
        radius: half the image's diagonal [pixels].
        error: root mean square distance of the markers' corners from their places on the sheet [m].
        ids: markers that were used.
    """

    H: Array
    distortion: float
    middle: Array
    radius: float
    error: float
    ids: tuple[int, ...]

    def project(self, p_SQ: Array) -> Array:
        """(N, 2) pixels of points (N, 2) on the sheet [m]; far outside of the image for what no
        camera could see there."""
        return _project(self.H, self.distortion, p_SQ) * self.radius + self.middle


class SheetFinder:
    """Finds one board's sheet in images."""

    def __init__(self, board: Board) -> None:
        self._layout = board.layout
        self._detector = MarkerDetector(board.layout)

    def find(self, image: NDArray[np.uint8]) -> SheetFit:
        """Finds it.

        Args:
            image: (H, W) or RGB (H, W, 3).

        Raises:
            InvalidInputError: the image does not show this board.
        """
        grey = grey_image(image)
        seen = self._detector.detect(grey)
        if not len(seen.index):
            raise InvalidInputError(self._no_markers_reason(grey, seen.candidates))
        size = np.array(grey.shape[::-1], dtype=float)
        middle, radius = 0.5 * (size - 1.0), 0.5 * float(np.linalg.norm(size))
        p_SQ = self._layout.p_SQ[seen.index][..., :2]
        corners = (seen.corners - middle) / radius
        tolerance = max(MISPLACED[0] / radius, LENIENT * float(side_lengths(corners).mean()))
        kept = _agreeing(p_SQ, corners, tolerance)
        n, fit = len(kept), int(kept.sum())
        if fit < max(1, n / 2) or (n > 1 and fit < 2):
            raise InvalidInputError(
                f"the image shows another board: only {fit} of {n} markers in sight are where this"
                " one has them; are columns, rows and first_id right?"
            )
        if 2 * fit < len(self._layout.ids):
            self._require_no_foreign_markers(grey, fit)
        p_SQ, corners = p_SQ[kept].reshape(-1, 2), corners[kept].reshape(-1, 2)
        H, distortion = _fitted(p_SQ, corners, fit, 1.0 / radius)
        off = _project(H, distortion, p_SQ) - corners
        scale = self._layout.side / float(side_lengths(corners.reshape(-1, 4, 2)).mean())
        error = scale * float(np.sqrt((off**2).sum(axis=1).mean()))
        if error > FAR_OFF * self._layout.side:
            raise InvalidInputError(
                "the image shows another board: the corners of its markers are off by"
                f" {1e3 * error:.1f} mm on average; are side and spacing right, and is the sheet"
                " flat?"
            )
        ids = tuple(int(i) for i in self._layout.ids[seen.index[kept]])
        return SheetFit(H, distortion, middle, radius, error, ids)

    def _require_no_foreign_markers(self, grey: NDArray[np.uint8], fit: int) -> None:
        """Refuses a sheet that has more markers which are not this board's than fit: a part of the
        first row is the same on boards of several sizes."""
        layout = self._layout
        other = other_markers(grey, layout)
        if other is None or other.dictionary.lower() != layout.dictionary.lower():
            return
        foreign_markers = set(other.ids) - set(layout.ids.tolist())
        if len(foreign_markers) > fit:
            raise InvalidInputError(
                f"the image shows another board: {len(foreign_markers)} markers in sight have ids"
                f" above {layout.ids[-1]}, the last of this one; are columns and rows right?"
            )

    def _no_markers_reason(self, grey: NDArray[np.uint8], candidates: int) -> str:
        layout = self._layout
        other = other_markers(grey, layout) if candidates else None
        if other is None:
            return "the image shows no marker of the board; improve the light, or move closer"
        own = f"this one has {layout.dictionary} with ids {layout.ids[0]} to {layout.ids[-1]}"
        listed = ", ".join(map(str, other.ids[:3])) + (" ..." if len(other.ids) > 3 else "")
        return (
            f"the image shows another board: {len(other.ids)} markers of {other.dictionary} with"
            f" ids {listed}; {own}"
        )


def _agreeing(p_SQ: Array, corners: Array, tolerance: float) -> NDArray[np.bool_]:
    """(N,) markers with all corners (N, 4, 2) where the homography that most agree on has them."""
    if len(p_SQ) == 1:
        return np.ones(1, dtype=bool)
    cv2.setRNGSeed(0)
    _, fits = cv2.findHomography(p_SQ.reshape(-1, 2), corners.reshape(-1, 2), cv2.RANSAC, tolerance)
    if fits is None:
        return np.zeros(len(p_SQ), dtype=bool)
    return np.asarray(fits.reshape(-1, 4).all(axis=1))


def _fitted(p_SQ: Array, corners: Array, markers: int, pixel: float) -> tuple[Array, float]:
    """Homography and bend that put corners (N, 2) where they were seen; corners that are half
    hidden, and were found beside their place, hardly count."""
    H, _ = cv2.findHomography(p_SQ, corners, 0)
    if H is None:
        raise InvalidInputError("the visible part of the board does not determine its pose")

    def off(x: Array) -> Array:
        return (_project(_homography(x), float(x[8:].sum()), p_SQ) - corners).ravel()

    def fit(start: Array, limit: Array) -> Any:
        return least_squares(
            *(off, start),
            bounds=(-limit, limit),
            x_scale="jac",
            loss="soft_l1",
            f_scale=SHARP * pixel,
        )

    plain = fit((H / H[2, 2]).ravel()[:8], np.full(8, np.inf))
    if markers >= ENOUGH_FOR_LENS:
        bent = fit(np.append(plain.x, 0.0), np.append(np.full(8, np.inf), LENS_LIMIT))
        if bent.cost < LENS_GAIN * plain.cost:
            return _homography(bent.x), float(bent.x[8])
    return _homography(plain.x), 0.0


def _homography(x: Array) -> Array:
    return np.append(x[:8], 1.0).reshape(3, 3)


def _project(H: Array, distortion: float, p_SQ: Array) -> Array:
    q = np.column_stack([p_SQ, np.ones(len(p_SQ))]) @ H.T
    ahead = q[:, 2:] > 1e-3 * np.abs(q[:, 2]).max()
    flat = np.where(ahead, q[:, :2] / np.where(ahead, q[:, 2:], 1.0), 1e3)
    bent: Array = flat * (1.0 + distortion * (flat**2).sum(axis=1, keepdims=True))
    return bent
