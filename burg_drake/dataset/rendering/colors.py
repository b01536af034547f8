"""Colours of a view by Drake's renderer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    QueryObject,
    RenderCameraCore,
)
from pydrake.math import RigidTransform

from burg_drake.cameras.optics import FieldOfView, Intrinsics, camera_info
from burg_drake.core import Array, Bytes, InvalidInputError, Single

CLIPPING = 0.5
"""What is drawn begins at this share of the nearest depth, and ends at the inverse of it times the
farthest: what is not measured may still be seen."""
WIDEST = 4.0
"""Tangent of the widest angle to the optical axis that is drawn, 76 degrees; a lens that sees
further needs another renderer."""


Fill = Callable[[Bytes, Array, Intrinsics], Bytes]
"""From colours (H, W, 3), camera's optical frame in the world and intrinsics to colours."""


class DrakeColors:
    """Renders colours from any place.

    Args:
        query: of the diagram's scene graph, in a context.
        world: its world frame.
        renderer: name of the render engine.
        fill: puts what is behind everything into its images, if anything.
    """

    def __init__(
        self, query: QueryObject, world: Any, renderer: str, fill: Fill | None = None
    ) -> None:
        self._query, self._world, self._renderer, self._fill = query, world, renderer, fill

    def image(self, intrinsics: Intrinsics, X_WC: Array, depth_range: tuple[float, float]) -> Bytes:
        """(H, W, 3) what a camera at `X_WC` sees. A lens with distortion is a pinhole camera that
        sees all that it sees, with pixels as fine, looked up where its pixels look.

        Raises:
            InvalidInputError: it sees nearly to its sides.
        """
        if intrinsics.is_pinhole:
            return self._pinhole(intrinsics, X_WC, depth_range)
        wide, at = covering(intrinsics)
        image = self._pinhole(wide, X_WC, depth_range)
        return np.asarray(cv2.remap(image, at, None, cv2.INTER_LINEAR), np.uint8)

    def _pinhole(
        self, intrinsics: Intrinsics, X_WC: Array, depth_range: tuple[float, float]
    ) -> Bytes:
        near, far = depth_range
        core = RenderCameraCore(
            self._renderer,
            camera_info(intrinsics),
            ClippingRange(CLIPPING * near, far / CLIPPING),
            RigidTransform(),
        )
        camera = ColorRenderCamera(core, False)
        image = self._query.RenderColorImage(camera, self._world, RigidTransform(X_WC))
        colors = np.asarray(cv2.cvtColor(image.data, cv2.COLOR_RGBA2RGB), np.uint8)
        return colors if self._fill is None else self._fill(colors, X_WC, intrinsics)


@lru_cache(maxsize=8)
def _covering_of(key: tuple[Any, ...]) -> tuple[Intrinsics, Single]:
    width, height, focal, center, distortion = key
    intrinsics = Intrinsics(
        width=width, height=height, focal=focal, center=center, distortion=distortion
    )
    flat = FieldOfView(intrinsics).directions[..., :2]
    low, high = flat.min(axis=(0, 1)), flat.max(axis=(0, 1))
    if max(np.abs(low).max(), np.abs(high).max()) > WIDEST:
        raise InvalidInputError(
            f"the lens sees more than {np.degrees(np.arctan(WIDEST)):.0f} degrees from its axis;"
            " colour images of this camera cannot be rendered"
        )
    start = np.floor(low * focal) - 1.0
    size = (np.ceil(high * focal) + 1.0 - start).astype(int) + 1
    wide = replace(
        intrinsics,
        width=int(size[0]),
        height=int(size[1]),
        center=(-start[0], -start[1]),
        distortion=(),
    )
    return wide, (flat * focal - start).astype(np.float32)


def covering(intrinsics: Intrinsics) -> tuple[Intrinsics, Single]:
    """A pinhole camera that sees all that one with distortion sees, and (H, W, 2) where the pixels
    of that one are in its image."""
    one = intrinsics
    return _covering_of((one.width, one.height, one.focal, one.center, one.distortion))
