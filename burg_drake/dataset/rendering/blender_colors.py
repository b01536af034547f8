"""Colours of a view by Blender."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, Bytes
from burg_drake.dataset.appearance import Appearance, over_background
from burg_drake.dataset.blender import BlenderScene, blender
from burg_drake.dataset.rendering.colors import CLIPPING, covering


class BlenderColors:
    """Renders colours from any place.

    Args:
        scene: what there is.
        poses: gives `X_WB` (4, 4) of its bodies, as they are now.
        look: has what is behind everything.
    """

    def __init__(
        self,
        scene: BlenderScene,
        poses: Callable[[], Mapping[str, Array]],
        look: Appearance | None = None,
    ) -> None:
        self._scene, self._poses, self._look = scene, poses, look

    def image(self, intrinsics: Intrinsics, X_WC: Array, depth_range: tuple[float, float]) -> Bytes:
        """(H, W, 3) what a camera at `X_WC` sees; a lens with distortion as `DrakeColors` has it.

        Raises:
            InvalidInputError: it sees nearly to its sides.
            MissingDependencyError: there is no Blender.
            SimulationError: Blender failed.
        """
        if intrinsics.is_pinhole:
            return self._pinhole(intrinsics, X_WC, depth_range)
        import cv2

        wide, at = covering(intrinsics)
        image = self._pinhole(wide, X_WC, depth_range)
        return np.asarray(cv2.remap(image, at, None, cv2.INTER_LINEAR), np.uint8)

    def _pinhole(
        self, intrinsics: Intrinsics, X_WC: Array, depth_range: tuple[float, float]
    ) -> Bytes:
        near, far = depth_range
        clip = (CLIPPING * near, far / CLIPPING)
        image = blender().image(self._scene, self._poses(), intrinsics, X_WC, clip)
        return over_background(image, X_WC, intrinsics, self._look)
