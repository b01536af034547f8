"""Predict the photo of the empty board, and find where the real photo differs from it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from burg_drake.core import Array, Booleans, Bytes, Single, inverse, srgb_to_linear
from burg_drake.printout import frame_width
from burg_drake.scene import Board

BLUR_SIGMAS_PX = (0.3, 0.5, 0.7, 0.9, 1.2, 1.6, 2.1, 2.7)
"""Standard deviations of the photo's blur that are tried, in pixels."""


@dataclass(frozen=True, eq=False)
class EmptyBoard:
    """The empty board as the camera would see it without shadows.

    Attributes:
        color: (H, W, 3) predicted linear light, with the tints of a height map if the photo shows
            them; only meaningful on the `sheet`.
        sheet: (H, W) True for pixels that would show only the sheet if it were empty.
        evidence: (H, W) from +1, where an object stands, to -1, where the board is seen; 0 where
            unknown.
        paper: (3,) mean light of unshadowed paper over the sheet.
        contrast: paper minus ink, mean over channels and sheet [full scale, linear].
        blur: of the photo [pixels].
        noise: standard deviation of the photo's noise over paper [full scale, linear].
        smear: distance by which evidence extends beyond objects [pixels].
    """

    color: Single
    sheet: Booleans
    evidence: Array
    paper: Single
    contrast: float
    blur: float
    noise: float
    smear: float


def empty_board(
    board: Board,
    image: Bytes,
    K: Array,
    X_SC: Array,
    scale: tuple[float, float] = (1.0, 1.0),
    tints: Bytes | None = None,
) -> EmptyBoard | None:
    """Predicts the image of the empty board.

    Args:
        board: its markers must fit on it.
        image: (H, W, 3) photo without lens distortion, sRGB.
        K: (3, 3) camera matrix.
        X_SC: (4, 4) camera in the scene frame.
        scale: size of the print relative to the document along x and y.
        tints: (R, C, 3) sRGB of a height map that may be printed on the paper, upper edge first;
            None without.

    Returns:
        The prediction, or None if the photo has no contrast of paper and ink.
    """
    size = image.shape[1], image.shape[0]
    light = srgb_to_linear(image)
    H_pixel_S = K @ inverse(X_SC)[:3][:, [0, 1, 3]] @ np.diag([*scale, 1.0])  # of the document
    ink, frames, sheet = project_print(board, H_pixel_S, size)
    tint = project_tints(board, tints, H_pixel_S, size)
    p_S = pixels_on_sheet(H_pixel_S, size, board.size)
    sheet = cv2.erode(sheet.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    layout = board.layout
    density = sheet.sum() / max(float(np.prod(board.size)), 1e-9)
    cell = max(layout.side / layout.cells * float(np.sqrt(density)), 1.0)
    blurred_ink = cv2.GaussianBlur(ink, (0, 0), BLUR_SIGMAS_PX[2])
    # Relative to paper, before it is measured in the photo.
    pattern = compare_texture(light, blurred_ink, 0.06, cell)
    seen = sheet & (pattern > 0.3)  # pixels that show the board's texture
    levels = _light_levels(light, ink, seen, p_S)
    if levels is None:
        return None
    white, black = levels
    contrast = float((white[sheet] - white[sheet] * black).mean())
    if contrast < 0.02:  # Difference of paper and ink, as a fraction of full scale.
        return None
    blur, blurred_ink = _estimate_blur(light, ink, seen, black)
    printed = 1.0 - (1.0 - tint) * (1.0 - frames[..., None])
    paper = white * (
        printed if _is_tinted(light, white, printed, seen & (blurred_ink < 0.05)) else 1.0
    )
    color = (paper * (1.0 - blurred_ink[..., None] * (1.0 - black))).astype(np.float32)
    of_object = np.maximum(
        _color_evidence(light, tint, white), _brightness_evidence(light, color, white)
    )
    of_texture = -compare_texture(light, blurred_ink, float(black.mean()), cell)
    evidence = np.where(of_object > 0.0, np.maximum(of_object, of_texture), of_texture)
    far = cv2.dilate((blurred_ink > 0.01).astype(np.uint8), np.ones((5, 5))) == 0
    noise = _paper_noise(light, seen & far)
    return EmptyBoard(
        color,
        sheet,
        np.where(sheet, evidence, 0.0),
        white[sheet].mean(axis=0).astype(np.float32),
        contrast,
        blur,
        float(np.clip(noise, 0.002, 0.1 * contrast)),
        max(window_sigma(cell) - MIN_WINDOW_SIGMA_PX, 0.0),
    )


def _is_tinted(light: Single, white: Array, printed: Array, paper: Booleans) -> bool:
    """Whether the photo shows the tints of the height map: its tones fit them better than paper."""
    here = paper & (np.ptp(printed, axis=-1) > 0.1)
    if here.sum() < 30:
        return False
    seen, full, tint = light[here], white[here], printed[here]
    seen = seen / full
    tone = seen / np.maximum(seen.sum(axis=1, keepdims=True), 1e-4)
    off_paper = np.abs(tone - 1.0 / 3.0).sum(axis=1)
    off_tint = np.abs(tone - tint / tint.sum(axis=1, keepdims=True)).sum(axis=1)
    return bool(np.median(off_tint - off_paper) < 0.0)


def _paper_noise(light: Single, paper: Booleans) -> float:
    """Standard deviation of the photo's noise over paper."""
    if not paper.any():
        return 0.01
    rough = light[..., 1] - cv2.GaussianBlur(light[..., 1], (0, 0), 1.0)
    # factor by which this blur reduces white noise
    return 1.19 * 1.4826 * float(np.median(np.abs(rough[paper])))


def _light_levels(
    light: Single, ink: Array, board: Booleans, p_S: Array
) -> tuple[Array, Array] | None:
    """(H, W, 3) light of unshadowed paper, and (3,) the ratio of ink to paper; None if too little
    of the board is in view.

    Args:
        light: (H, W, 3) of the photo.
        ink: (H, W) share of ink.
        board: (H, W) pixels in which the board's pattern is seen.
        p_S: (H, W, 2) place on the sheet.
    """
    flat = board & (cv2.dilate(_ink_edges(ink), np.ones((3, 3))) == 0)
    paper, inked = flat & (ink < 0.01), flat & (ink > 0.99)
    if paper.sum() < 50 or inked.sum() < 20:
        return None
    x, y = p_S[..., 0], p_S[..., 1]
    basis = np.stack([np.ones_like(x), x, y, x * y, x * x, y * y], axis=-1)
    step = max(1, int(paper.sum()) // 20_000)  # Approximate number of paper pixels that are used.
    white = _upper_surface(basis, basis[paper][::step], light[paper][::step])
    # ratio of the ink's light to that of the paper around it, in shadow or not
    around = cv2.blur(np.where(paper[..., None], light, np.float32(0.0)), (15, 15))
    count = cv2.blur(paper.astype(np.float32), (15, 15))
    near = inked & (count > 0.1)
    if near.sum() < 20:
        return None
    ratio = light[near] * count[near, None] / np.maximum(around[near], 1e-4)
    black: Array = np.clip(np.median(ratio, axis=0), 0.005, 0.5).astype(float)
    return white, black


def _upper_surface(basis: Array, A: Array, levels: Array) -> Array:
    """(H, W, 3) a quadratic surface fitted to the upper envelope of levels.

    Args:
        basis: (H, W, 6) basis functions.
        A: (N, 6) basis functions at the samples.
        levels: (N, 3) light at the samples.
    """
    quantile = 0.75  # Fraction of samples that may be darker than unshadowed paper.
    mean = levels.mean(axis=1)
    fit = np.full(len(mean), np.quantile(mean, quantile))
    w = np.zeros(6)
    for columns in (1, 3, 3, 6, 6, 6, 6):
        deviation = (mean - fit) / np.maximum(fit, 1e-3)
        # Shadows darken, only noise brightens: asymmetric weights, 0 for far samples.
        weight = np.where(deviation > 0.0, quantile, 1.0 - quantile) / np.maximum(
            np.abs(deviation), 0.01
        )
        weight *= (deviation > -0.3) & (deviation < 0.5)
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


def _ink_edges(ink: Array) -> Bytes:
    """(H, W) 1 where a pixel is partly ink."""
    return ((ink > 0.01) & (ink < 0.99)).astype(np.uint8)


def _estimate_blur(light: Single, ink: Array, board: Booleans, black: Array) -> tuple[float, Array]:
    """The blur under which the board fits the photo best, and (H, W) the blurred ink.

    The light at an edge is taken from the brightest nearby pixel, as shadows may be anywhere.
    """
    near = board & (cv2.dilate(_ink_edges(ink), np.ones((3, 3))) > 0)
    grey = light.mean(axis=-1)
    around = cv2.dilate(cv2.blur(grey, (2, 2)), np.ones((7, 7)))[near]
    seen = (1.0 - grey[near] / np.maximum(around, 1e-4)) / (1.0 - float(black.mean()))
    best, chosen = (np.inf, 0.0), ink
    for blur in BLUR_SIGMAS_PX:
        blurred_ink = cv2.GaussianBlur(ink, (0, 0), blur)
        error = np.minimum(np.abs(seen - blurred_ink[near]), 0.2)
        score = (float((error**2).mean()), blur)
        if score < best:
            best, chosen = score, blurred_ink
    return best[1], chosen


def project_print(
    board: Board, H_pixel_S: Array, size: tuple[int, int]
) -> tuple[Array, Array, Booleans]:
    """(H, W) shares of ink and of white marker frames in each pixel, and True for pixels that are
    entirely on the sheet.
    """
    texels_per_metre = 4000.0  # 22 for a cell of the default markers.
    oversampling = 3  # Samples per pixel of the photo, each way.
    rows, columns = (round(s * texels_per_metre) for s in board.size[::-1])
    texture = np.zeros((rows, columns), np.float32)
    frames = np.zeros((rows, columns), np.uint8)
    layout = board.layout
    frame_texels = frame_width(layout) * texels_per_metre
    for corners, black in zip(layout.p_SQ, layout.black, strict=True):
        x, y = corners[0, 0] * texels_per_metre, rows - corners[0, 1] * texels_per_metre
        step = layout.side / layout.cells * texels_per_metre
        ends = (x, y), (x + layout.cells * step, y + layout.cells * step)
        for edge, level in ((frame_texels, 1), (0.0, 0)):
            first, last = (
                np.round(np.add(end, side * edge)).astype(int).tolist()
                for end, side in zip(ends, (-1, 1), strict=True)
            )
            frames[max(first[1], 0) : last[1], max(first[0], 0) : last[0]] = level
        left, top = int(x), int(y)
        n = int(np.ceil(layout.cells * step)) + 2
        across, down = (
            _texel_coverage(start, step, layout.cells, n) for start in (x - left, y - top)
        )
        patch = down.T @ black @ across
        target = texture[max(top, 0) : top + n, max(left, 0) : left + n]
        target += patch[: target.shape[0], : target.shape[1]].astype(np.float32)
    # from texels of the sheet, centres at integers, to pixels of a finer photo
    H_S_texel = np.array([[1.0, 0.0, 0.5], [0.0, -1.0, rows - 0.5], [0.0, 0.0, texels_per_metre]])
    H_S_texel /= texels_per_metre
    n = oversampling
    H_fine_pixel = np.array([[n, 0.0, (n - 1) / 2], [0.0, n, (n - 1) / 2], [0.0, 0.0, 1.0]])
    H = H_fine_pixel @ H_pixel_S @ H_S_texel
    fine = (oversampling * size[0], oversampling * size[1])
    ink = cv2.warpPerspective(texture, H, fine, flags=cv2.INTER_LINEAR)
    white = cv2.warpPerspective(frames.astype(np.float32), H, fine, flags=cv2.INTER_LINEAR)
    white = cv2.resize(white, size, interpolation=cv2.INTER_AREA)
    full = cv2.warpPerspective(np.ones_like(texture), H, fine, flags=cv2.INTER_NEAREST)
    ink = cv2.resize(ink, size, interpolation=cv2.INTER_AREA).astype(float)
    return ink, white, cv2.resize(full, size, interpolation=cv2.INTER_AREA) > 0.999


def project_tints(
    board: Board, tints: Bytes | None, H_pixel_S: Array, size: tuple[int, int]
) -> Single:
    """(H, W, 3) reflectance of a height map's tints relative to paper."""
    if tints is None:
        return np.ones((*size[::-1], 3), np.float32)
    rows, columns = tints.shape[:2]
    x, y = board.size[0] / columns, board.size[1] / rows
    H_S_texel = np.array([[x, 0, x / 2], [0, -y, board.size[1] - y / 2], [0, 0, 1]])
    H = H_pixel_S @ H_S_texel
    white = (1.0, 1.0, 1.0)
    return np.asarray(cv2.warpPerspective(srgb_to_linear(tints), H, size, borderValue=white))


def _texel_coverage(start: float, step: float, cells: int, n: int) -> Array:
    """(cells, n) share of each of `n` texels covered by each cell of a row."""
    low = start + step * np.arange(cells)[:, None]
    texel = np.arange(n)
    cover: Array = np.minimum(low + step, texel + 1) - np.maximum(low, texel)
    return cover.clip(0.0, 1.0)


def pixels_on_sheet(H_pixel_S: Array, size: tuple[int, int], sheet: tuple[float, float]) -> Array:
    """(H, W, 2) normalized sheet coordinates of each pixel, from -1 to 1."""
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    p = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(H_pixel_S).T
    places: Array = p[..., :2] / p[..., 2:] / np.array(sheet) * 2.0 - 1.0
    return places.clip(-2.0, 2.0)


MIN_WINDOW_SIGMA_PX = 2.0
"""Least standard deviation of the neighbourhood, in pixels."""


def window_sigma(cell: float) -> float:
    """Standard deviation of the neighbourhood for a cell size [pixels]."""
    return max(0.8 * cell, MIN_WINDOW_SIGMA_PX)


def compare_texture(light: Single, ink: Array, black: float, cell: float) -> Array:
    """Compares the texture of the photo with that of the board in neighbourhoods.

    The covariance of their logarithms is the variance of the board's in a photo of the board in any
    light, and 0 in a photo without the pattern.

    Args:
        light: (H, W, 3) of the photo.
        ink: (H, W) share of ink, blurred as the photo is.
        black: light of ink over that of paper.
        cell: side of a marker's cell [pixels].

    Returns:
        (H, W) from 1, where the board's pattern has its full contrast, to -1, where it has none; 0
        where no pattern is expected.
    """
    dark_offset = 0.02  # Fraction of paper's light added before the logarithm, against noise.
    sigma = window_sigma(cell)
    grey = light.mean(axis=-1)
    # local light of paper, so that the offset is the same share in shade and sun
    local = cv2.GaussianBlur(cv2.dilate(grey, np.ones((5, 5))), (0, 0), 2.0 * sigma)
    seen = np.log(grey / np.maximum(local, 1e-4) + dark_offset).astype(np.float32)
    known = np.log(1.0 - (1.0 - black) * ink + dark_offset).astype(np.float32)

    def around(values: Single) -> Single:
        return np.asarray(cv2.GaussianBlur(values, (0, 0), sigma))

    mean_seen, mean_known = around(seen), around(known)
    variance = around(known * known) - mean_known**2
    covariance = around(seen * known) - mean_seen * mean_known
    score = np.clip(2.0 * covariance / np.maximum(variance, 1e-3) - 1.0, -1.0, 1.0)
    # Log variance of the pattern with full weight; that of a marker is 2.
    weight = np.clip(variance / 0.25, 0.0, 1.0)
    return np.asarray(score * weight)


def _ramp(values: Array, limits: tuple[float, float]) -> Array:
    return np.clip((values - limits[0]) / (limits[1] - limits[0]), 0.0, 1.0)


def _color_evidence(light: Single, tone: Single, white: Array) -> Array:
    """(H, W) 0 where grey light on any mixture of paper, ink and tint explains the colour.

    Args:
        light: (H, W, 3) of the photo.
        tone: (H, W, 3) reflectance of a height map's tints relative to paper.
        white: (H, W, 3) light of paper without shadow.
    """
    r = cv2.GaussianBlur(light, (0, 0), 0.8) / white.astype(np.float32)
    grey = np.float32(1.0 / np.sqrt(3.0))
    along = r.sum(axis=-1) * grey
    # the part of the tint that is not grey
    across = tone - (tone.mean(axis=-1, keepdims=True))
    length = np.sqrt((across**2).sum(axis=-1))
    across /= np.maximum(length, 1e-6)[..., None]
    share = np.clip((r * across).sum(axis=-1), 0.0, None) * (length > 0.01)
    full_tint = length / np.maximum(tone.sum(axis=-1) * grey, 1e-6) * along
    share = np.minimum(share, full_tint)
    residual = r - along[..., None] * grey - share[..., None] * across
    residual_length = np.sqrt((residual**2).sum(axis=-1))
    # Unexplained part of the light. In the dark, colours are noise and stray light.
    return _ramp(residual_length / (along + 0.06), (0.10, 0.22))


def _brightness_evidence(light: Single, color: Single, white: Array) -> Array:
    """(H, W) 0 where the board's colour (H, W, 3) explains the brightness, with a tolerance of one
    pixel of misalignment.
    """
    brightest = cv2.dilate(color.mean(axis=-1), np.ones((3, 3)))
    # Ratio of the photo to the board; next to a bright pixel the blur of an edge is not exact.
    return _ramp(light.mean(axis=-1) / (brightest + 0.03 * white.mean(axis=-1)), (1.15, 1.45))
