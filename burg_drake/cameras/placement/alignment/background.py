"""What a photo would look like without objects, but for shadows: the known board in linear light.

A pixel of the board is its reflectance, which is known, times the light that reaches it, which is
not: shadows may lie anywhere, and have edges. Only the light of paper that no shadow darkens is
fitted, as a smooth function of the place on the sheet, with the photo's blur and the reflectance of
ink. `evidence` says where something stands.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment.evidence import (
    LEAST_WINDOW,
    Evidence,
    evidence_of,
    texture,
    window_of,
)
from burg_drake.cameras.placement.alignment.sheet_projection import (
    places_on_sheet,
    projected_print,
    projected_tints,
)
from burg_drake.core import Array, inverse, photo_light
from burg_drake.scene.document import Board

BLURS = (0.3, 0.5, 0.7, 0.9, 1.2, 1.6, 2.1, 2.7)
"""Standard deviations of the photo's blur that are tried [pixels]."""
MIN_CONTRAST = 0.02
"""Least difference of paper and ink in which anything can be measured [full scale, linear]."""
INK = 0.06
"""Reflectance of ink over that of paper, before the photo says what it is."""
BOARD_SEEN = 0.3
"""Least texture, in the sense of `evidence.texture`, where levels of paper and ink are taken."""
UPPER = 0.75
"""Share of paper that is darker than paper without shadow is taken to be."""
MOST_SAMPLES = 20_000


@dataclass(frozen=True, eq=False)
class EmptyBoard:
    """The empty board as the camera would see it without shadows.

    Attributes:
        color: (H, W, 3) predicted linear light; only meaningful on the `sheet`. With tints of
            a height map if the photo shows them.
        sheet: (H, W) pixels that see nothing but the sheet, were it empty.
        evidence: (H, W) from +1, where something stands, to -1, where the board is seen; 0 where
            that cannot be told.
        paper: (3,) light of paper without shadow, mean over the sheet.
        contrast: paper less ink, mean over channels and sheet [full scale, linear].
        blur: of the photo [pixels].
        noise: standard deviation of the photo's noise over paper [full scale, linear].
        smear: how far evidence reaches beyond what stands there [pixels].
    """

    color: NDArray[np.float32]
    sheet: NDArray[np.bool_]
    evidence: Array
    paper: NDArray[np.float32]
    contrast: float
    blur: float
    noise: float
    smear: float


def empty_board(
    board: Board,
    image: NDArray[np.uint8],
    K: Array,
    X_SC: Array,
    scale: tuple[float, float] = (1.0, 1.0),
    tints: NDArray[np.uint8] | None = None,
) -> EmptyBoard | None:
    """Predicts the empty board.

    Args:
        board: its markers must fit on it.
        image: (H, W, 3) photo without lens distortion, sRGB.
        K: (3, 3) camera matrix.
        X_SC: (4, 4) camera in the scene frame.
        scale: size of the print against the document along x and y.
        tints: (R, C, 3) sRGB of a height map that may be printed on the paper, upper edge first;
            None without.

    Returns:
        None if there is no contrast of paper and ink in the photo.
    """
    size = image.shape[1], image.shape[0]
    light = photo_light(image)
    H_pixel_S = K @ inverse(X_SC)[:3][:, [0, 1, 3]] @ np.diag([*scale, 1.0])  # of the document
    ink, frames, sheet = projected_print(board, H_pixel_S, size)
    tint = projected_tints(board, tints, H_pixel_S, size)
    p_S = places_on_sheet(H_pixel_S, size, board.size)
    sheet = cv2.erode(sheet.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    layout = board.layout
    density = sheet.sum() / max(float(np.prod(board.size)), 1e-9)
    cell = max(layout.side / layout.cells * float(np.sqrt(density)), 1.0)
    soft = cv2.GaussianBlur(ink, (0, 0), BLURS[2])
    pattern = texture(light, soft, INK, cell)
    levels = _levels(light, ink, sheet & (pattern.score > BOARD_SEEN), p_S)
    if levels is None:
        return None
    white, black = levels
    contrast = float((white[sheet] - white[sheet] * black).mean())
    if contrast < MIN_CONTRAST:
        return None
    blur, soft = _blurred(light, ink, sheet & (pattern.score > BOARD_SEEN), black)
    seen = sheet & (pattern.score > BOARD_SEEN)
    printed = 1.0 - (1.0 - tint) * (1.0 - frames[..., None])
    paper = white * (printed if _is_tinted(light, white, printed, seen & (soft < 0.05)) else 1.0)
    color = (paper * (1.0 - soft[..., None] * (1.0 - black))).astype(np.float32)
    told = Evidence(light, color, tint, soft, white, float(black.mean()), cell)
    evidence = np.where(sheet, evidence_of(told), 0.0)
    far = cv2.dilate((soft > 0.01).astype(np.uint8), np.ones((5, 5))) == 0
    noise = _noise(light, seen & far)
    return EmptyBoard(
        color,
        sheet,
        evidence,
        white[sheet].mean(axis=0).astype(np.float32),
        contrast,
        blur,
        float(np.clip(noise, 0.002, 0.1 * contrast)),
        max(window_of(cell) - LEAST_WINDOW, 0.0),
    )


def _is_tinted(
    light: NDArray[np.float32], white: Array, printed: Array, paper: NDArray[np.bool_]
) -> bool:
    """Whether what may be tinted is so in the photo: whose tones fit better, paper's or tints'."""
    here = paper & (np.ptp(printed, axis=-1) > 0.1)
    if here.sum() < 30:
        return False
    seen, full, tint = light[here], white[here], printed[here]
    seen = seen / full
    tone = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1e-4)
    off = np.abs(tone - 1.0 / 3.0).sum(axis=1)
    off_tint = np.abs(tone - tint / tint.sum(axis=1, keepdims=True)).sum(axis=1)
    return bool(np.median(off_tint - off) < 0.0)


def _noise(light: NDArray[np.float32], paper: NDArray[np.bool_]) -> float:
    """Standard deviation of the photo over paper."""
    if not paper.any():
        return 0.01
    rough = light[..., 1] - cv2.GaussianBlur(light[..., 1], (0, 0), 1.0)
    # what this blur takes of white noise
    return 1.19 * 1.4826 * float(np.median(np.abs(rough[paper])))


def _levels(
    light: NDArray[np.float32], ink: Array, board: NDArray[np.bool_], p_S: Array
) -> tuple[Array, Array] | None:
    """(H, W, 3) light of paper without shadow, and (3,) that of ink over that of paper; None if too
    little is in view.

    Args:
        light: (H, W, 3) of the photo.
        ink: (H, W) share of ink.
        board: (H, W) pixels in which the board's pattern is seen.
        p_S: (H, W, 2) place on the sheet.
    """
    flat = board & (cv2.dilate(_edges(ink), np.ones((3, 3))) == 0)
    paper, inked = flat & (ink < 0.01), flat & (ink > 0.99)
    if paper.sum() < 50 or inked.sum() < 20:
        return None
    x, y = p_S[..., 0], p_S[..., 1]
    basis = np.stack([np.ones_like(x), x, y, x * y, x * x, y * y], axis=-1)
    step = max(1, int(paper.sum()) // MOST_SAMPLES)
    white = _upper_surface(basis, basis[paper][::step], light[paper][::step])
    # light of ink over that of the paper around it, shadow or not
    around = cv2.blur(np.where(paper[..., None], light, np.float32(0.0)), (15, 15))
    count = cv2.blur(paper.astype(np.float32), (15, 15))
    near = inked & (count > 0.1)
    if near.sum() < 20:
        return None
    ratio = light[near] * count[near, None] / np.maximum(around[near], 1e-4)
    black: Array = np.clip(np.median(ratio, axis=0), 0.005, 0.5).astype(float)
    return white, black


def _upper_surface(basis: Array, A: Array, levels: Array) -> Array:
    """(H, W, 3) a quadratic function of the place that runs along the upper rim of levels.

    Args:
        basis: (H, W, 6) of the functions.
        A: (N, 6) at samples.
        levels: (N, 3) of these.
    """
    mean = levels.mean(axis=1)
    fit = np.full(len(mean), np.quantile(mean, UPPER))
    w = np.zeros(6)
    for columns in (1, 3, 3, 6, 6, 6, 6):
        off = (mean - fit) / np.maximum(fit, 1e-3)
        # darker by a shadow, brighter only by noise: asymmetric weights, then far ones let go
        weight = np.where(off > 0.0, UPPER, 1.0 - UPPER) / np.maximum(np.abs(off), 0.01)
        weight *= (off > -0.3) & (off < 0.5)
        B = A[:, :columns]
        normal = (B * weight[:, None]).T @ B + 1e-3 * weight.sum() * np.eye(columns)
        normal[0, 0] -= 1e-3 * weight.sum()
        w = np.zeros(6)
        w[:columns] = np.linalg.solve(normal, (B * weight[:, None]).T @ mean)
        fit = A @ w
    bright = np.abs(mean - fit) < 0.15 * np.maximum(fit, 1e-3)
    tone = levels[bright] if bright.any() else levels
    tone = np.median(tone / np.maximum(tone.mean(axis=1, keepdims=True), 1e-4), axis=0)
    return np.maximum(basis @ w, 1e-3)[..., None] * tone


def _edges(ink: Array) -> NDArray[np.uint8]:
    """(H, W) 1 where a pixel is partly ink."""
    return ((ink > 0.01) & (ink < 0.99)).astype(np.uint8)


def _blurred(
    light: NDArray[np.float32], ink: Array, board: NDArray[np.bool_], black: Array
) -> tuple[float, Array]:
    """The blur under which the board fits the photo best, and (H, W) the ink under it.

    The light at an edge is that of the brightest pixel near it, as shadows may be anywhere.
    """
    near = board & (cv2.dilate(_edges(ink), np.ones((3, 3))) > 0)
    grey = light.mean(axis=-1)
    around = cv2.dilate(cv2.blur(grey, (2, 2)), np.ones((7, 7)))[near]
    seen = (1.0 - grey[near] / np.maximum(around, 1e-4)) / (1.0 - float(black.mean()))
    best, chosen = (np.inf, 0.0), ink
    for blur in BLURS:
        soft = cv2.GaussianBlur(ink, (0, 0), blur)
        off = np.minimum(np.abs(seen - soft[near]), 0.2)
        score = (float((off**2).mean()), blur)
        if score < best:
            best, chosen = score, soft
    return best[1], chosen
