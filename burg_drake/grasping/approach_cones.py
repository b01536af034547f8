"""Allowed approach directions of a hand as cones, and random approaches within them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, InvalidInputError, wrap_to_pi


@dataclass(frozen=True)
class ApproachCone:
    """Directions within an angle of an axis.

    Attributes:
        axis: (3,) direction in the object frame, of any length but 0.
        angle: [rad], above 0; pi / 2 makes a half space, pi allows every direction.
    """

    axis: tuple[float, float, float]
    angle: float

    def __post_init__(self) -> None:
        axis = np.asarray(self.axis, float)
        if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
            raise InvalidInputError(
                f"axis of the approach cone is {self.axis}; give a direction of three numbers"
            )
        if not 0.0 < self.angle <= np.pi:
            raise InvalidInputError(
                f"angle of the approach cone is {self.angle}; give it in rad, above 0 to pi"
            )
        object.__setattr__(self, "axis", tuple(axis.tolist()))
        object.__setattr__(self, "angle", float(self.angle))

    def turns(self, u: Array, v: Array) -> tuple[Array, Array]:
        """The interval of angles t whose directions `cos(t) u + sin(t) v` lie in the cone.

        Args:
            u, v: (N, 3) unit vectors, perpendicular to each other.

        Returns:
            Middle and half length (N,) of the intervals [rad]; the half length is NaN where no
            direction in the plane of u and v lies in the cone.
        """
        x, y, z = np.asarray(self.axis, float) / np.linalg.norm(self.axis)
        along_u = u[:, 0] * x + u[:, 1] * y + u[:, 2] * z  # elementwise: the same bits in any batch
        along_v = v[:, 0] * x + v[:, 1] * y + v[:, 2] * z
        # In the plane the cosine to the axis is `highest * cos(t - middle)`.
        highest = np.hypot(along_u, along_v)
        with np.errstate(divide="ignore", invalid="ignore"):
            half = np.arccos(np.maximum(np.cos(self.angle) / highest, -1.0))
        return np.arctan2(along_v, along_u), half


def random_approach_angles(
    cones: Sequence[ApproachCone], u: Array, v: Array, approaches: int, rng: np.random.Generator
) -> Array:
    """Random angles t whose directions `cos(t) u + sin(t) v` lie in all cones.

    The first angle is uniform among the allowed ones; the others follow at even spacing within the
    allowed angles. All (N, approaches) take N random numbers.

    Args:
        cones: every direction is allowed if empty.
        u, v: (N, 3) unit vectors, perpendicular to each other.
        approaches: number of angles for each pair of u and v.
        rng: random numbers.

    Returns:
        (N, approaches) [rad]; NaN where no direction in the plane of u and v is allowed.
    """
    first, step = rng.random((len(u), 1)), np.arange(approaches) / approaches
    if not cones:
        return 2.0 * np.pi * first + 2.0 * np.pi * step
    share = (first + step) % 1.0
    if len(cones) > 1:
        return _angles_in_all(cones, u, v, share)
    middle, half = cones[0].turns(u, v)
    return middle[:, None] + half[:, None] * (2.0 * share - 1.0)


def _angles_in_all(cones: Sequence[ApproachCone], u: Array, v: Array, share: Array) -> Array:
    """Quantiles (N, K) [rad] of the angles that all cones allow, at shares (N, K).

    The ends of the other cones' intervals cut the first cone's interval into pieces; a piece is
    allowed if its middle is.
    """
    middle, half = cones[0].turns(u, v)
    others = [cone.turns(u, v) for cone in cones[1:]]
    ends = [wrap_to_pi(m + sign * h - middle) for m, h in others for sign in (-1.0, 1.0)]
    inside = [np.clip(end, -half, half) for end in ends]
    cut = np.sort(np.stack([-half, *inside, half], axis=1), axis=1)
    center = middle[:, None] + 0.5 * (cut[:, 1:] + cut[:, :-1])
    length = np.diff(cut, axis=1)
    for m, h in others:  # NaN where the cone allows nothing: no piece is allowed
        length = np.where(np.abs(wrap_to_pi(center - m[:, None])) <= h[:, None], length, 0.0)
    below = np.cumsum(length, axis=1)
    target = share * below[:, -1:]
    piece = (below[:, None, :] <= target[..., None]).sum(axis=2)
    last = length.shape[1] - 1 - (length[:, ::-1] > 0.0).argmax(axis=1)
    piece = np.minimum(piece, last[:, None])  # where a share near 1 was rounded up
    start = np.take_along_axis(cut[:, :-1] - (below - length), piece, axis=1)
    any_allowed = below[:, -1:] > 0.0  # False for NaN
    return np.where(any_allowed, middle[:, None] + start + target, np.nan)
