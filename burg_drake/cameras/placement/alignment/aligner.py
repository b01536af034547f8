"""What an alignment of an object with an image found out, whatever it was aligned by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment.contour import ImageContour
from burg_drake.cameras.placement.alignment.pinhole import PinholeView
from burg_drake.cameras.placement.alignment.shape import TargetShape
from burg_drake.cameras.placement.alignment.window import Window
from burg_drake.core import Array

SECTORS = 36
"""Neighbourhoods around an outline within which errors may be alike."""

DIFFERENT = (0.003, np.deg2rad(5.0))
"""Displacement [m] and turn [rad] from which on two alignments mean different places."""


@dataclass(frozen=True, eq=False)
class Alignment:
    """An object that was aligned.

    Attributes:
        q: (3,) displacement, see `TargetShape.displacement`.
        covariance: (3, 3) of `q`, but for the camera's error.
        camera: (3, 6) by how much `q` changes with the camera's error, as in `BoardEstimate`.
        agreement: share of what should be seen that the result agrees with.
        coverage: share of all that was looked at that agrees, also of what cannot tell.
        residual: root mean square that is left of what agrees; pixels, or metres for depth.
        measurements: number of those that agree.
        ambiguous: another place fits almost as well.
        turnable: turns from here that fit as well [rad]; see `rotation_ambiguity`.
    """

    q: Array
    covariance: Array
    camera: Array
    agreement: float
    coverage: float
    residual: float
    measurements: int
    ambiguous: bool = False
    turnable: tuple[float, ...] = ()

    def spread(self, camera: Array) -> Array:
        """(3, 3) covariance of `q` with the camera's error.

        Args:
            camera: (6, 6) covariance of the camera's pose; NaN where it is not known.
        """
        known = np.where(np.isfinite(camera), camera, 0.0)
        return self.covariance + self.camera @ known @ self.camera.T


class Aligner(Protocol):
    """Aligns an object with an image."""

    view: PinholeView
    evidence: Array
    smear: float
    """How far evidence reaches beyond what stands there [pixels]."""
    residual_floor: float
    """Residuals below this tell nothing about which of two alignments is better."""
    convincing_rating: float
    """Rating of a place near the target's angle at which no other is tried; at most 3, or 4
    with colors."""
    required_gain: float
    """By how much a place far from the target's angle must be rated higher."""
    clearly: float
    """By how much a place must be rated higher than any other to be sure."""
    strict: bool
    """What stands beside the object speaks against a place."""
    sees_colors: bool
    """The image has colors."""
    rough: float
    """Root mean square that the alignment of the right object does not leave."""

    def align(
        self, shape: TargetShape, q: Array, others: Array, *, far: bool = True, turn: bool = True
    ) -> Alignment | None:
        """Aligns an object; None if the image does not determine where it is."""

    def likeness(self, shape: TargetShape, q: Array, others: Array) -> float:
        """How well the colors of a displaced object agree, from 0 to 1; 0 for an image without,
        0.5 for an object without."""

    def misfit(
        self, shape: TargetShape, q: Array, others: Array, window: Window
    ) -> tuple[float, float]:
        """What disagrees with an object at a displacement, and its silhouette [raster pixels]."""


def differ(a: Alignment, b: Alignment) -> bool:
    """Whether two alignments mean different places."""
    turn = (a.q[2] - b.q[2] + np.pi) % (2.0 * np.pi) - np.pi
    return bool(np.hypot(*(a.q - b.q)[:2]) > DIFFERENT[0] or abs(turn) > DIFFERENT[1])


def sectors(contour: ImageContour) -> NDArray[np.int64]:
    """(N,) number of the neighbourhood around the outline that each point belongs to."""
    x, y = (contour.pixels - contour.pixels.mean(axis=0)).T if len(contour) else np.empty((2, 0))
    return np.floor(np.arctan2(y, x) / (2.0 * np.pi) * SECTORS).astype(np.int64)
