"""Photos of a printed board that share nothing with the code that reads them: the pixels that
PDFium makes of the printout, seen by a pinhole camera with one coefficient of distortion."""

from __future__ import annotations

import functools

import cv2
import numpy as np

from burg_drake.printout import PrintSettings, print_board
from burg_drake.scene import load_scene
from tests.cameras.synthetic import levels, light_of
from tests.printout.paper import rasterised

DPI = 100
FINE = 2
"""Rays along x and y of a pixel."""
TABLE = 120.0


@functools.cache
def paper() -> np.ndarray:
    """(H, W) the board of `tabletop_six`, A2, without height map; 100 pixels an inch."""
    settings = PrintSettings(page="A2", height_map=False, names=False)
    (page,) = rasterised(print_board(load_scene("tabletop_six"), settings).pdf, DPI)
    return page


def shown_at(p_S: np.ndarray) -> np.ndarray:
    """(H, W) linear light [0 to 1] of points (H, W, 2) of the sheet [m]."""
    page = light_of(paper())
    column = p_S[..., 0] / 0.0254 * DPI - 0.5
    row = page.shape[0] - p_S[..., 1] / 0.0254 * DPI - 0.5
    at = column.astype(np.float32), row.astype(np.float32)
    return cv2.remap(
        page.astype(np.float32),
        *at,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=float(light_of(np.array(TABLE))),
    )


def photo(X_SC: np.ndarray, size: tuple[int, int], focal: float, bend: float = 0.0) -> np.ndarray:
    """(H, W, 3) of a camera with its principal point in the image's middle.

    Args:
        X_SC: (4, 4) optical frame in the scene frame.
        size: width and height [pixels].
        focal: [pixels].
        bend: OpenCV's k1.
    """
    width, height = size
    u = (np.arange(width * FINE) + 0.5) / FINE - 0.5
    v = (np.arange(height * FINE) + 0.5) / FINE - 0.5
    x, y = np.meshgrid((u - 0.5 * (width - 1)) / focal, (v - 0.5 * (height - 1)) / focal)
    straight_x, straight_y = x.copy(), y.copy()
    for _ in range(8 if bend else 0):  # undoes the bend by fixed-point iteration
        grow = 1.0 + bend * (straight_x**2 + straight_y**2)
        straight_x, straight_y = x / grow, y / grow
    rays_S = np.stack([straight_x, straight_y, np.ones_like(x)], axis=-1) @ X_SC[:3, :3].T
    depth = -X_SC[2, 3] / rays_S[..., 2]
    fine = shown_at((X_SC[:3, 3] + depth[..., None] * rays_S)[..., :2])
    mean = fine.reshape(height, FINE, width, FINE).mean(axis=(1, 3))
    return np.repeat(np.round(levels(mean)).astype(np.uint8)[..., None], 3, axis=2)
