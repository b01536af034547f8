"""Patterns of tables: wood, cloth, stone, and plain colours, made of noise."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

from burg_drake.core import Array, Bytes, InvalidInputError, rng_from
from burg_drake.dataset.appearance.appearance import Appearance, TableSurface
from burg_drake.dataset.appearance.noise import layered_noise, smooth_noise

PIXELS = 512
"""Of a texture along each side."""
EXTENT = {"wood": 0.8, "cloth": 0.32, "stone": 0.7, "plain": 0.8}
"""Side of the square of table that a texture covers; others follow without a seam [m]."""
WOODS = (
    ((0.80, 0.65, 0.46), (0.66, 0.49, 0.31)),
    ((0.62, 0.43, 0.27), (0.46, 0.29, 0.17)),
    ((0.44, 0.30, 0.21), (0.29, 0.18, 0.12)),
    ((0.86, 0.77, 0.62), (0.75, 0.63, 0.46)),
    ((0.55, 0.50, 0.45), (0.42, 0.37, 0.33)),
)
"""Light and dark tone of boards: beech, oak, walnut, birch, weathered; sRGB."""
BOARDS = (4, 5, 6, 8)
"""Side by side in one texture."""


def table_texture(appearance: Appearance) -> bytes:
    """The table's texture as a PNG of `PIXELS` x `PIXELS`, sRGB; opposite edges fit.

    Raises:
        InvalidInputError: the table has its own colour.
    """
    if appearance.table is None:
        raise InvalidInputError("the appearance has no pattern of the table, so it has no texture")
    image = _image(appearance.table)
    _, png = cv2.imencode(".png", np.ascontiguousarray(image[..., ::-1]))
    return bytes(png)


def _image(surface: TableSurface) -> Bytes:
    """(PIXELS, PIXELS, 3) sRGB."""
    rng = rng_from("table texture", surface.pattern, surface.seed)
    make = {"wood": _wood, "cloth": _cloth, "stone": _stone, "plain": _plain}
    image = make[surface.pattern](rng)
    return np.asarray(np.clip(image * 255.0 + 0.5, 0.0, 255.0), dtype=np.uint8)


def _wood(rng: np.random.Generator) -> Array:
    """Boards with their grain along x."""
    light, dark = (np.array(tone) for tone in WOODS[int(rng.integers(len(WOODS)))])
    boards = int(rng.choice(BOARDS))
    row = np.arange(PIXELS) * boards // PIXELS
    shift = rng.integers(PIXELS, size=boards)
    bend = layered_noise(rng, PIXELS, 6, 2, 3)
    fine = layered_noise(rng, PIXELS, 128, 4, 3)
    y = np.arange(PIXELS)[:, None] / PIXELS
    rings = 0.5 + 0.5 * np.sin(2.0 * np.pi * (14.0 * y + 5.0 * bend))
    grain = 0.55 * rings + 0.45 * fine
    columns = (np.arange(PIXELS)[None] + shift[row][:, None]) % PIXELS
    grain = np.take_along_axis(grain, columns, axis=1)
    tone = rng.uniform(-0.07, 0.07, boards)[row][:, None, None]
    image = light + (dark - light) * grain[..., None] + tone
    edge = np.minimum(np.arange(PIXELS) * boards % PIXELS, -np.arange(PIXELS) * boards % PIXELS)
    seam = np.clip(edge / (1.5 * boards), 0.35, 1.0)
    shaded: Array = image * seam[:, None, None]
    return shaded


def _cloth(rng: np.random.Generator) -> Array:
    """A weave, plain, striped or chequered."""
    ground, second = _color(rng, 0.35, (0.55, 0.92)), _color(rng, 0.6, (0.3, 0.8))
    image = np.broadcast_to(ground, (PIXELS, PIXELS, 3)).copy()
    kind, stripes = int(rng.integers(3)), int(rng.choice([4, 8, 16]))
    band = (np.arange(PIXELS) * stripes // PIXELS) % 2
    if kind:
        across = band[None, :] * (1.0 if kind == 1 else 0.5)
        along = band[:, None] * (0.0 if kind == 1 else 0.5)
        image += (across + along)[..., None] * (second - ground)
    y, x = np.mgrid[:PIXELS, :PIXELS] * (2.0 * np.pi * 128 / PIXELS)
    weave = np.sin(x) * np.sin(y)
    wrinkles = layered_noise(rng, PIXELS, 3, 3, 3) - 0.5
    threads = smooth_noise(rng, PIXELS, 256, 24) - 0.5
    woven: Array = image * (1.0 + 0.025 * weave + 0.12 * wrinkles + 0.05 * threads)[..., None]
    return woven


def _stone(rng: np.random.Generator) -> Array:
    """Grains of several tones, and veins."""
    ground = _color(rng, 0.12, (0.35, 0.85))
    clouds = layered_noise(rng, PIXELS, 4, 4, 6) - 0.5
    grains = smooth_noise(rng, PIXELS, 170, 170) - 0.5
    veins = np.abs(layered_noise(rng, PIXELS, 3, 3, 5) - 0.5)
    vein = np.clip(1.0 - veins / 0.02, 0.0, 1.0) * rng.uniform(0.0, 0.25)
    tone = 1.0 + 0.5 * clouds + rng.uniform(0.1, 0.5) * grains
    image: Array = ground * tone[..., None] + vein[..., None] * (0.95 - ground)
    return image


def _plain(rng: np.random.Generator) -> Array:
    """A colour, somewhat worn."""
    ground = _color(rng, 0.4, (0.15, 0.95))
    worn = layered_noise(rng, PIXELS, 4, 4, 6) - 0.5
    image: Array = ground * (1.0 + 0.08 * worn)[..., None]
    return image


def _color(rng: np.random.Generator, saturation: float, value: tuple[float, float]) -> Array:
    """(3,) a random sRGB colour; half of them are nearly grey."""
    most = saturation if rng.random() < 0.5 else 0.08
    return np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.0, most), rng.uniform(*value)))
