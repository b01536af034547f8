"""The type of arrays, and rotations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


def rotation(axis: tuple[float, float, float], angle: float) -> Array:
    """(3, 3) rotation about an axis of any length by an angle [rad]."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def rotation_angle(R: Array) -> float:
    """Angle of a rotation (3, 3) [rad]."""
    sine = np.linalg.norm((R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]))
    return float(np.arctan2(sine, np.trace(R) - 1.0))


def pose(R: Array, p: Array) -> Array:
    """(4, 4) of rotation and position."""
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = R, p
    return X


def inverse(X: Array) -> Array:
    """(4, 4) inverse of a pose."""
    return pose(X[:3, :3].T, -X[:3, :3].T @ X[:3, 3])
