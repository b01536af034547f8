"""What is printed on the sheet, as the camera sees it: ink, white frames and tints."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, photo_light
from burg_drake.printout import frame_width
from burg_drake.scene.document import Board

TEXELS = 4000.0
"""Of the picture of the sheet, per metre: 22 for a cell of the default markers."""
FINER = 3
"""Pixels that are looked up in it for each of the photo, each way."""


def projected_print(
    board: Board, H_pixel_S: Array, size: tuple[int, int]
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """(H, W) shares of ink and of markers' white frames in each pixel, and which pixels the sheet
    fills."""
    rows, columns = (round(s * TEXELS) for s in board.size[::-1])
    texture = np.zeros((rows, columns), np.float32)
    frames = np.zeros((rows, columns), np.uint8)
    layout = board.layout
    wide = frame_width(layout) * TEXELS
    for corners, black in zip(layout.p_SQ, layout.black, strict=True):
        x, y = corners[0, 0] * TEXELS, rows - corners[0, 1] * TEXELS
        step = layout.side / layout.cells * TEXELS
        ends = (x, y), (x + layout.cells * step, y + layout.cells * step)
        for edge, level in ((wide, 1), (0.0, 0)):
            first, last = (
                np.round(np.add(end, side * edge)).astype(int).tolist()
                for end, side in zip(ends, (-1, 1), strict=True)
            )
            frames[max(first[1], 0) : last[1], max(first[0], 0) : last[0]] = level
        left, top = int(x), int(y)
        n = int(np.ceil(layout.cells * step)) + 2
        across, down = (_cover(start, step, layout.cells, n) for start in (x - left, y - top))
        patch = down.T @ black @ across
        target = texture[max(top, 0) : top + n, max(left, 0) : left + n]
        target += patch[: target.shape[0], : target.shape[1]].astype(np.float32)
    # from texels of the sheet, centres at integers, to pixels of a finer photo
    H_S_texel = np.array([[1.0, 0.0, 0.5], [0.0, -1.0, rows - 0.5], [0.0, 0.0, TEXELS]]) / TEXELS
    H_fine_pixel = np.array(
        [[FINER, 0.0, (FINER - 1) / 2], [0.0, FINER, (FINER - 1) / 2], [0.0, 0.0, 1.0]]
    )
    H = H_fine_pixel @ H_pixel_S @ H_S_texel
    fine = (FINER * size[0], FINER * size[1])
    ink = cv2.warpPerspective(texture, H, fine, flags=cv2.INTER_LINEAR)
    white = cv2.warpPerspective(frames.astype(np.float32), H, fine, flags=cv2.INTER_LINEAR)
    white = cv2.resize(white, size, interpolation=cv2.INTER_AREA)
    full = cv2.warpPerspective(np.ones_like(texture), H, fine, flags=cv2.INTER_NEAREST)
    ink = cv2.resize(ink, size, interpolation=cv2.INTER_AREA).astype(float)
    return ink, white, cv2.resize(full, size, interpolation=cv2.INTER_AREA) > 0.999


def projected_tints(
    board: Board, tints: NDArray[np.uint8] | None, H_pixel_S: Array, size: tuple[int, int]
) -> NDArray[np.float32]:
    """(H, W, 3) reflectance of what may be tinted, over that of paper."""
    if tints is None:
        return np.ones((*size[::-1], 3), np.float32)
    rows, columns = tints.shape[:2]
    x, y = board.size[0] / columns, board.size[1] / rows
    H_S_texel = np.array([[x, 0, x / 2], [0, -y, board.size[1] - y / 2], [0, 0, 1]])
    return np.asarray(
        cv2.warpPerspective(
            photo_light(tints),
            H_pixel_S @ H_S_texel,
            size,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=(1.0, 1.0, 1.0),
        )
    )


def _cover(start: float, step: float, cells: int, n: int) -> Array:
    """(cells, n) share of each of `n` texels that lies in each cell of a row."""
    low = start + step * np.arange(cells)[:, None]
    texel = np.arange(n)
    cover: Array = np.minimum(low + step, texel + 1) - np.maximum(low, texel)
    return cover.clip(0.0, 1.0)


def places_on_sheet(H_pixel_S: Array, size: tuple[int, int], sheet: tuple[float, float]) -> Array:
    """(H, W, 2) where on the sheet each pixel looks, from -1 to 1 each way."""
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    p = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(H_pixel_S).T
    places: Array = p[..., :2] / p[..., 2:] / np.array(sheet) * 2.0 - 1.0
    return places.clip(-2.0, 2.0)
