"""What is behind everything that is rendered: put into images where nothing else is."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from burg_drake.cameras.optics import FieldOfView, Intrinsics
from burg_drake.core import Array, Bytes
from burg_drake.dataset.appearance.appearance import Appearance
from burg_drake.dataset.appearance.room import environment_map, pixels_of

NOWHERE = (255, 0, 254)
"""What the renderer of an appearance puts where nothing is: a colour that nothing else has."""
GREY = 150
"""Where no room is."""
KEPT = 4
"""Rooms and cameras that are kept for the next image."""


def with_background(color: Bytes, X_WC: Array, intrinsics: Intrinsics, look: Appearance) -> Bytes:
    """An image with the room where the renderer has found nothing.

    Args:
        color: (H, W, 3) of the renderer that `apply_appearance` adds, as it is.
        X_WC: (4, 4) the camera's optical frame in the world.
        intrinsics: of the camera.
        look: has the room.

    Returns:
        (H, W, 3) sRGB; the same array if nothing is to be filled.
    """
    nothing = (color == NOWHERE).all(axis=2)
    if not nothing.any():
        return color
    filled = color.copy()
    if look.room is None:
        filled[nothing] = GREY
        return filled
    d_W = _rays(intrinsics)[nothing] @ X_WC[:3, :3].T
    at = pixels_of(d_W).astype(np.float32)[None]
    room = _room(look.room)
    filled[nothing] = _looked_up(room, at)
    return filled


def _looked_up(room: Bytes, at: Array) -> Bytes:
    """(N, 3) colours at columns and rows (1, N, 2), in parts that OpenCV can take."""
    most = (1 << 15) - 2
    parts = [
        cv2.remap(room, at[:, k : k + most], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        for k in range(0, at.shape[1], most)
    ]
    return np.asarray(np.concatenate(parts, axis=1)[0])


@lru_cache(maxsize=KEPT)
def _room(seed: int) -> Bytes:
    return environment_map(seed)


@lru_cache(maxsize=KEPT)
def _rays(intrinsics: Intrinsics) -> Array:
    """(H, W, 3) unit vectors in the camera's frame."""
    along = FieldOfView(intrinsics).directions
    unit: Array = along / np.linalg.norm(along, axis=2, keepdims=True)
    return unit
