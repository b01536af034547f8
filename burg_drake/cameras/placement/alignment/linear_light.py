"""From the levels of an image to light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def linear_light(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(...) the light, 1 at full scale, of 8-bit levels in sRGB (IEC 61966-2-1)."""
    level = np.arange(256) / 255.0
    curve = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    return np.asarray(curve.astype(np.float32)[image])
