"""What a camera with lens distortion can see: rays of its pixels, and which points it projects."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics.intrinsics import Intrinsics
from burg_drake.core import Array

NEAR = 0.01
"""What is nearer to the camera than this is not drawn [m]."""
MARGIN = 0.05
"""How far beyond the image's edge points are projected, as a share of its width and height; far
outside, a lens model leads back into the image."""


class FieldOfView:
    """A camera's field of view.

    Attributes:
        intrinsics: of the camera.
    """

    def __init__(self, intrinsics: Intrinsics) -> None:
        self.intrinsics = intrinsics

    @cached_property
    def directions(self) -> Array:
        """(H, W, 3) where the centre of each pixel looks, in the camera's frame, at z = 1; at most
        87 degrees off the axis of a fisheye."""
        width, height = self.intrinsics.width, self.intrinsics.height
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
        flat = (self.intrinsics.undistort(grid) - self.intrinsics.center) / self.intrinsics.focal
        return np.concatenate([flat, np.ones((height, width, 1))], axis=-1)

    @cached_property
    def _field(self) -> tuple[Array, Array]:
        """Least and largest x / z and y / z that are in view, with the margin."""
        border = np.concatenate(
            [self.directions[[0, -1]].reshape(-1, 3), self.directions[:, [0, -1]].reshape(-1, 3)]
        )[:, :2]
        lower, upper = border.min(axis=0), border.max(axis=0)
        return lower - MARGIN * (upper - lower), upper + MARGIN * (upper - lower)

    def sees(self, p_CQ: Array) -> NDArray[np.bool_]:
        """(...) whether points (..., 3) lie before the camera and in its field of view, or barely
        outside; only such may be projected."""
        lower, upper = self._field
        depth = p_CQ[..., 2:]
        beside = (p_CQ[..., :2] < lower * depth) | (p_CQ[..., :2] > upper * depth)
        return np.asarray((depth[..., 0] >= NEAR) & ~beside.any(axis=-1))
