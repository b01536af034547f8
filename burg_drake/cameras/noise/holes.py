"""Holes: surfaces that send too little light back, as they are seen from aside or are dark.

Mallick, Das and Majumdar ("Characterizations of noise in Kinect depth images: a review", IEEE
Sensors Journal 14, 2014) name these as causes. Probabilities are estimates, and their course is
the simplest one; others lose all that is darker than a threshold, such as 15 of 255 (BlenderProc,
of the Azure Kinect).
"""

from __future__ import annotations

import cv2
import numpy as np
from scipy.special import ndtri

from burg_drake.cameras.noise.document import DepthNoise
from burg_drake.core import Booleans, Bytes, Single


def grazing_probability(angle: Single, noise: DepthNoise) -> Single:
    """(H, W) probability of a hole: 0 up to `grazing_from_deg`, 1 from `grazing_to_deg` on, linear
    in between.

    Args:
        angle: (H, W) of incidence [rad].
        noise: has the two angles.
    """
    low, high = np.deg2rad([noise.grazing_from_deg, noise.grazing_to_deg])
    if high <= low:
        return np.asarray(angle > low, dtype=np.float32)
    rising: Single = (angle - np.float32(low)) / np.float32(high - low)
    return np.clip(rising, 0.0, 1.0)


def dark_probability(color: Bytes, noise: DepthNoise) -> Single:
    """(H, W) probability of a hole: `dark_probability` at black, 0 from `dark_below` on, linear in
    the luma (ITU-R BT.601) in between.

    Args:
        color: (H, W, 3) red, green, blue.
        noise: has the two figures.
    """
    luma = cv2.cvtColor(np.ascontiguousarray(color), cv2.COLOR_RGB2GRAY).astype(np.float32)
    dark = np.maximum(np.float32(1.0) - luma / np.float32(noise.dark_below), np.float32(0.0))
    return np.asarray(np.float32(noise.dark_probability) * dark)


def holes(probability: Single, size: float, rng: np.random.Generator) -> Booleans:
    """Random holes.

    Args:
        probability: (H, W) of a hole in each pixel; with patches it holds
            within 0.005.
        size: standard deviation of the Gaussian that makes patches of single holes, at least
            1 [pixels]; none if 0.
        rng: of where they are.

    Returns:
        (H, W) True in a hole.
    """
    if not probability.any():
        return np.zeros(probability.shape, dtype=bool)
    if size == 0.0:
        return rng.random(probability.shape, dtype=np.float32) < probability
    found = probability >= 1.0
    unsure = (probability > 0.0) & ~found
    field = _smooth_field(probability.shape, size, rng)
    found[unsure] = field[unsure] < ndtri(probability[unsure])
    return found


def _smooth_field(shape: tuple[int, ...], size: float, rng: np.random.Generator) -> Single:
    """(H, W) standard normal numbers, neighbours of which are alike: smoothed uniform ones, whose
    distribution function differs from the normal one by less than 0.005."""
    margin = int(np.ceil(3.0 * size))
    kernel = cv2.getGaussianKernel(2 * margin + 1, size, cv2.CV_32F)
    kernel /= np.linalg.norm(kernel)  # of unit variance after it
    height, width = shape
    wide = (height + 2 * margin, width + 2 * margin)
    uniform = rng.random(wide, dtype=np.float32)
    uniform -= np.float32(0.5)
    uniform *= np.float32(np.sqrt(12.0))
    field = cv2.sepFilter2D(uniform, -1, kernel, kernel)
    return np.asarray(field[margin : margin + height, margin : margin + width])
