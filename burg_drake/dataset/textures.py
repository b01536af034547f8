"""Table textures of wood, cloth, stone and plain colours, made of seamless noise."""

from __future__ import annotations

import colorsys

import numpy as np

from burg_drake.core import Array, Bytes, Indices, InvalidInputError, rng_from
from burg_drake.dataset.appearance import Appearance, TableSurface
from burg_drake.dataset.sample_encoding import encode_png


def smooth_noise(rng: np.random.Generator, size: int, rows: int, columns: int) -> Array:
    """Value noise: random numbers on a periodic grid, with smooth steps between them.

    Args:
        rng: random numbers.
        size: pixels along each side of the image.
        rows, columns: size of the grid.

    Returns:
        (size, size) from 0 to 1.
    """
    grid = rng.random((rows, columns))
    down, below, v = _interpolation_weights(size, rows)
    right, beside, u = _interpolation_weights(size, columns)
    upper = grid[down][:, right] * (1.0 - u) + grid[down][:, beside] * u
    lower = grid[below][:, right] * (1.0 - u) + grid[below][:, beside] * u
    return np.asarray(upper * (1.0 - v[:, None]) + lower * v[:, None])


def layered_noise(
    rng: np.random.Generator, size: int, rows: int, columns: int, layers: int = 5
) -> Array:
    """Sum of value noise on successively finer grids, each with half the amplitude.

    Returns:
        (size, size) from 0 to 1.
    """
    total, weight = np.zeros((size, size)), 0.0
    for k in range(layers):
        finer = (min(rows << k, size), min(columns << k, size))
        total += smooth_noise(rng, size, *finer) / 2**k
        weight += 1.0 / 2**k
    return total / weight


def _interpolation_weights(size: int, cells: int) -> tuple[Indices, Indices, Array]:
    """(size,) grid indices before and after each pixel, and its smooth weight between them."""
    place = (np.arange(size) + 0.5) * cells / size
    first = np.floor(place).astype(np.intp)
    share = place - first
    return first % cells, (first + 1) % cells, share * share * (3.0 - 2.0 * share)


TEXTURE_PIXELS = 512
"""Pixels along each side of a texture."""
TEXTURE_EXTENTS = {"wood": 0.8, "cloth": 0.32, "stone": 0.7, "plain": 0.8}
"""Side of a texture on the table in metres, by pattern."""
WOOD_TONES = (
    ((0.80, 0.65, 0.46), (0.66, 0.49, 0.31)),
    ((0.62, 0.43, 0.27), (0.46, 0.29, 0.17)),
    ((0.44, 0.30, 0.21), (0.29, 0.18, 0.12)),
    ((0.86, 0.77, 0.62), (0.75, 0.63, 0.46)),
    ((0.55, 0.50, 0.45), (0.42, 0.37, 0.33)),
)
"""Light and dark tones (sRGB) of beech, oak, walnut, birch and weathered wood."""


def table_texture(appearance: Appearance) -> bytes:
    """Seamless texture of the table, an sRGB PNG of `TEXTURE_PIXELS` x `TEXTURE_PIXELS`.

    Raises:
        InvalidInputError: the appearance has no table pattern.
    """
    if appearance.table is None:
        raise InvalidInputError("the appearance has no pattern of the table, so it has no texture")
    return encode_png(_texture_image(appearance.table))


def _texture_image(surface: TableSurface) -> Bytes:
    """(TEXTURE_PIXELS, TEXTURE_PIXELS, 3) sRGB."""
    rng = rng_from("table texture", surface.pattern, surface.seed)
    make = {
        "wood": _wood_texture,
        "cloth": _cloth_texture,
        "stone": _stone_texture,
        "plain": _plain_texture,
    }
    image = make[surface.pattern](rng)
    return np.asarray(np.clip(image * 255.0 + 0.5, 0.0, 255.0), dtype=np.uint8)


def _wood_texture(rng: np.random.Generator) -> Array:
    """Wooden boards with their grain along x."""
    board_counts = (4, 5, 6, 8)  # Wooden boards side by side in one texture.
    light, dark = (np.array(tone) for tone in WOOD_TONES[int(rng.integers(len(WOOD_TONES)))])
    boards = int(rng.choice(board_counts))
    row = np.arange(TEXTURE_PIXELS) * boards // TEXTURE_PIXELS
    shift = rng.integers(TEXTURE_PIXELS, size=boards)
    bend = layered_noise(rng, TEXTURE_PIXELS, 6, 2, 3)
    fine = layered_noise(rng, TEXTURE_PIXELS, 128, 4, 3)
    y = np.arange(TEXTURE_PIXELS)[:, None] / TEXTURE_PIXELS
    rings = 0.5 + 0.5 * np.sin(2.0 * np.pi * (14.0 * y + 5.0 * bend))
    grain = 0.55 * rings + 0.45 * fine
    columns = (np.arange(TEXTURE_PIXELS)[None] + shift[row][:, None]) % TEXTURE_PIXELS
    grain = np.take_along_axis(grain, columns, axis=1)
    tone = rng.uniform(-0.07, 0.07, boards)[row][:, None, None]
    image = light + (dark - light) * grain[..., None] + tone
    edge = np.minimum(
        np.arange(TEXTURE_PIXELS) * boards % TEXTURE_PIXELS,
        -np.arange(TEXTURE_PIXELS) * boards % TEXTURE_PIXELS,
    )
    seam = np.clip(edge / (1.5 * boards), 0.35, 1.0)
    return np.asarray(image * seam[:, None, None])


def _cloth_texture(rng: np.random.Generator) -> Array:
    """A plain, striped or chequered weave."""
    ground, second = _random_color(rng, 0.35, (0.55, 0.92)), _random_color(rng, 0.6, (0.3, 0.8))
    image = np.broadcast_to(ground, (TEXTURE_PIXELS, TEXTURE_PIXELS, 3)).copy()
    kind, stripes = int(rng.integers(3)), int(rng.choice([4, 8, 16]))
    band = (np.arange(TEXTURE_PIXELS) * stripes // TEXTURE_PIXELS) % 2
    if kind:
        across = band[None, :] * (1.0 if kind == 1 else 0.5)
        along = band[:, None] * (0.0 if kind == 1 else 0.5)
        image += (across + along)[..., None] * (second - ground)
    y, x = np.mgrid[:TEXTURE_PIXELS, :TEXTURE_PIXELS] * (2.0 * np.pi * 128 / TEXTURE_PIXELS)
    weave = np.sin(x) * np.sin(y)
    wrinkles = layered_noise(rng, TEXTURE_PIXELS, 3, 3, 3) - 0.5
    threads = smooth_noise(rng, TEXTURE_PIXELS, 256, 24) - 0.5
    return np.asarray(image * (1.0 + 0.025 * weave + 0.12 * wrinkles + 0.05 * threads)[..., None])


def _stone_texture(rng: np.random.Generator) -> Array:
    """Stone with grains of several tones, and veins."""
    ground = _random_color(rng, 0.12, (0.35, 0.85))
    clouds = layered_noise(rng, TEXTURE_PIXELS, 4, 4, 6) - 0.5
    grains = smooth_noise(rng, TEXTURE_PIXELS, 170, 170) - 0.5
    veins = np.abs(layered_noise(rng, TEXTURE_PIXELS, 3, 3, 5) - 0.5)
    vein = np.clip(1.0 - veins / 0.02, 0.0, 1.0) * rng.uniform(0.0, 0.25)
    tone = 1.0 + 0.5 * clouds + rng.uniform(0.1, 0.5) * grains
    return np.asarray(ground * tone[..., None] + vein[..., None] * (0.95 - ground))


def _plain_texture(rng: np.random.Generator) -> Array:
    """A plain, slightly worn surface."""
    ground = _random_color(rng, 0.4, (0.15, 0.95))
    worn = layered_noise(rng, TEXTURE_PIXELS, 4, 4, 6) - 0.5
    return np.asarray(ground * (1.0 + 0.08 * worn)[..., None])


def _random_color(rng: np.random.Generator, saturation: float, value: tuple[float, float]) -> Array:
    """Draws an sRGB colour (3,); half of the colours are nearly grey."""
    max_saturation = saturation if rng.random() < 0.5 else 0.08
    return np.array(
        colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.0, max_saturation), rng.uniform(*value))
    )
