"""Images of a board with exact truth, to test and to compare what estimates poses from images.

Made without a renderer: each pixel is the mean over its area of what the sheet shows there, so that
an edge lies where the pose puts it to a few hundredths of a pixel, or better if asked. White paper
with the markers on a table; covers may lie on it, and blur, noise, uneven light and lens distortion
may be added. Pixels and blur mix light, as those of cameras do; levels are those of sRGB.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras import Intrinsics
from burg_drake.core import Array, InvalidInputError
from burg_drake.scene import Board, MarkerLayout

COARSE, FINE = 34, 89
"""Samples a pixel that an edge crosses; Fibonacci numbers, see `_lattice`."""
CHUNK = 1 << 9
"""Pixels that are sampled at once; few enough that their samples stay in the processor's cache."""
HORIZON = -0.02
"""Least slope of rays to the table, z in S of rays of about unit length; far beyond all boards."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
PAPER, INK, TABLE, COVER = 0, 1, 2, 3
"""What a point of the table's plane shows."""
COLORS = np.array([[235, 235, 232], [22, 22, 24], [128, 112, 96], [70, 96, 120]], dtype=float)
"""Of paper, ink, table and covers [8-bit RGB]."""


@dataclass(frozen=True, kw_only=True)
class ImageDegradation:
    """What degrades an image.

    Attributes:
        blur: standard deviation of a Gaussian blur [pixels].
        noise: standard deviation of noise [8-bit levels].
        gain: all light is multiplied by it.
        gradient: how much more light there is at the right edge of the image than at its left, as a
            share.
    """

    blur: float = 0.0
    noise: float = 0.0
    gain: float = 1.0
    gradient: float = 0.0


def board_image(
    board: Board,
    intrinsics: Intrinsics,
    X_SC: Array,
    *,
    covers: Array | None = None,
    look: ImageDegradation = ImageDegradation(),
    scale: tuple[float, float] = (1.0, 1.0),
    rng: np.random.Generator | None = None,
    samples: int = COARSE,
) -> NDArray[np.uint8]:
    """What a camera sees of a board that lies on a table.

    Args:
        board: the board.
        intrinsics: of the camera.
        X_SC: (4, 4) camera's optical frame in the scene frame, above the sheet.
        covers: (N, 5) flat rectangles that lie on the sheet: centre x, y, half extents along their
            own axes [m], and angle from x [rad], see `covers_of`.
        look: blur, noise, light.
        scale: size of the print against the document, along x and y, from S's origin.
        rng: for noise.
        samples: of a pixel that an edge crosses, a Fibonacci number; `FINE` where the last
            hundredths of a pixel count.

    Returns:
        (H, W, 3) RGB image.

    Raises:
        InvalidInputError: the camera looks past the table; noise without `rng`.
    """
    if look.noise > 0.0 and rng is None:
        raise InvalidInputError("noise needs a random generator; give rng")
    sheet = _Sheet(board, np.empty((0, 5)) if covers is None else np.asarray(covers, float), scale)
    image = area_means(sheet, intrinsics, np.asarray(X_SC, dtype=float), samples)
    return degraded(image, look, rng)


def degraded(
    light: Array, look: ImageDegradation, rng: np.random.Generator | None = None
) -> NDArray[np.uint8]:
    """(H, W, 3) an image in another light, blurred, and with noise, in this order.

    Args:
        light: (H, W, 3) linear light [0 to 1].
        look: what degrades it.
        rng: for noise.

    Raises:
        InvalidInputError: noise without `rng`.
    """
    import cv2

    if look.noise > 0.0 and rng is None:
        raise InvalidInputError("noise needs a random generator; give rng")
    width = light.shape[1]
    gain = look.gain * (1.0 + look.gradient * (np.arange(width) / width - 0.5))
    light = light * gain[None, :, None]
    if look.blur > 0.0:
        light = cv2.GaussianBlur(light, (0, 0), look.blur, borderType=cv2.BORDER_REPLICATE)
    image = levels(light)
    if rng is not None and look.noise > 0.0:
        image = image + rng.normal(0.0, look.noise, image.shape)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def levels(light: Array) -> Array:
    """Levels [0 to 255] of linear light [0 to 1], as sRGB has them (IEC 61966-2-1)."""
    light = np.clip(light, 0.0, 1.0)
    bright = 1.055 * np.maximum(light, 0.0031308) ** (1.0 / 2.4) - 0.055
    return np.asarray(255.0 * np.where(light <= 0.0031308, 12.92 * light, bright))


def light_of(levels: Array) -> Array:
    """Linear light [0 to 1] of levels [0 to 255]."""
    share = np.asarray(levels, dtype=float) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def board_depth(intrinsics: Intrinsics, X_SC: Array) -> NDArray[np.float32]:
    """Depth image of the table's plane.

    Returns:
        (H, W) distance along the optical axis [m].
    """
    u, v = np.meshgrid(np.arange(intrinsics.width), np.arange(intrinsics.height))
    rays = _rays(intrinsics, np.stack([u, v], axis=-1).astype(float)) @ X_SC[:3, :3].T
    return (-X_SC[2, 3] / rays[..., 2]).astype(np.float32)


def covers_of(
    layout: MarkerLayout, share: float, rng: np.random.Generator, *, partial: bool = False
) -> tuple[Array, tuple[int, ...]]:
    """Rectangles that hide a share of a board's markers.

    Args:
        layout: the markers.
        share: of the markers that are hidden, rounded to whole ones.
        rng: which ones, and how the covers lie.
        partial: leave something of a hidden marker in sight; what lies on it still crosses its
            border, or most of its cells, so that detectors cannot read it.

    Returns:
        `(covers, seen)`: (N, 5) covers for `board_image`, and ids of the markers in full sight.
    """
    hidden = rng.choice(len(layout.ids), round(share * len(layout.ids)), replace=False)
    half = 0.5 * layout.side
    center = layout.p_SQ[hidden].mean(axis=1)[:, :2]
    if partial:
        center = center + half * rng.uniform(-0.35, 0.35, center.shape)
        extents = half * rng.uniform(0.6, 0.9, center.shape)
        angle = rng.uniform(0.0, np.pi, len(center))
    else:
        extents = half * rng.uniform(1.15, 1.25, center.shape)
        angle = rng.uniform(-0.1, 0.1, len(center))
    covers = np.column_stack([center, extents, angle])
    # A cover may reach over a gap to a neighbour's edge; what it touches does not count as seen.
    begin, way = layout.p_SQ[:, :, None, :2], np.linspace(0.0, 1.0, 33)[:, None]
    outline = begin + way * (np.roll(begin, -1, axis=1) - begin)
    touched = np.asarray(_under(covers, outline.reshape(len(layout.ids), -1, 2)).any(axis=1))
    touched[hidden] = True
    return covers, tuple(int(i) for i in layout.ids[~touched])


class _Sheet:
    """What lies where on the table's plane.

    The plane is cut by all lines along which a cell of a marker or the sheet ends; `kinds` tells
    what is between them.
    """

    def __init__(self, board: Board, covers: Array, scale: tuple[float, float]) -> None:
        layout = board.layout
        cell = layout.side / layout.cells
        steps = cell * np.arange(layout.cells + 1)
        left, top = layout.p_SQ[:, 0, 0], layout.p_SQ[:, 0, 1]
        x = np.unique(np.round(np.r_[(left[:, None] + steps).ravel(), 0.0, board.size[0]], 9))
        y = np.unique(np.round(np.r_[(top[:, None] - steps).ravel(), 0.0, board.size[1]], 9))
        kinds = np.full((len(y) + 1, len(x) + 1), TABLE)
        kinds[1:-1, 1:-1] = PAPER
        for black, x0, y0 in zip(layout.black, left, top, strict=True):
            rows = np.searchsorted(y, y0 - cell * (np.arange(layout.cells) + 0.5))
            columns = np.searchsorted(x, x0 + cell * (np.arange(layout.cells) + 0.5))
            for row, ink in zip(rows, black, strict=True):
                kinds[row, columns[ink]] = INK
        self._x, self._y, self.kinds, self._covers = x * scale[0], y * scale[1], kinds, covers

    def region(self, p_S: Array) -> NDArray[np.intp]:
        """Number of the rectangle or cover that holds each point of the plane.

        Args:
            p_S: (N, M, 2) points, M of each pixel.
        """
        i = np.searchsorted(self._y, p_S[..., 1]) * (len(self._x) + 1)
        i += np.searchsorted(self._x, p_S[..., 0])
        if not len(self._covers):
            return i
        x, y = (np.ascontiguousarray(p_S[..., k]) for k in range(2))
        low = np.stack([x.min(axis=1), y.min(axis=1)], axis=1)
        high = np.stack([x.max(axis=1), y.max(axis=1)], axis=1)
        for k, cover in enumerate(self._covers):
            center, reach = cover[:2], np.hypot(*cover[2:4])
            near = np.flatnonzero(((high > center - reach) & (low < center + reach)).all(axis=1))
            i[near] = np.where(_under(cover[None], p_S[near]), self.kinds.size + k, i[near])
        return i

    @property
    def colors(self) -> Array:
        """(regions, 3) color of each."""
        kinds = np.r_[self.kinds.ravel(), np.full(len(self._covers), COVER)]
        return COLORS[kinds]

    @property
    def on_table(self) -> NDArray[np.bool_]:
        """(regions,) the region is bare table."""
        return np.r_[self.kinds.ravel() == TABLE, np.zeros(len(self._covers), bool)]


def _under(covers: Array, p_S: Array) -> NDArray[np.bool_]:
    """Points (..., 2) that any of some covers hides."""
    hidden = np.zeros(p_S.shape[:-1], dtype=bool)
    for x, y, a, b, angle in covers:
        c, s = np.cos(angle), np.sin(angle)
        dx, dy = p_S[..., 0] - x, p_S[..., 1] - y
        hidden |= (np.abs(c * dx + s * dy) < a) & (np.abs(c * dy - s * dx) < b)
    return hidden


def area_means(sheet: _Sheet, intrinsics: Intrinsics, X_SC: Array, samples: int = COARSE) -> Array:
    """(H, W, 3) linear light [0 to 1], averaged over each pixel's area."""
    h, w = intrinsics.height, intrinsics.width
    u, v = np.meshgrid(np.arange(w + 1) - 0.5, np.arange(h + 1) - 0.5)
    rays = _rays(intrinsics, np.stack([u, v], axis=-1)) @ X_SC[:3, :3].T
    if X_SC[2, 3] <= 0.0 or (rays[..., 2] > HORIZON).all():
        raise InvalidInputError("the camera must be above the table and look down at it")
    rays[..., 2] = np.minimum(rays[..., 2], HORIZON)  # the table goes on to the sky
    at = sheet.region(_on_plane(X_SC, rays).reshape(-1, 1, 2)).reshape(h + 1, w + 1)
    corners = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]])
    looks, kinds = np.unique(
        np.column_stack([light_of(sheet.colors), sheet.on_table]), axis=0, return_inverse=True
    )
    kinds = kinds.ravel().astype(np.int8)
    image = looks[kinds[corners[0]]]
    rows, columns = np.nonzero((corners != corners[0]).any(axis=0))
    mixed = _mixed(sheet.kinds, corners[:, rows, columns])
    rows, columns = rows[mixed], columns[mixed]
    fx, fy = _lattice(samples)
    for k in range(0, len(rows), CHUNK):
        r, c = rows[k : k + CHUNK, None, None], columns[k : k + CHUNK, None, None]
        across, down = fx[None, :, None], fy[None, :, None]
        # Within a pixel rays are straight enough even through a lens.
        above = rays[r, c, np.arange(3)] * (1 - across) + rays[r, c + 1, np.arange(3)] * across
        below = rays[r + 1, c, np.arange(3)] * (1 - across)
        below = below + rays[r + 1, c + 1, np.arange(3)] * across
        inside = kinds[sheet.region(_on_plane(X_SC, above * (1 - down) + below * down))]
        counts = np.stack([(inside == kind).sum(axis=1) for kind in range(len(looks))], axis=1)
        image[r[:, 0, 0], c[:, 0, 0]] = counts @ looks / samples
    p_S = _on_plane(X_SC, rays[:-1, :-1])
    return image[..., :3] + image[..., 3:] * _grain(p_S)[..., None]


def _mixed(kinds: NDArray[np.int_], regions: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(N,) whether something else than at points (M, N) may lie between them: if all look alike
    in the block of rectangles that they span, and it has two along x and along y at most, no."""
    i, j = np.divmod(np.minimum(regions, kinds.size - 1), kinds.shape[1])
    (y0, x0), (y1, x1) = (i.min(axis=0), j.min(axis=0)), (i.max(axis=0), j.max(axis=0))
    block = np.stack([kinds[y0, x0], kinds[y0, x1], kinds[y1, x0], kinds[y1, x1]])
    alike = (block == block[0]).all(axis=0) & (y1 - y0 <= 1) & (x1 - x0 <= 1)
    covered = (regions >= kinds.size).any(axis=0)
    return np.asarray(~alike | covered)


def _rays(intrinsics: Intrinsics, pixels: Array) -> Array:
    """(..., 3) directions in the camera's frame of pixels, with z = 1."""
    straight = (intrinsics.undistort(pixels) - intrinsics.center) / intrinsics.focal
    return np.concatenate([straight, np.ones((*straight.shape[:-1], 1))], axis=-1)


def _on_plane(X_SC: Array, rays_S: Array) -> Array:
    """(..., 2) points of the sheet's plane that rays from the camera meet [m]."""
    return X_SC[:2, 3] - X_SC[2, 3] * rays_S[..., :2] / rays_S[..., 2:]


def _lattice(samples: int) -> tuple[Array, Array]:
    """Points in a unit square that no edge of any direction runs along (a Fibonacci lattice)."""
    k = np.arange(samples)
    x, y = (k + 0.5) / samples, np.mod(k * GOLDEN, 1.0)
    return x, y + 0.5 - y.mean()


def _grain(p_S: Array) -> Array:
    """Grain of a wooden table, brighter and darker lines along x [linear light]."""
    x, y = p_S[..., 0], p_S[..., 1]
    wave = y + 0.004 * np.sin(9.0 * x) + 0.0015 * np.sin(31.0 * x + 40.0 * y)
    return 0.04 * np.sin(2 * np.pi * wave / 0.021) + 0.023 * np.sin(2 * np.pi * wave / 0.0083)
