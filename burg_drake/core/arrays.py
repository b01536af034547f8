"""Types of arrays by their values.

Shapes are stated in the docstrings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers."""
Single = NDArray[np.float32]
"""Numbers in single precision."""
Indices = NDArray[np.intp]
"""Indices into another array."""
Booleans = NDArray[np.bool_]
"""Masks and other truth values."""
Bytes = NDArray[np.uint8]
"""Channels of images."""
