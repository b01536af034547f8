"""What a photo would look like without objects: the known board, in the photo's own light.

Where the photo differs, something stands. Brightness of paper and ink are fitted, as smooth
functions of the place on the sheet, to the photo itself; what covers them are outliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array, inverse
from burg_drake.scene.document import Board

TEXELS = 4000.0
"""Of the picture of the sheet, per metre: 22 for a cell of the default markers."""
FINER = 3
"""Pixels that are looked up in it for each of the photo, each way."""
BLURS = (0.0, 0.4, 0.6, 0.8, 1.0, 1.3, 1.6, 2.0, 2.5)
"""Standard deviations of the photo's blur that are tried [pixels]."""
MIN_CONTRAST = 20.0
"""Least difference of paper and ink in which anything can be measured [8-bit levels]."""
TINT = 0.3
"""How much darker than paper something may be, in its colour, to be a shadow or the tinted height
map on the sheet, as a share of the difference of paper and ink."""
EXPLAINED = 0.12
"""Deviation from the empty board that light and noise explain, as such a share."""


@dataclass(frozen=True, eq=False)
class EmptyBoard:
    """The empty board as the camera would see it.

    Attributes:
        color: (H, W, 3) predicted levels; only meaningful on the `sheet`.
        sheet: (H, W) pixels that see nothing but the sheet, were it empty.
        evidence: (H, W) +1 where something stands, -1 where the board is seen, 0 where that cannot
            be told.
        contrast: paper less ink, mean over channels and sheet [8-bit levels].
        blur: of the photo [pixels].
        noise: standard deviation of the photo's noise [8-bit levels].
    """

    color: Array
    sheet: NDArray[np.bool_]
    evidence: Array
    contrast: float
    blur: float
    noise: float


def empty_board(
    board: Board, image: Array, K: Array, X_SC: Array, scale: tuple[float, float] = (1.0, 1.0)
) -> EmptyBoard | None:
    """Predicts the empty board.

    Args:
        board: its markers must fit on it.
        image: (H, W, 3) photo without lens distortion [8-bit levels].
        K: (3, 3) camera matrix.
        X_SC: (4, 4) camera in the scene frame.
        scale: size of the print against the document along x and y.

    Returns:
        None if there is no contrast of paper and ink in the photo.
    """
    size = image.shape[1], image.shape[0]
    H_pixel_S = K @ inverse(X_SC)[:3][:, [0, 1, 3]] @ np.diag([*scale, 1.0])  # of the document
    ink, sheet = _projected(board, H_pixel_S, size)
    p_S = _on_the_sheet(H_pixel_S, size, board.size)
    sheet = cv2.erode(sheet.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    levels = _levels(image, ink, sheet, p_S)
    if levels is None:
        return None
    white, black = levels
    contrast = float((white - black)[sheet].mean())
    if contrast < MIN_CONTRAST:
        return None
    blur, ink = _blurred(image, ink, sheet, white, black)
    color = white + (black - white) * ink[..., None]
    residual = np.abs(image - color)[sheet & (cv2.dilate(_edges(ink), np.ones((5, 5))) == 0)]
    noise = float(np.clip(1.4826 * np.percentile(residual, 35) / 0.673, 0.5, 0.1 * contrast))
    layout = board.layout
    density = sheet.sum() / max(float(np.prod(board.size)), 1e-9)
    cell = layout.side / layout.cells * float(np.sqrt(density))
    evidence = _evidence(image, ink, white, black, contrast, max(cell, 1.0))
    return EmptyBoard(color, sheet, np.where(sheet, evidence, 0.0), contrast, blur, noise)


def _projected(
    board: Board, H_pixel_S: Array, size: tuple[int, int]
) -> tuple[Array, NDArray[np.bool_]]:
    """(H, W) share of ink in each pixel, and which pixels the sheet fills."""
    rows, columns = (round(s * TEXELS) for s in board.size[::-1])
    texture = np.zeros((rows, columns), np.float32)
    layout = board.layout
    for corners, black in zip(layout.p_SQ, layout.black, strict=True):
        x, y = corners[0, 0] * TEXELS, rows - corners[0, 1] * TEXELS
        step = layout.side / layout.cells * TEXELS
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
    full = cv2.warpPerspective(np.ones_like(texture), H, fine, flags=cv2.INTER_NEAREST)
    ink = cv2.resize(ink, size, interpolation=cv2.INTER_AREA).astype(float)
    return ink, cv2.resize(full, size, interpolation=cv2.INTER_AREA) > 0.999


def _cover(start: float, step: float, cells: int, n: int) -> Array:
    """(cells, n) share of each of `n` texels that lies in each cell of a row."""
    low = start + step * np.arange(cells)[:, None]
    texel = np.arange(n)
    return np.clip(np.minimum(low + step, texel + 1) - np.maximum(low, texel), 0.0, 1.0)


def _on_the_sheet(H_pixel_S: Array, size: tuple[int, int], sheet: tuple[float, float]) -> Array:
    """(H, W, 2) where on the sheet each pixel looks, from -1 to 1 each way."""
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    p = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(H_pixel_S).T
    return np.clip(p[..., :2] / p[..., 2:] / np.array(sheet) * 2.0 - 1.0, -2.0, 2.0)


def _levels(
    image: Array, ink: Array, sheet: NDArray[np.bool_], p_S: Array
) -> tuple[Array, Array] | None:
    """(H, W, 3) levels of paper and of ink all over the sheet; None if too little is in view."""
    flat = sheet & (cv2.dilate(_edges(ink), np.ones((3, 3))) == 0)
    x, y = p_S[..., 0], p_S[..., 1]
    basis = np.stack([np.ones_like(x), x, y, x * y, x * x, y * y], axis=-1)
    fitted = []
    for here, start in ((flat & (ink < 0.01), 65.0), (flat & (ink > 0.99), 30.0)):
        if here.sum() < 50:
            return None
        fitted.append(_robust_surface(basis, image, here, start))
    return fitted[0], fitted[1]


def _robust_surface(basis: Array, image: Array, here: NDArray[np.bool_], start: float) -> Array:
    """(H, W, 3) quadratic functions of the place fitted to pixels, most of which obey them.

    Args:
        basis: (H, W, 6) of the functions.
        image: (H, W, 3).
        here: (H, W) pixels to fit to.
        start: percentile of their levels to start from.
    """
    A, levels = basis[here], image[here]
    step = max(1, len(A) // 20_000)
    A, levels = A[::step], levels[::step]
    result = np.empty_like(image)
    for channel in range(3):
        y = levels[:, channel]
        fit = np.full(len(y), np.percentile(y, start))
        spread = max(1.4826 * float(np.median(np.abs(y - fit))), 6.0)
        w = np.zeros(6)
        for columns in (1, 3, 3, 6, 6, 6):
            off = (y - fit) / (3.0 * spread)
            weight = np.where(np.abs(off) < 1.0, (1.0 - off**2) ** 2, 0.0)
            B = A[:, :columns]
            normal = (B * weight[:, None]).T @ B + 1e-3 * weight.sum() * np.eye(columns)
            normal[0, 0] -= 1e-3 * weight.sum()
            w = np.zeros(6)
            w[:columns] = np.linalg.solve(normal, (B * weight[:, None]).T @ y)
            fit = A @ w
            kept = weight > 0.0
            if kept.any():
                spread = max(1.4826 * float(np.median(np.abs(y - fit)[kept])), 3.0)
        result[..., channel] = basis @ w
    return np.clip(result, 0.0, 255.0)


def _edges(ink: Array) -> NDArray[np.uint8]:
    """(H, W) 1 where a pixel is partly ink."""
    return ((ink > 0.01) & (ink < 0.99)).astype(np.uint8)


def _blurred(
    image: Array, ink: Array, sheet: NDArray[np.bool_], white: Array, black: Array
) -> tuple[float, Array]:
    """The blur under which the board fits the photo best, and (H, W) the ink under it."""
    near = sheet & (cv2.dilate(_edges(ink), np.ones((3, 3))) > 0)
    span = (white - black)[near].mean(axis=-1)
    seen = (white - image)[near].mean(axis=-1) / np.maximum(span, 1.0)
    best, chosen = (np.inf, 0.0), ink
    for blur in BLURS:
        soft = cv2.GaussianBlur(ink, (0, 0), blur) if blur > 0.0 else ink
        off = np.minimum(np.abs(seen - soft[near]), 0.2)
        score = (float((off**2).mean()), blur)
        if score < best:
            best, chosen = score, soft
    return best[1], chosen


def _evidence(
    image: Array, ink: Array, white: Array, black: Array, contrast: float, cell: float
) -> Array:
    """(H, W) see `EmptyBoard.evidence`; tolerates a pixel of misalignment."""
    kernel = np.ones((3, 3))
    most, least = cv2.dilate(ink, kernel)[..., None], cv2.erode(ink, kernel)[..., None]
    dark, bright = white + (black - white) * most, white + (black - white) * least
    above = ((image - bright) / contrast).max(axis=-1)
    below = ((dark - image) / contrast).max(axis=-1)
    off = np.maximum(above, below)
    # a shadow, or a tint, scales all channels alike
    shade = image / np.maximum(white, 1.0)
    mean = shade.mean(axis=-1)
    grey = np.abs(shade - mean[..., None]).max(axis=-1) < 0.06
    shadow = grey & (below < TINT) & (above < EXPLAINED) & (ink < 0.5)
    span = (most - least)[..., 0]
    alike = off <= EXPLAINED
    # a white object on paper, or a dark one on ink, looks like the board here and there; the board
    # does all over, and has its pattern
    window = (2 * round(cell) + 1,) * 2
    around = cv2.blur(((off <= EXPLAINED) | shadow).astype(float), window)
    pattern = np.clip(cv2.blur(span, window) / 0.2, 0.2, 1.0)
    result = np.where(alike, -pattern * np.clip((around - 0.7) / 0.25, 0.0, 1.0), 1.0)
    result[~alike & shadow] = 0.0
    result[alike & (span > 0.3)] *= 0.3  # almost anything would fit
    return cv2.GaussianBlur(result, (0, 0), 0.7)
