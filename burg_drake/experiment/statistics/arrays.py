"""Types of the arrays of a comparison."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]
"""Truth values."""
Rows = NDArray[np.intp]
"""Indices."""
Values = NDArray[Any]
"""Numbers or texts of any type."""
