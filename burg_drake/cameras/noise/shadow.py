"""What cannot be measured because it is hidden from the second imager, or from the projector."""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.cameras.noise.surfaces import inverse_depth
from burg_drake.core import Booleans, Indices, Single

BEFORE = 0.5
"""A surface hides another one if its disparity is larger by this [pixels], as images are
rasters."""


def hidden_from_second(
    depth: Single, focal: float, baseline: float, *, same_view: bool
) -> Booleans:
    """Pixels whose points are not seen from a second centre beside the camera's.

    Pixel u of depth z is seen there at `u - f b / z`, in the same row. Left of a box at z1 before a
    wall at z2 the shadow of a centre to the right is `f b (1 / z1 - 1 / z2)` pixels wide. Points
    that the camera itself does not see hide nothing. Images are taken as rectified: there is no
    lens distortion.

    Args:
        depth: (H, W) [m], 0 for none.
        focal: f_x [pixels].
        baseline: x of the second centre in the camera's frame [m].
        same_view: the second image is as wide as the first, so that a band at the side of the
            second centre's opposite is not seen; else all is seen that nothing hides.

    Returns:
        (H, W); False where nothing is.
    """
    if baseline < 0.0:
        turned = hidden_from_second(depth[:, ::-1], focal, -baseline, same_view=same_view)
        return turned[:, ::-1]
    seen = depth > 0.0
    disparity = np.float32(focal * baseline) * inverse_depth(depth)
    there = np.arange(depth.shape[1], dtype=np.float32) - disparity
    hidden = np.zeros(depth.shape, dtype=bool)
    overtaken = np.flatnonzero(_overtaken(there, disparity) & seen)
    if len(overtaken):
        nearest, pixels = _second_view(there, disparity)
        before = nearest.ravel()[pixels.ravel()[overtaken]] > disparity.ravel()[overtaken] + BEFORE
        hidden.ravel()[overtaken[before]] = True
    if same_view:
        hidden |= seen & (there < -0.5)
    return hidden


def _overtaken(there: Single, disparity: Single) -> Booleans:
    """Pixels right of which another one is seen farther left from the second centre. Of surfaces
    that both centres see there are none, however steep. Where a nearer surface begins, it does so
    half a pixel before its first pixel's centre. What is not there has no disparity, and so
    overtakes nothing."""
    begins = there.copy()
    nearer = disparity[:, 1:] > disparity[:, :-1] + np.float32(1.0)
    np.subtract(begins[:, 1:], np.float32(0.5), out=begins[:, 1:], where=nearer)
    leftmost = np.minimum.accumulate(begins[:, ::-1], axis=1)[:, ::-1]
    overtaken = np.zeros(there.shape, dtype=bool)
    np.greater(there[:, :-1], leftmost[:, 1:], out=overtaken[:, :-1])
    return overtaken


def _second_view(there: Single, disparity: Single) -> tuple[Single, Indices]:
    """Largest disparity at each pixel of the second image (H, V), which reaches as far to the left
    as needed, two widths at most; and the pixels (H, W), counted row by row, where the first
    image's are in it. Gaps of one pixel, as in surfaces that are wider there, are filled."""
    height, width = there.shape
    left = min(int(np.ceil(disparity.max())) + 1, 2 * width)
    image = np.zeros((height, left + width), dtype=np.float32)
    pixels = np.rint(np.maximum(there, np.float32(-left))).astype(np.intp)
    pixels += (left + image.shape[1] * np.arange(height))[:, None]
    np.maximum.at(image.ravel(), pixels.ravel(), disparity.ravel())
    return cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((1, 3), np.uint8)), pixels
