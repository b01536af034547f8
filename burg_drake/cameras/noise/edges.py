"""Where surfaces end: edges fray, and pixels that see two surfaces lie in between."""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.cameras.noise.axial import STEEPEST
from burg_drake.cameras.noise.document import DepthNoise
from burg_drake.cameras.noise.surfaces import EDGE
from burg_drake.core import Array, Booleans, Single

REACH = 3.0
"""Standard deviations within which pixels beside an edge may show what is beyond it; 0.3 % of the
steps would be longer."""


def lateral_sigma(angle: Single | Array, noise: DepthNoise) -> Array:
    """Standard deviation of where an edge is, along rows and along columns [pixels].

    `a + b t / (pi/2 - t)`, with the angle of incidence t (Nguyen, Izadi and Lovell 2012, the
    equation of the lateral noise in pixels).

    Args:
        angle: of incidence, of any shape [rad].
        noise: has a and b as `lateral_base` and `lateral_angle`.
    """
    t = np.minimum(np.asarray(angle, dtype=float), STEEPEST)
    return np.asarray(noise.lateral_base + noise.lateral_angle * t / (np.pi / 2 - t))


def lateral_noise(
    depth: Single,
    edges: Booleans,
    angle: Single | None,
    noise: DepthNoise,
    rng: np.random.Generator,
) -> Single:
    """Depth with frayed edges: pixels near them show what is a random step away.

    Only pixels within reach of an edge do: their noise was measured at edges, and within a surface
    it would add to the axial noise, which was measured as a whole. Barron and Malik ("Intrinsic
    scene properties from a single RGB-D image", CVPR 2013) and Handa et al. ("A benchmark for RGB-D
    visual odometry, 3D reconstruction and SLAM", ICRA 2014) displace all pixels, by a standard
    deviation of half a pixel, and interpolate, which puts pixels in between.

    Args:
        depth: (H, W) [m], 0 for none.
        edges: (H, W) see `depth_edges`.
        angle: (H, W) of incidence [rad]; 0 everywhere if None.
        noise: see `lateral_sigma`.
        rng: of the steps.
    """
    largest = float(lateral_sigma(np.array(STEEPEST if angle is not None else 0.0), noise))
    size = 2 * int(np.ceil(REACH * largest)) + 1
    near = cv2.dilate(edges.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
    rows, columns = np.divmod(np.flatnonzero(near & (depth > 0.0)), depth.shape[1])
    sigma = lateral_sigma(np.zeros(len(rows)) if angle is None else angle[rows, columns], noise)
    steps = np.rint(sigma * rng.standard_normal((2, len(rows)), dtype=np.float32)).astype(np.intp)
    height, width = depth.shape
    frayed = depth.copy()
    frayed[rows, columns] = depth[
        np.clip(rows + steps[0], 0, height - 1), np.clip(columns + steps[1], 0, width - 1)
    ]
    return frayed


def flying_pixels(
    depth: Single, edges: Booleans, noise: DepthNoise, rng: np.random.Generator
) -> Single:
    """Depth in which a share of the pixels at edges lie anywhere between near and far.

    A pixel that sees two surfaces measures a mixture ("Color-guided flying pixel correction in
    depth images", arXiv 2410.08084); of which of their parts, is random here, an estimate. There
    is none at an edge beyond which nothing is.

    Args:
        depth: (H, W) [m], 0 for none.
        edges: (H, W) see `depth_edges`.
        noise: has the share, `flying`.
        rng: of the choice and the mixture.
    """
    around = np.ones((3, 3), np.uint8)
    far = cv2.dilate(depth, around)
    near = cv2.erode(np.where(depth > 0.0, depth, np.float32(np.inf)), around)
    rows, columns = np.divmod(np.flatnonzero(edges & (depth > 0.0)), depth.shape[1])
    low, high = near[rows, columns], far[rows, columns]
    mixed = rng.random(len(rows)) < noise.flying
    mixed &= high - low > EDGE * low
    part = rng.random(len(rows), dtype=np.float32)
    result = depth.copy()
    result[rows[mixed], columns[mixed]] = (low + part * (high - low))[mixed]
    return result
