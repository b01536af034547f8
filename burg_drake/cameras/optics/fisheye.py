"""The fisheye lens of Kannala and Brandt: how far off the middle an angle off the axis is seen.

r = a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8), with the angle a [rad] and r in focal lengths, as in
`cv2.fisheye` and in ROS's `equidistant`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.polynomial import Polynomial

from burg_drake.core import Array

COEFFICIENTS = 4
WIDEST = np.radians(87.0)
"""An image without distortion ends there: beside the axis by 19 focal lengths, and at 90 degrees
infinitely far."""
STEPS = 512
"""Of the table that begins the inversion; Newton's steps from it end at rounding errors."""
NEWTON_STEPS = 4


@dataclass(frozen=True)
class FisheyeLens:
    """A lens.

    Attributes:
        coefficients: k1, k2, k3, k4.
    """

    coefficients: tuple[float, float, float, float]

    @cached_property
    def _radius(self) -> Polynomial:
        return Polynomial(np.insert(np.r_[1.0, self.coefficients], range(5), 0.0))

    @cached_property
    def _slope(self) -> Polynomial:
        return self._radius.deriv()

    @cached_property
    def turn(self) -> float:
        """Angle at which the polynomial leads back to the middle, or pi [rad]. Beyond, the image
        goes on at one focal length a radian, so that nothing from there is put into it."""
        roots = self._slope.roots()
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)]
        return float(min(real.min(initial=np.pi), np.pi))

    def radius(self, angle: Array) -> Array:
        """Distances from the middle, in focal lengths, of angles off the axis [rad]."""
        within = np.minimum(angle, self.turn)
        return np.asarray(self._radius(within) + (angle - within))

    def slope(self, angle: Array) -> Array:
        """Derivatives of `radius` by the angle."""
        return np.where(angle < self.turn, self._slope(np.minimum(angle, self.turn)), 1.0)

    def angle(self, radius: Array) -> Array:
        """Angles off the axis [rad] that are seen at distances from the middle; pi beyond."""
        table = np.linspace(0.0, self.turn, STEPS)
        end = float(self._radius(self.turn))
        inner = np.minimum(radius, end)
        angle = np.interp(inner, self._radius(table), table)
        for _ in range(NEWTON_STEPS):
            slope = np.maximum(self._slope(angle), 1e-6)
            angle = np.clip(angle - (self._radius(angle) - inner) / slope, 0.0, self.turn)
        return np.minimum(angle + (radius - inner), np.pi)

    def bent(self, p_CQ: Array) -> Array:
        """(..., 2) where points (..., 3) in the camera's frame are seen, in focal lengths."""
        aside = np.linalg.norm(p_CQ[..., :2], axis=-1)
        radius = self.radius(np.arctan2(aside, p_CQ[..., 2]))
        # On the axis all directions are alike: ahead the radius is 0, behind any is outside.
        toward = p_CQ[..., :2] / np.maximum(aside, 1e-300)[..., None]
        toward = np.where((aside == 0.0)[..., None], [1.0, 0.0], toward)
        return np.asarray(toward * radius[..., None])

    def rays(self, bent: Array) -> Array:
        """(..., 3) unit vectors of what is seen at (..., 2), in focal lengths from the middle."""
        radius = np.linalg.norm(bent, axis=-1)
        angle = self.angle(radius)
        aside = np.sin(angle) / np.maximum(radius, 1e-300)
        return np.concatenate([bent * aside[..., None], np.cos(angle)[..., None]], axis=-1)

    def straightened(self, bent: Array) -> Array:
        """(..., 2) the same as by a lens without distortion; what is further off the axis than
        `WIDEST`, there."""
        radius = np.linalg.norm(bent, axis=-1)
        straight = np.tan(np.minimum(self.angle(radius), WIDEST))
        scale = np.where(radius > 0.0, straight / np.maximum(radius, 1e-300), 1.0)
        return np.asarray(bent * scale[..., None])


@lru_cache(maxsize=16)
def fisheye_lens(coefficients: tuple[float, ...]) -> FisheyeLens:
    """The lens with four coefficients."""
    k1, k2, k3, k4 = coefficients
    return FisheyeLens((k1, k2, k3, k4))
