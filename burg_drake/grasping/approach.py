"""The cone of directions from which a hand may approach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.frames import Array


@dataclass(frozen=True)
class ApproachCone:
    """Directions within an angle of an axis.

    Attributes:
        axis: (3,) direction in the object frame, of any length but 0.
        angle: [rad], above 0; pi allows every direction.
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
        """The turns t of directions `cos(t) u + sin(t) v` that lie in the cone: one interval.

        Args:
            u, v: (N, 3) unit vectors, perpendicular to each other.

        Returns:
            Middle and half length (N,) of the intervals [rad]; the half length is NaN where no
            direction in the plane of u and v lies in the cone.
        """
        axis = np.asarray(self.axis, float) / np.linalg.norm(self.axis)
        along_u, along_v = u @ axis, v @ axis
        # In the plane the cosine to the axis is `highest * cos(t - middle)`.
        highest = np.hypot(along_u, along_v)
        with np.errstate(divide="ignore", invalid="ignore"):
            half = np.arccos(np.maximum(np.cos(self.angle) / highest, -1.0))
        return np.arctan2(along_v, along_u), half
