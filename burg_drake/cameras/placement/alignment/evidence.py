"""Where a photo shows something that is not the board, whatever shadows lie on it.

A shadow darkens paper and ink alike, so that the board's pattern keeps its contrast in the
logarithm of the light; what stands on the board hides the pattern. And a shadow is grey. So three
things are looked at, pixel by pixel: whether the pattern is there, whether the color is one that
paper, ink and tints can have in any light, and whether it is brighter than the light allows. A grey
patch on plain paper may be a shadow, and tells nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

WINDOW = 0.8
"""Standard deviation of the neighbourhood in which the pattern is looked for [cells]."""
LEAST_WINDOW = 2.0
"""The same at least [pixels]."""
FAINT = 0.02
"""Added to light before its logarithm is taken, against noise in the dark, as a share of paper."""
PATTERN = 0.25
"""Variance of the pattern's logarithm from which on it says all it can; that of a marker is 2."""
COLORED = (0.10, 0.22)
"""Share of the light that no grey light on paper, ink and tint explains: nothing, and certain."""
BRIGHT = (1.15, 1.45)
"""Light over that of the board without shadow: nothing, and certain."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What evidence is taken from.

    Attributes:
        light: (H, W, 3) of the photo.
        color: (H, W, 3) of the board without shadow.
        tint: (H, W, 3) reflectance of what may be tinted, over that of paper.
        ink: (H, W) share of ink, blurred as the photo is.
        white: (H, W, 3) light of paper without shadow.
        black: light of ink over that of paper.
        cell: side of a marker's cell [pixels].
    """

    light: NDArray[np.float32]
    color: NDArray[np.float32]
    tint: NDArray[np.float32]
    ink: Array
    white: Array
    black: float
    cell: float


@dataclass(frozen=True, eq=False)
class Texture:
    """Whether the board's pattern is seen.

    Attributes:
        score: (H, W) 1 where it has its contrast, -1 where there is none, 0 in the middle and where
            no pattern is expected.
        weight: (H, W) in [0, 1], how much pattern is expected.
    """

    score: Array
    weight: Array


def window_of(cell: float) -> float:
    """Standard deviation of the neighbourhood for cells of a size [pixels]."""
    return max(WINDOW * cell, LEAST_WINDOW)


def texture(light: NDArray[np.float32], ink: Array, black: float, cell: float) -> Texture:
    """Compares logarithms of a photo and of the board in neighbourhoods.

    Of a photo of the board in any light their covariance is the variance of the board's, and of one
    without the pattern it is 0.

    Args:
        light: (H, W, 3) of the photo.
        ink: (H, W) share of ink, blurred as the photo is.
        black: light of ink over that of paper.
        cell: side of a marker's cell [pixels].
    """
    sigma = window_of(cell)
    grey = light.mean(axis=-1)
    # what paper gives around here, so that `FAINT` is the same share in shade and sun
    local = cv2.GaussianBlur(cv2.dilate(grey, np.ones((5, 5))), (0, 0), 2.0 * sigma)
    seen = np.log(grey / np.maximum(local, 1e-4) + FAINT).astype(np.float32)
    known = np.log(1.0 - (1.0 - black) * ink + FAINT).astype(np.float32)

    def around(values: NDArray[np.float32]) -> NDArray[np.float32]:
        return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma))

    mean_seen, mean_known = around(seen), around(known)
    variance = around(known * known) - mean_known**2
    covariance = around(seen * known) - mean_seen * mean_known
    score = np.clip(2.0 * covariance / np.maximum(variance, 1e-3) - 1.0, -1.0, 1.0)
    weight = np.clip(variance / PATTERN, 0.0, 1.0)
    return Texture(score * weight, weight)


def evidence_of(told: Evidence) -> Array:
    """(H, W) from +1, where something stands, to -1, where the board is seen."""
    pattern = texture(told.light, told.ink, told.black, told.cell)
    stands = np.maximum(_colored(told), _bright(told))
    return np.where(stands > 0.0, np.maximum(stands, -pattern.score), -pattern.score)


def _ramp(values: Array, limits: tuple[float, float]) -> Array:
    return np.clip((values - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)


def _colored(told: Evidence) -> Array:
    """(H, W) 0 where grey light on paper, ink and tint, mixed as they like, explains the color."""
    light = cv2.GaussianBlur(told.light, (0, 0), 0.8)
    r = light / told.white.astype(np.float32)
    tone = told.tint
    grey = np.float32(1.0 / np.sqrt(3.0))
    along = r.sum(axis=-1) * grey
    # the part of the tint that is not grey
    across = tone - (tone.mean(axis=-1, keepdims=True))
    length = np.sqrt((across**2).sum(axis=-1))
    across /= np.maximum(length, 1e-6)[..., None]
    share = np.clip((r * across).sum(axis=-1), 0.0, None) * (length > 0.01)
    # no more tinted than the tint is
    most = length / np.maximum(tone.sum(axis=-1) * grey, 1e-6) * along
    share = np.minimum(share, most)
    left = r - along[..., None] * grey - share[..., None] * across
    off = np.sqrt((left**2).sum(axis=-1))
    # in the dark, colors are noise and stray light
    return _ramp(off / (along + 0.06), COLORED)


def _bright(told: Evidence) -> Array:
    """(H, W) 0 where the board could be as bright; tolerates a pixel of misalignment."""
    most = cv2.dilate(told.color.mean(axis=-1), np.ones((3, 3)))
    # next to a bright pixel an edge's blur is not exact
    return _ramp(told.light.mean(axis=-1) / (most + 0.03 * told.white.mean(axis=-1)), BRIGHT)
