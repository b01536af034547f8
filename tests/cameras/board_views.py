"""Views of boards that several tests look at."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from burg_drake.cameras import Intrinsics

CAMERA = Intrinsics(width=640, height=480, focal=(600.0, 602.0), center=(318.0, 241.5))
SMALL = Intrinsics(width=320, height=240, focal=(420.0, 420.0), center=(159.5, 119.5))


def view(
    target: tuple[float, float], distance: float, tilt: float, direction: float, roll: float
) -> np.ndarray:
    """(4, 4) X_SC of a camera that looks at a point of the sheet; angles in degrees."""
    turn = Rotation.from_euler("ZYX", [direction, tilt, 180.0], degrees=True)
    R_SC = (turn * Rotation.from_euler("z", roll, degrees=True)).as_matrix()
    X_SC = np.eye(4)
    X_SC[:3, :3], X_SC[:3, 3] = R_SC, np.array([*target, 0.0]) - distance * R_SC[:, 2]
    return X_SC


def error(X_SC: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """(6,) rotation [rad] and translation [m] in S from the true to an estimated pose."""
    turn = Rotation.from_matrix(X_SC[:3, :3] @ truth[:3, :3].T).as_rotvec()
    return np.r_[turn, X_SC[:3, 3] - truth[:3, 3]]
