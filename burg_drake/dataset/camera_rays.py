"""Rays through the centres of a camera's pixels, cached for its next image."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, lru_cache

import numpy as np

from burg_drake.cameras import FieldOfView, Intrinsics
from burg_drake.core import Array, InvalidInputError, Single
from burg_drake.dataset.sample import box_of_mask

PixelBox = tuple[int, int, int, int]
"""Rectangle of pixels: left, top, right, bottom, the last two exclusive. May exceed the image."""


class CameraRays(FieldOfView):
    """A camera's field of view, with its rays in the forms that rendering needs."""

    @cached_property
    def single(self) -> Single:
        """(H, W, 3) `directions` in single precision."""
        return self.directions.astype(np.float32)

    @cached_property
    def unit(self) -> Array:
        """(H, W, 3) unit vectors along `directions`."""
        return np.asarray(self.directions / np.linalg.norm(self.directions, axis=2, keepdims=True))

    @cached_property
    def slopes(self) -> tuple[Single, Single]:
        """x / z and y / z of the rays: (1, W) and (H, 1) without distortion, else (H, W) each."""
        x, y = self.directions[..., 0], self.directions[..., 1]
        if self.intrinsics.is_pinhole:
            x, y = x[:1], y[:, :1]
        return x.astype(np.float32), y.astype(np.float32)

    def unit_in(self, pixels: PixelBox) -> Single:
        """(N, 3) unit vectors through the pixels of a rectangle, row by row. Without distortion, it
        may exceed the image."""
        left, top, right, bottom = pixels
        if not self.intrinsics.is_pinhole:
            return self.unit[top:bottom, left:right].astype(np.float32).reshape(-1, 3)
        (fx, fy), (cx, cy) = self.intrinsics.focal, self.intrinsics.center
        x = (np.arange(left, right, dtype=float) - cx) / fx
        y = (np.arange(top, bottom, dtype=float)[:, None] - cy) / fy
        length = np.sqrt(x * x + y * y + 1.0)
        unit = np.empty((*length.shape, 3), np.float32)
        for axis, along in enumerate((x, y, np.ones(1))):
            np.divide(along, length, out=unit[..., axis], casting="same_kind")
        return unit.reshape(-1, 3)

    def pixel_box(self, lower: Array, upper: Array) -> PixelBox | None:
        """Rectangle of the image's pixels within bounds (2,) of x / z and y / z; None if empty."""
        x, y = self.slopes
        inside = (x >= lower[0]) & (x <= upper[0]) & (y >= lower[1]) & (y <= upper[1])
        box = box_of_mask(inside)
        return None if box is None else (box[0], box[1], box[0] + box[2], box[1] + box[3])

    @cached_property
    def covering_pinhole(self) -> tuple[Intrinsics, Single]:
        """A pinhole camera that covers the field of view of this camera with distortion, and the
        positions (H, W, 2) of this camera's pixels in its image.

        Raises:
            InvalidInputError: the field of view is too wide.
        """
        max_tangent = 4.0  # Tangent of the largest angle to the optical axis: 76 degrees.
        flat, focal = self.directions[..., :2], self.intrinsics.focal
        low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
        if max(np.abs(low).max(), np.abs(high).max()) > max_tangent:
            raise InvalidInputError(
                f"the lens sees more than {np.degrees(np.arctan(max_tangent)):.0f} degrees from its"
                " axis; colour images of this camera cannot be rendered"
            )
        start = np.floor(low * focal) - 1.0
        width, height = (np.ceil(high * focal) + 1.0 - start).astype(int).tolist()
        wide = replace(
            self.intrinsics,
            width=width + 1,
            height=height + 1,
            center=(-start[0], -start[1]),
            distortion=(),
        )
        return wide, (flat * focal - start).astype(np.float32)


@lru_cache(maxsize=8)
def camera_rays(intrinsics: Intrinsics) -> CameraRays:
    """The rays of a camera; cached, as those of a lens with distortion are slow to compute."""
    return CameraRays(intrinsics)
