"""A picture of a live view: a frame with the scene drawn over it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.live.frame_processing import LocatedFrame, ViewSettings
from burg_drake.cameras.placement import PlacementCheck

JPEG_QUALITY = 88


@dataclass(frozen=True, eq=False, kw_only=True)
class Picture:
    """What the view shows.

    Attributes:
        number: counts pictures; changed settings make a new one of the same frame.
        located: the frame and its estimate.
        overlay: (H, W, 3) RGB.
        jpeg: the overlay, encoded.
        settings, placement: that it was drawn with.
        milliseconds: what stages took, by name.
    """

    number: int
    located: LocatedFrame
    overlay: NDArray[np.uint8]
    jpeg: bytes
    settings: ViewSettings
    placement: PlacementCheck | None
    milliseconds: dict[str, float]


def encode_jpeg(image: NDArray[np.uint8]) -> bytes:
    """JPEG of an RGB image (H, W, 3)."""
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    encoded: bytes = data.tobytes()
    return encoded
