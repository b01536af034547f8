"""Types of arrays by what they hold.

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
"""Positions in another array."""
Booleans = NDArray[np.bool_]
"""What holds and what does not."""
Bytes = NDArray[np.uint8]
"""Channels of pictures."""
