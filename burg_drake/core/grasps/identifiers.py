"""Identifiers of grasps, which follow from what a grasp is and from nothing else."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.arrays import Array

ID_DIGITS = 12
"""Hexadecimal digits of an identifier; among 100,000 grasps two share one with chance 2e-5."""


def identifiers(object: NDArray[np.str_], X_OG: Array, width: Array) -> NDArray[np.str_]:
    """(N,) hashes of names, poses and widths (BLAKE2b, which takes a microsecond a grasp)."""
    numbers = np.column_stack([X_OG.reshape(-1, 16), width]).astype("<f8")
    prefixes = {
        name: hashlib.blake2b(f"{name}\0".encode(), digest_size=ID_DIGITS // 2)
        for name in np.unique(object).tolist()
    }
    ids = []
    for name, row in zip(object.tolist(), numbers, strict=True):
        digest = prefixes[name].copy()
        digest.update(row.data)
        ids.append(digest.hexdigest())
    return np.array(ids, dtype=f"<U{ID_DIGITS}")
