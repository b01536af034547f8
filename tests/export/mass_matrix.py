"""Moments and products of inertia as a matrix."""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array
from burg_drake.objects import Inertia


def inertia_matrix(inertia: Inertia) -> Array:
    """(3, 3) about the centre of mass."""
    xx, yy, zz, xy, xz, yz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
