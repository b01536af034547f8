"""The camera's lens: pinhole and the distortion of Brown and Conrady."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Camera:
    """A camera.

    Attributes:
        size: width and height [pixels].
        focal: along u and v [pixels].
        center: principal point [pixels]; the middle of the upper left pixel is (0, 0).
        coefficients: k1, k2, p1, p2, k3 of Brown (1966), in OpenCV's order.
    """

    size: tuple[int, int]
    focal: tuple[float, float]
    center: tuple[float, float]
    coefficients: tuple[float, float, float, float, float] = (0.0,) * 5

    def project(self, p_C: Array) -> Array:
        """(..., 2) pixels of points (..., 3) in the optical frame [m]."""
        xy = self.bent(p_C[..., :2] / p_C[..., 2:])
        return xy * self.focal + self.center

    def bent(self, xy: Array) -> Array:
        """(..., 2) where the lens puts directions (x/z, y/z)."""
        k1, k2, p1, p2, k3 = self.coefficients
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.stack(
            [
                x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
            ],
            axis=-1,
        )

    def directions(self, pixels: Array) -> Array:
        """(..., 2) directions (x/z, y/z) that the lens puts at pixels, by fixed-point iteration."""
        bent = (pixels - np.array(self.center)) / self.focal
        xy = bent
        for _ in range(100):
            last, xy = xy, xy + (bent - self.bent(xy))
            if np.abs(xy - last).max() < 1e-13:
                break
        return xy


@lru_cache(maxsize=4)
def corner_directions(camera: Camera) -> Array:
    """(H + 1, W + 1, 2) directions of the corners of all pixels."""
    width, height = camera.size
    u, v = np.meshgrid(np.arange(width + 1) - 0.5, np.arange(height + 1) - 0.5)
    return camera.directions(np.stack([u, v], axis=-1))


SMALL = Camera((640, 480), (615.0, 617.0), (322.0, 237.5), (0.06, -0.12, 6e-4, -8e-4, 0.0))
LARGE = Camera((1280, 720), (920.0, 922.0), (643.0, 356.0), (0.06, -0.12, 6e-4, -8e-4, 0.0))
CAMERAS = {f"{c.size[0]}x{c.size[1]}": c for c in (SMALL, LARGE)}
"""Both with the mild distortion of a webcam."""
