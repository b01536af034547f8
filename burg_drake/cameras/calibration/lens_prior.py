"""What is known of a camera and a target before any corner is seen.

It decides nothing that corners tell, and holds what they say nothing about.
"""

from __future__ import annotations

import numpy as np

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array

BENDS = 3
"""Ways to bend: x^2, x y and y^2."""
POWERS = np.array([2, 4, 2, 2, 6, 2, 4, 6])
FISHEYE_POWERS = np.array([2, 4, 6, 8])
"""Of the distance from the middle, with which each coefficient counts."""
LARGEST = 1.0
"""What a term of a lens's formula is at most, about, in the image's corners, or one focal length
from the middle if that is nearer. It holds what corners say nothing about: the rational model has
such a direction if the lens is nearly of a simpler one [-]."""
SPREAD, ASIDE = 0.5, 0.1
"""Of the logarithm of focal lengths, over the image's diagonal, and of the center's distance from
the image's, as shares of the diagonal. They hold a camera of which the views tell nothing."""


def prior(camera: Intrinsics, bends: Array) -> tuple[Array, Array]:
    """What is known of a camera and a target before any corner is seen.

    Returns:
        `(errors, slopes)`: (P + 3,) how many standard deviations their parameters are from what is
        expected, and the derivatives of that.
    """
    size = np.array([camera.width, camera.height])
    diagonal = float(np.hypot(*size))
    reach = min(1.0, 0.5 * diagonal / camera.focal[0])
    powers = FISHEYE_POWERS if camera.is_fisheye else POWERS[: len(camera.distortion)]
    weights = reach**powers / LARGEST
    aside = (np.array(camera.center) - 0.5 * (size - 1)) / (ASIDE * diagonal)
    errors = np.r_[
        np.log(np.array(camera.focal) / diagonal) / SPREAD, aside, weights * camera.distortion
    ]
    slopes = np.r_[1.0 / (SPREAD * np.array(camera.focal)), [1.0 / (ASIDE * diagonal)] * 2, weights]
    return np.r_[errors, bends], np.r_[slopes, np.ones(BENDS)]
