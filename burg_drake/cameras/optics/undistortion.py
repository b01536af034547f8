"""Images as the same camera would take them without lens distortion."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics.intrinsics import Intrinsics


class Undistortion:
    """Straightens the images of one camera; of a pinhole camera they stay as they are.

    Args:
        intrinsics: of the camera; those of the straightened images have the same `K`. They show
            less than the camera sees where its edges look far aside: the width over the focal
            length decides, and of any fisheye it is less than 180 degrees. One of 1280 pixels, 430
            a radian, sees 170 degrees across and keeps the middle 112.
    """

    def __init__(self, intrinsics: Intrinsics) -> None:
        self._map = None
        if not intrinsics.is_pinhole:
            u, v = np.arange(intrinsics.width), np.arange(intrinsics.height)
            grid = np.stack(np.meshgrid(u, v), axis=-1)
            flat = (grid - intrinsics.center) / intrinsics.focal
            rays = np.concatenate([flat, np.ones((*flat.shape[:2], 1))], axis=-1)
            at = intrinsics.project(rays).astype(np.float32)
            self._map = at[..., 0].copy(), at[..., 1].copy()

    def color(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """(H, W, 3); black beyond the given image."""
        if self._map is None:
            return image
        return np.asarray(cv2.remap(image, *self._map, cv2.INTER_CUBIC))

    def depth(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """(H, W); of the nearest pixel, as distances across an edge have no mean; 0 beyond."""
        if self._map is None:
            return depth
        return np.asarray(cv2.remap(depth, *self._map, cv2.INTER_NEAREST))
