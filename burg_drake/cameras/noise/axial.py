"""Errors along the optical axis: as measured on planes, as stereo has them, and their steps."""

from __future__ import annotations

import math

import numpy as np

from burg_drake.cameras.noise.document import DepthNoise
from burg_drake.cameras.noise.surfaces import inverse_depth
from burg_drake.core import Single

STEEP = math.radians(60.0)
"""Up to this angle axial noise does not depend on it (Nguyen et al. 2012)."""
STEEPEST = math.radians(82.0)
"""Beyond this angle noise is that of this one, as the formulas' grow to infinity at 90 degrees; an
estimate of how far they hold."""


def axial_sigma(depth: Single, angle: Single | None, noise: DepthNoise) -> Single:
    """(H, W) standard deviation of depth [m].

    `a + b (z - c)^2`, and beyond 60 degrees in addition `d / sqrt(z) (t / (pi/2 - t))^2`, with the
    angle t (Nguyen, Izadi and Lovell 2012, equations of the axial noise). Their angle is that of a
    turned plane in the image's middle; here it is the one against the ray. The second term begins
    with a step, as theirs does, of 0.4 mm at 1 m.

    Args:
        depth: (H, W) [m], 0 for none.
        angle: (H, W) of incidence [rad]; None if `axial_angle` is 0.
        noise: has a, b, c and d as `axial_base`, `axial_square`, `axial_center`, `axial_angle`.
    """
    sigma: Single = np.float32(noise.axial_square) * np.square(
        depth - np.float32(noise.axial_center)
    )
    sigma += np.float32(noise.axial_base)
    if noise.axial_angle and angle is not None:
        steep = (angle > STEEP) & (depth > 0.0)
        t = np.minimum(angle[steep], np.float32(STEEPEST))
        growth = np.square(t / (np.float32(np.pi / 2) - t))
        sigma[steep] += np.float32(noise.axial_angle) * growth / np.sqrt(depth[steep])
    return sigma


def axial_noise(
    depth: Single, angle: Single | None, noise: DepthNoise, rng: np.random.Generator
) -> Single:
    """Depth with normal errors of `axial_sigma`, each pixel's for itself; see there."""
    moved = rng.standard_normal(depth.shape, dtype=np.float32)
    moved *= axial_sigma(depth, angle, noise)
    moved += depth
    return _kept(moved, depth)


def disparity_errors(
    depth: Single, focal: float, noise: DepthNoise, rng: np.random.Generator
) -> Single:
    """Depth of disparities with normal errors of `disparity_sigma`, in steps of `disparity_step`.

    As long as they are small against z, the depth's standard deviation is `z^2 sigma / (f b)`
    (Grunnet-Jepsen, Sweetser and Woodfill, "Tuning depth cameras for best performance"; Keselman et
    al., "Intel RealSense stereoscopic depth cameras", CVPR workshops 2017, equation 2), and steps
    are `z^2 step / (f b)` apart (Khoshelham and Elberink, Sensors 12, 2012). A disparity that is 0
    or below, gives no depth.

    Args:
        depth: (H, W) [m], 0 for none.
        focal: f_x [pixels].
        noise: has sigma and step, either of which may be 0, and the baseline b.
        rng: of the errors; not asked if there are none.
    """
    scale = np.float32(focal * abs(noise.baseline))
    disparity = scale * inverse_depth(depth)
    if noise.disparity_sigma:
        errors = rng.standard_normal(depth.shape, dtype=np.float32)
        errors *= np.float32(noise.disparity_sigma)
        disparity += errors
    if noise.disparity_step:
        disparity /= np.float32(noise.disparity_step)
        np.rint(disparity, out=disparity)
        disparity *= np.float32(noise.disparity_step)
    disparity[disparity <= 0.0] = np.inf
    return _kept(np.asarray(scale / disparity), depth)


def depth_steps(depth: Single, noise: DepthNoise) -> Single:
    """Depth in whole multiples of `depth_step`, as cameras write it; 0 below half of one."""
    step = np.float32(noise.depth_step)
    return np.asarray(step * np.rint(depth / step))


def _kept(moved: Single, depth: Single) -> Single:
    """Nothing where nothing was, or where an error leads to the camera and beyond."""
    return np.where((depth > 0.0) & (moved > 0.0), moved, np.float32(0.0))
