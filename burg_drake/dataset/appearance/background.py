"""What is behind everything that is rendered: put into images where nothing else is."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from burg_drake.cameras.optics import FieldOfView, Intrinsics
from burg_drake.core import Array, Booleans, Bytes
from burg_drake.dataset.appearance.appearance import Appearance
from burg_drake.dataset.appearance.photometry import linear_from_srgb, srgb_from_linear
from burg_drake.dataset.appearance.room import environment_map, pixels_of

NOWHERE = (255, 0, 254)
"""What the renderer of an appearance puts where nothing is: a colour that nothing else has."""
GREY = 150
"""Where no room is."""
SKY = (204, 229, 255)
"""Where no appearance is, as behind simulated cameras' images."""
KEPT = 4
"""Cameras that are kept for the next image."""


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
    edge = cv2.dilate(nothing.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & ~nothing
    seen_behind = nothing | edge
    behind = _behind(seen_behind, X_WC, intrinsics, look)
    filled = np.where(nothing[..., None], behind, color)
    filled[edge] = _unmixed(color, nothing, edge, behind)
    return filled


def over_background(
    color: Bytes, X_WC: Array, intrinsics: Intrinsics, look: Appearance | None
) -> Bytes:
    """An image with the room where the renderer has found nothing, mixed in linear light.

    Args:
        color: (H, W, 4) sRGB, and the share of each pixel that anything is in, which colours are
            not multiplied by.
        X_WC: (4, 4) the camera's optical frame in the world.
        intrinsics: of the camera.
        look: has the room; None for the sky of simulated cameras.

    Returns:
        (H, W, 3) sRGB.
    """
    found, share = color[..., :3].copy(), color[..., 3]
    mixed = share < 255
    if mixed.any():
        behind = _behind(mixed, X_WC, intrinsics, look)[mixed]
        part = share[mixed, None] / 255.0
        before = linear_from_srgb(found[mixed] / 255.0)
        light = part * before + (1.0 - part) * linear_from_srgb(behind / 255.0)
        found[mixed] = srgb_from_linear(light) * 255.0 + 0.5
    return found


def _behind(where: Booleans, X_WC: Array, intrinsics: Intrinsics, look: Appearance | None) -> Bytes:
    """(H, W, 3) what is behind everything, in pixels of the mask `where`."""
    behind = np.empty((*where.shape, 3), np.uint8)
    behind[:] = SKY if look is None else GREY
    if look is not None and look.room is not None:
        d_W = _rays(intrinsics)[where] @ X_WC[:3, :3].T
        behind[where] = _looked_up(environment_map(look.room), pixels_of(d_W))
    return behind


def _unmixed(color: Bytes, nothing: Booleans, edge: Booleans, behind: Bytes) -> Bytes:
    """(N, 3) pixels of edges, which the renderer has mixed with `NOWHERE`, mixed with what is
    behind instead.

    The share of `NOWHERE` in a pixel follows from how much more red and blue it has than green,
    compared with pixels around it that are not mixed.
    """
    solid = (~nothing & ~edge).astype(np.float32)
    excess = color[..., [0, 2]].astype(np.float32).mean(axis=2) - color[..., 1]
    around = cv2.boxFilter(solid, -1, (5, 5), normalize=False)[edge]
    total = cv2.boxFilter(excess * solid, -1, (5, 5), normalize=False)[edge]
    inside = total / np.maximum(around, 1.0)
    most = 0.5 * (NOWHERE[0] + NOWHERE[2]) - NOWHERE[1]
    share = np.clip((excess[edge] - inside) / (most - inside), 0.0, 1.0)[:, None]
    mixed = color[edge] + share * (behind[edge].astype(np.float32) - np.array(NOWHERE, np.float32))
    return np.asarray(np.clip(mixed + 0.5, 0.0, 255.0), dtype=np.uint8)


def _looked_up(room: Bytes, pixels: Array) -> Bytes:
    """(N, 3) colours at columns and rows (N, 2), in parts that OpenCV can take."""
    at = pixels.astype(np.float32)[None]
    most = (1 << 15) - 2
    parts = [
        cv2.remap(room, at[:, k : k + most], None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        for k in range(0, at.shape[1], most)
    ]
    return np.asarray(np.concatenate(parts, axis=1)[0])


@lru_cache(maxsize=KEPT)
def _rays(intrinsics: Intrinsics) -> Array:
    """(H, W, 3) unit vectors in the camera's frame."""
    along = FieldOfView(intrinsics).directions
    unit: Array = along / np.linalg.norm(along, axis=2, keepdims=True)
    return unit
