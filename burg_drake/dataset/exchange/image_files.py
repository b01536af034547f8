"""Images as files of other formats have them: colours, and depth as whole numbers."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Bytes, InvalidInputError, Single
from burg_drake.dataset.samples import encode_png

QUALITY = 95
"""Of JPEG, 0 to 100; OpenCV's own default."""
DEEPEST = np.iinfo(np.uint16).max
"""Largest number of a pixel in a depth image."""


def color_file(image: Bytes, suffix: str) -> bytes:
    """Colours (H, W, 3) as `.jpg` or `.png`."""
    if suffix == ".png":
        return encode_png(image)
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    return bytes(data)


def depth_numbers(depth: Single, unit: float, key: str) -> NDArray[np.uint16]:
    """Depth as whole numbers.

    Args:
        depth: (H, W) [m], 0 where there is none.
        unit: what 1 stands for [m].
        key: of the sample, for the message.

    Raises:
        InvalidInputError: a depth is beyond the largest number.
    """
    numbers = np.rint(depth / unit)
    if numbers.max(initial=0.0) > DEEPEST:
        raise InvalidInputError(
            f"sample {key} has depths up to {depth.max():.3g} m, but 16-bit images with a unit of"
            f" {1e3 * unit:g} mm end at {DEEPEST * unit:.3g} m; give a larger unit"
        ).about("depth_unit")
    return np.asarray(numbers, dtype=np.uint16)
