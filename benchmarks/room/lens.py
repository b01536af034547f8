"""The camera's lens: pinhole with the distortion of Brown and Conrady or a rational one, or a
fisheye by the closed forms of optics."""

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
        coefficients: k1, k2, p1, p2, k3 of Brown (1966), in OpenCV's order, and k4, k5, k6 of a
            polynomial that divides the radial one.
    """

    size: tuple[int, int]
    focal: tuple[float, float]
    center: tuple[float, float]
    coefficients: tuple[float, ...] = (0.0,) * 5

    def project(self, p_C: Array) -> Array:
        """(..., 2) pixels of points (..., 3) in the optical frame [m]."""
        xy = self.bent(p_C[..., :2] / p_C[..., 2:])
        return xy * self.focal + self.center

    def bent(self, xy: Array) -> Array:
        """(..., 2) where the lens puts directions (x/z, y/z)."""
        k1, k2, p1, p2, k3, k4, k5, k6 = (*self.coefficients, 0.0, 0.0, 0.0)[:8]
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        radial = radial / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
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


FARTHEST = np.radians(87.0)
"""From the axis of a fisheye; pixels beyond look there."""
PROJECTIONS = {
    "equidistant": (lambda angle: angle, lambda r: r),
    "equisolid": (
        lambda angle: 2 * np.sin(angle / 2),
        lambda r: 2 * np.arcsin(np.minimum(r / 2, 1.0)),
    ),
    "stereographic": (lambda angle: 2 * np.tan(angle / 2), lambda r: 2 * np.arctan(r / 2)),
}
"""How far from the middle, in focal lengths, an angle off the axis is seen, and the inverse."""


@dataclass(frozen=True)
class Fisheye(Camera):
    """A camera with a fisheye.

    Attributes:
        projection: of `PROJECTIONS`.
    """

    projection: str = "equisolid"

    def project(self, p_C: Array) -> Array:
        """As of any camera; points may be beside it."""
        aside = np.linalg.norm(p_C[..., :2], axis=-1)
        r = PROJECTIONS[self.projection][0](np.arctan2(aside, p_C[..., 2]))
        return p_C[..., :2] * (r / np.maximum(aside, 1e-12))[..., None] * self.focal + self.center

    def angles(self, pixels: Array) -> Array:
        """(...,) off the axis [rad] at which pixels look."""
        r = np.linalg.norm((pixels - np.array(self.center)) / self.focal, axis=-1)
        return PROJECTIONS[self.projection][1](r)

    def directions(self, pixels: Array) -> Array:
        """As of any camera, `FARTHEST` at most."""
        bent = (pixels - np.array(self.center)) / self.focal
        slope = np.tan(np.minimum(self.angles(pixels), FARTHEST))
        return bent * (slope / np.maximum(np.linalg.norm(bent, axis=-1), 1e-12))[..., None]


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
