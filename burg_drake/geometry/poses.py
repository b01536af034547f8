"""Poses in batches by elementwise arithmetic: results do not depend on the batch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from burg_drake.core import Array


@dataclass(frozen=True, eq=False)
class Poses:
    """Poses X_BA of frames A in frames B.

    Attributes:
        R: (..., 3, 3) rotations R_BA.
        p: (..., 3) positions p_BA [m].
    """

    R: Array
    p: Array

    @classmethod
    def of(cls, X_BA: Array) -> Poses:
        """From matrices (..., 4, 4)."""
        return cls(X_BA[..., :3, :3], X_BA[..., :3, 3])

    def __getitem__(self, chosen: Any) -> Poses:
        return Poses(self.R[chosen], self.p[chosen])

    def __matmul__(self, other: Poses) -> Poses:
        """X_CA = X_CB @ X_BA; shapes broadcast."""
        a, b, c = (self.R[..., :, k, None] * other.R[..., None, k, :] for k in range(3))
        return Poses(a + b + c, self.apply(other.p))

    def apply(self, p_A: Array) -> Array:
        """Points (..., 3) given in A, expressed in B."""
        return rotate(self.R, p_A) + self.p

    def inverse(self) -> Poses:
        """X_AB."""
        R_AB = self.R.swapaxes(-1, -2)
        return Poses(R_AB, -rotate(R_AB, self.p))


def rotate(R_BA: Array, v_A: Array) -> Array:
    """Vectors (..., 3) given in A, expressed in B."""
    x, y, z = (v_A[..., k, None] for k in range(3))
    return np.asarray(R_BA[..., 0] * x + R_BA[..., 1] * y + R_BA[..., 2] * z)
