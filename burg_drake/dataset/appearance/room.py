"""A room around the table, as it is seen from there: walls with windows and furniture, ceiling with
lamps, floor. It is drawn once, as an image of all directions, and is far away for the camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from burg_drake.core import Array, Booleans, Bytes, Single, rng_from
from burg_drake.dataset.appearance.noise import layered_noise
from burg_drake.dataset.appearance.photometry import linear_from_srgb

ROWS = 512
"""Of the image of all directions; it has twice as many columns."""
TABLE_HEIGHT = 0.75
"""Usual height of tables [m]."""
NOISE = 512
KEPT = 4
"""Rooms that are kept for the next image."""
RADIANCE_ROWS = 64
"""Of the picture that a room lights a scene by."""
LAMPS, LAMP_GAIN = 0.98, 8.0
"""Pixels that are so bright, of lamps and windows, are so many times brighter than they look."""


@dataclass(frozen=True)
class Panel:
    """A rectangle on a wall.

    Attributes:
        left, right, bottom, top: along the wall from its middle, and above the floor [m].
        color: sRGB, from 0 to 1.
        stripes: upright ones of random tones, as books in a shelf; how many there are.
    """

    left: float
    right: float
    bottom: float
    top: float
    color: Array
    stripes: int = 0

    def paint(self, image: Array, s: Array, z: Array, rng: np.random.Generator) -> None:
        """Draws it where pixels (N, 3) lie in it, whose places on the wall are `s` and `z`."""
        inside = (s > self.left) & (s < self.right) & (z > self.bottom) & (z < self.top)
        tones = rng.uniform(0.5, 1.2, (max(1, self.stripes), 3))
        share = (s[inside] - self.left) / (self.right - self.left)
        stripe = np.minimum(share * len(tones), len(tones) - 1).astype(np.intp)
        image[inside] = self.color * (tones[stripe] if self.stripes else 1.0)


@lru_cache(maxsize=KEPT)
def environment_map(seed: int) -> Bytes:
    """A room as an image of all directions, which cannot be changed; the last ones are kept.

    Args:
        seed: of all that is random about it.

    Returns:
        (ROWS, 2 ROWS, 3) sRGB; see `directions` for where its pixels look.
    """
    rng = rng_from("room", seed)
    d_W = directions()
    half = np.array([rng.uniform(2.0, 4.5), rng.uniform(2.0, 4.5)])
    height = rng.uniform(2.5, 3.3)
    p_W = np.array([*(rng.uniform(-0.5, 0.5, 2) * half), TABLE_HEIGHT])
    upper = np.array([*half, height])
    lower = np.array([*-half, 0.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        away = np.where(d_W > 0.0, upper - p_W, lower - p_W) / d_W
    away = np.where(np.isfinite(away) & (away >= 0.0), away, np.inf)
    face, reach = away.argmin(axis=2), away.min(axis=2)
    p_WQ = p_W + reach[..., None] * d_W
    image = np.zeros_like(d_W)
    positive = np.take_along_axis(d_W, face[..., None], axis=2)[..., 0] > 0.0
    wall = np.array([rng.uniform(0.62, 0.9)] * 3) + rng.uniform(-0.06, 0.06, 3)
    windows = rng.permutation(4) < int(rng.integers(1, 3))
    for k in range(4):
        axis, side = k % 2, k < 2
        on = (face == axis) & (positive == side)
        s, z = p_WQ[on][:, 1 - axis], p_WQ[on][:, 2]
        tone = wall * rng.uniform(0.85, 1.0)
        image[on] = _wall(tone, s, z, float(half[1 - axis]), bool(windows[k]), rng)
    _floor(image, p_WQ, (face == 2) & ~positive, rng)
    _ceiling(image, p_WQ, (face == 2) & positive, half, rng)
    near_edge = np.sort(np.minimum(p_WQ - lower, upper - p_WQ), axis=2)[..., 1]
    image *= (1.0 - 0.35 * np.exp(-near_edge / 0.35))[..., None]
    blurred = _defocused(image, rng.uniform(0.8, 4.0))
    found = np.asarray(np.clip(blurred * 255.0 + 0.5, 0.0, 255.0), dtype=np.uint8)
    found.setflags(write=False)
    return found


def room_radiance(seed: int, irradiance: float) -> Single:
    """The light of a room.

    Args:
        seed: of the room.
        irradiance: of a table; with 1, what is white is white in the image.

    Returns:
        (RADIANCE_ROWS, 2 RADIANCE_ROWS, 3) linear, arranged as `environment_map`.
    """
    seen = environment_map(seed) / 255.0
    light = linear_from_srgb(seen)
    light[np.all(seen > LAMPS, axis=2)] *= LAMP_GAIN
    size = (2 * RADIANCE_ROWS, RADIANCE_ROWS)
    small = np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_AREA))
    up = directions(RADIANCE_ROWS)[..., 2]
    sine = np.sqrt(1.0 - up**2)  # the area of a pixel
    weight = np.maximum(up, 0.0) * sine
    table = (small.mean(axis=2) * weight).sum() / weight.sum()
    return np.asarray(small * (irradiance / table), dtype=np.float32)


def directions(rows: int = ROWS) -> Array:
    """(rows, 2 rows, 3) unit vectors in the world along which the pixels' centres look: the first
    row up, the middle of a row along x, and a quarter of the image to the left of it along y."""
    row = (np.arange(rows) + 0.5) / rows
    column = (np.arange(2 * rows) + 0.5) / (2 * rows)
    polar, azimuth = np.pi * row[:, None], 2.0 * np.pi * (0.5 - column)[None]
    flat = np.sin(polar)
    return np.stack(
        [flat * np.cos(azimuth), flat * np.sin(azimuth), np.cos(polar) + 0.0 * azimuth], axis=2
    )


def pixels_of(d_W: Array) -> Array:
    """(..., 2) column and row of the image of all directions where unit vectors (..., 3) in the
    world meet it, pixel centres at integers."""
    azimuth = np.arctan2(d_W[..., 1], d_W[..., 0])
    polar = np.arccos(np.clip(d_W[..., 2], -1.0, 1.0))
    column = (0.5 - azimuth / (2.0 * np.pi)) * 2 * ROWS - 0.5
    return np.stack([column, polar / np.pi * ROWS - 0.5], axis=-1)


def _wall(
    tone: Array, s: Array, z: Array, half: float, windows: bool, rng: np.random.Generator
) -> Array:
    """(N, 3) colours of places on a wall: `s` along it from its middle, `z` above the floor."""
    image = np.broadcast_to(tone, (len(s), 3)) * (0.9 + 0.06 * z[:, None])
    panels = _windows(half, rng) if windows else _furniture(half, rng)
    skirting = Panel(-half, half, 0.0, 0.08, tone * 0.7)
    for panel in (skirting, *panels):
        panel.paint(image, s, z, rng)
    return image


def _windows(half: float, rng: np.random.Generator) -> list[Panel]:
    """Bright panes in white frames."""
    found, count = [], int(rng.integers(1, 4))
    sky = np.array([0.9, 0.96, 1.0]) * rng.uniform(0.85, 1.1)
    bottom, top = rng.uniform(0.8, 1.1), rng.uniform(1.9, 2.4)
    width = 2.0 * half / count
    for k in range(count):
        left = -half + (k + 0.15) * width
        right = left + 0.7 * width
        frame = np.array([0.85, 0.85, 0.83])
        found.append(Panel(left - 0.06, right + 0.06, bottom - 0.06, top + 0.06, frame))
        middle = 0.5 * (left + right)
        ground = np.array([0.45, 0.5, 0.4]) * rng.uniform(0.8, 1.3)
        for a, b in ((left, middle - 0.03), (middle + 0.03, right)):
            found.append(Panel(a, b, bottom, top, sky))
            found.append(Panel(a, b, bottom, bottom + 0.25 * (top - bottom), ground))
    return found


def _furniture(half: float, rng: np.random.Generator) -> list[Panel]:
    """Cupboards, shelves, doors and pictures, side by side."""
    found, left = [], -half + rng.uniform(0.1, 0.6)
    while left < half - 0.5:
        width = min(rng.uniform(0.5, 1.3), half - 0.1 - left)
        color = rng.uniform(0.15, 0.8) * (1.0 + rng.uniform(-0.25, 0.25, 3))
        kind = int(rng.integers(4))
        if kind == 0:  # a door
            found.append(Panel(left, left + min(width, 0.9), 0.0, 2.0, 0.4 + 0.5 * color))
        elif kind == 1:  # a picture
            found.append(Panel(left, left + 0.7 * width, 1.2, 1.2 + 0.6 * width, color * 0.4))
            found.append(
                Panel(left + 0.03, left + 0.7 * width - 0.03, 1.23, 1.17 + 0.6 * width, color, 4)
            )
        else:  # a cupboard or a shelf
            top = rng.uniform(0.7, 2.1)
            found.append(Panel(left, left + width, 0.05, top, color))
            boards = int(top / 0.38) if kind == 2 else 0
            for k in range(boards):
                low = 0.1 + 0.38 * k
                books = int(rng.integers(6, 20))
                found.append(
                    Panel(left + 0.04, left + width - 0.04, low, low + 0.28, color * 0.9, books)
                )
        left += width + rng.uniform(0.05, 0.8)
    return found


def _floor(image: Array, p_WQ: Array, on: Booleans, rng: np.random.Generator) -> None:
    tone = rng.uniform(0.25, 0.6) * (1.0 + np.array([0.12, 0.0, -0.15]) * rng.uniform(-0.3, 1.0))
    spots = layered_noise(rng, NOISE, 8, 8, 5)
    x, y = (np.floor(p_WQ[on][:, :2] * 100.0).astype(np.intp) % NOISE).T
    boards = np.where((p_WQ[on][:, 0] / 0.18) % 1.0 < 0.04, 0.8, 1.0)
    image[on] = tone * ((0.8 + 0.4 * spots[y, x]) * boards)[:, None]


def _ceiling(
    image: Array, p_WQ: Array, on: Booleans, half: Array, rng: np.random.Generator
) -> None:
    """White, with rows of lamps."""
    p = p_WQ[on][:, :2]
    colors = np.broadcast_to(np.array([0.88, 0.87, 0.85]) * rng.uniform(0.85, 1.0), (len(p), 3))
    count, size = rng.integers(1, 4, 2), rng.uniform(0.1, 0.4, 2)
    share = (p / half + 1.0) * 0.5 * count
    from_middle = np.abs(share % 1.0 - 0.5) * 2.0 * half / count
    lamp = np.all(from_middle < size, axis=1)
    image[on] = np.where(lamp[:, None], 1.1, colors)


def _defocused(image: Array, sigma: float) -> Array:
    """The image out of focus; its columns go round."""
    margin = 32
    wide = np.concatenate([image[:, -margin:], image, image[:, :margin]], axis=1)
    return np.asarray(cv2.GaussianBlur(wide, (0, 0), sigma)[:, margin:-margin])
