"""Where the camera is, and how it moves while it exposes."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from .lens import Camera
from .paper import Array


def look_at(target: Array, distance: float, tilt: float, direction: float, roll: float) -> Array:
    """(4, 4) `X_SC` of a camera that looks at a point.

    Args:
        target: (2,) on the table [m].
        distance: from it [m].
        tilt: of the view off the vertical [rad].
        direction: of the tilt around z [rad].
        roll: around the view [rad].
    """
    R = Rotation.from_euler("ZYZ", [direction, tilt, 0.0]).as_matrix() @ np.diag([1.0, -1.0, -1.0])
    R = R @ Rotation.from_euler("z", roll).as_matrix()
    X_SC = np.eye(4)
    X_SC[:3, :3] = R
    X_SC[:3, 3] = np.r_[target, 0.0] - distance * R[:, 2]
    return X_SC


def random_view(rng: np.random.Generator, size: tuple[float, float]) -> Array:
    """From 0.4 to 1 m, up to 60 degrees off the vertical, at somewhere about the board's middle."""
    target = rng.uniform(0.3, 0.7, 2) * size
    direction, roll = rng.uniform(-np.pi, np.pi, 2)
    return look_at(target, rng.uniform(0.4, 1.0), np.radians(rng.uniform(0, 60)), direction, roll)


def seen_at(camera: Camera, X_SC: Array, p_S: Array) -> tuple[Array, Array]:
    """(..., 2) pixels of points (..., 3), and (...,) whether they are in the image."""
    p_C = (p_S - X_SC[:3, 3]) @ X_SC[:3, :3]
    ahead = p_C[..., 2] > 0.01
    pixels = camera.project(np.where(ahead[..., None], p_C, [0.0, 0.0, 1.0]))
    inside = ((pixels >= 0) & (pixels <= np.array(camera.size) - 1.0)).all(axis=-1)
    return pixels, ahead & inside


def moved(X_SC: Array, twist: Array, time: Array) -> Array:
    """(..., 4, 4) the camera at times (...,), 0 at `X_SC`, with a twist of its own frame: turn
    [rad] and shift [m] in a unit of time."""
    time = np.asarray(time, dtype=float)
    turns = Rotation.from_rotvec(time.reshape(-1, 1) * twist[:3]).as_matrix()
    X = np.tile(X_SC, (*time.shape, 1, 1))
    X[..., :3, :3] = X_SC[:3, :3] @ turns.reshape(*time.shape, 3, 3)
    X[..., :3, 3] += (time[..., None] * twist[3:]) @ X_SC[:3, :3].T
    return X


def shaken(
    camera: Camera, X_SC: Array, p_S: Array, pixels: float, rng: np.random.Generator
) -> Array:
    """(6,) a random twist with turns and shifts, which in a unit of time moves the points (N, 3)
    in the image by as many pixels (root mean square)."""
    middle = np.linalg.norm(p_S.mean(axis=0) - X_SC[:3, 3])
    twist = np.r_[rng.normal(size=3), 0.5 * middle * rng.normal(size=3)]
    twist *= pixels / camera.focal[0] / np.linalg.norm(twist[:3])
    for _ in range(10):
        start, _ = seen_at(camera, moved(X_SC, twist, np.array(-0.5)), p_S)
        end, _ = seen_at(camera, moved(X_SC, twist, np.array(0.5)), p_S)
        twist = twist * pixels / np.sqrt(((end - start) ** 2).sum(axis=-1).mean())
    return twist
