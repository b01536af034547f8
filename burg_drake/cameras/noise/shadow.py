"""What cannot be measured because it is hidden from the second imager, or from the projector."""

from __future__ import annotations

import numpy as np

from burg_drake.cameras.noise.surfaces import inverse_depth
from burg_drake.core import Booleans, Single

BEFORE = 0.5
"""A surface hides another one if its disparity is larger by this [pixels]."""


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
    rows, columns = np.nonzero(_overtaken(there, disparity, seen))
    if len(rows):
        nearest = _nearest(there, disparity, seen)
        at = _bins(np.rint(there[rows, columns]), depth.shape[1])
        hidden[rows, columns] = nearest[rows, at] > disparity[rows, columns] + BEFORE
    if same_view:
        hidden |= seen & (there < -0.5)
    return hidden


def _overtaken(there: Single, disparity: Single, seen: Booleans) -> Booleans:
    """Pixels right of which another one is seen farther left from the second centre. Of surfaces
    that both centres see there are none, however steep. Where a nearer surface begins, it does so
    half a pixel before its first pixel's centre."""
    begins = np.where(seen, there, np.float32(np.inf))
    begins[:, 1:] -= np.float32(0.5) * (np.diff(disparity, axis=1) > 1.0)
    leftmost = np.minimum.accumulate(begins[:, ::-1], axis=1)[:, ::-1]
    overtaken = np.zeros(there.shape, dtype=bool)
    overtaken[:, :-1] = seen[:, :-1] & (there[:, :-1] > leftmost[:, 1:])
    return overtaken


def _nearest(there: Single, disparity: Single, seen: Booleans) -> Single:
    """(H, 3 W) largest disparity at each pixel of the second image, see `_bins`."""
    height, width = there.shape
    image = np.zeros((height, 3 * width), dtype=np.float32)
    offsets = np.broadcast_to(3 * width * np.arange(height)[:, None], there.shape)[seen]
    for rounded in (np.floor(there[seen]), np.ceil(there[seen])):
        np.maximum.at(image.ravel(), offsets + _bins(rounded, width), disparity[seen])
    return image


def _bins(columns: Single, width: int) -> np.ndarray:
    """Columns of an image that begins two widths further left."""
    return np.clip(columns.astype(np.intp) + 2 * width, 0, 3 * width - 1)
