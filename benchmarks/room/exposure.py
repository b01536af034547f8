"""Light that reaches each pixel: integrated over its area and the time of exposure.

For every sample a ray goes through the lens to the sheet, at the pose of its moment; what is
printed there is filtered to the distance of the samples.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .covers import Cover
from .lens import Camera, corner_directions
from .light import AROUND, GRID, Map
from .paper import Array, Image
from .sheet import Relief, Texture

sys.path.append(str(Path(__file__).parents[1]))
from oracle.compiled import compiled

PAPER, INK = 0.82, 0.035
"""Linear reflectance of white paper and of toner."""
SIDE = 4
"""Samples along a pixel's side."""
ABOVE = 0.3
"""Radiance of the room above the table's horizon."""

Three = tuple[float, float, float]
Four = tuple[float, float, float, float]


class Ground(NamedTuple):
    """The table around the sheet.

    Attributes:
        reflectance: (S, S, 3) linear, repeated without end.
        per_metre: cells [1/m].
    """

    reflectance: NDArray[np.float32]
    per_metre: float


class Gloss(NamedTuple):
    """Mirror-like light of the lamp on the paper, as Blinn has it.

    Attributes:
        strength: radiance in the middle of the spot over that of white paper.
        power: the higher, the smaller the spot.
        lamp: (3,) in S [m].
    """

    strength: float
    power: float
    lamp: Array


class Surface(NamedTuple):
    """All that a ray may meet.

    Attributes: texture, relief, ground, light (a map of irradiance), cover and gloss.
    """

    texture: Texture
    relief: Relief
    ground: Ground
    light: Map
    cover: Cover
    gloss: Gloss


def radiance(
    camera: Camera,
    X_SC: Array,
    surface: Surface,
    side: int = SIDE,
    hidden: NDArray[np.uint16] | None = None,
) -> Array:
    """What the pixels receive.

    Args:
        camera: with its lens.
        X_SC: (N, R, 4, 4) optical frame of each of N moments of the exposure, and in each moment
            of R rows of the image; R is 1 for a camera that exposes all rows at once.
        surface: what is in sight.
        side: samples along a pixel's side at each moment; those of four moments that follow each
            other are staggered.
        hidden: (H, W) samples of each pixel that something else hides, and that are black: a bit
            each, row by row; of one moment and 16 samples at most.

    Returns:
        (H, W, 3) radiance; 1 is that of a white surface in the middle of the board.
    """
    directions = corner_directions(camera)
    height, width = directions.shape[0] - 1, directions.shape[1] - 1
    if X_SC.shape[1] not in (1, height):
        raise ValueError(f"poses of {X_SC.shape[1]} rows, the image has {height}; give 1 or all")
    if hidden is None:
        hidden = np.zeros((height, width), np.uint16)
    found = np.zeros((height, width, 3))
    poses = np.ascontiguousarray(X_SC[:, :, :3], dtype=float)
    _integrate(directions, poses, surface, side, hidden, found)
    return found


@compiled
def _bilinear(values: NDArray[np.float32], row: float, column: float) -> float:
    row = min(max(row, 0.0), values.shape[0] - 1.001)
    column = min(max(column, 0.0), values.shape[1] - 1.001)
    i, j = int(row), int(column)
    s, t = row - i, column - j
    lower = (1 - t) * values[i, j] + t * values[i, j + 1]
    upper = (1 - t) * values[i + 1, j] + t * values[i + 1, j + 1]
    return (1 - s) * lower + s * upper


@compiled
def _mixed(texels: Image, start: int, width: int, height: int, row: float, column: float) -> Four:
    """The four values of texels, bilinear; 0 beyond them."""
    i, j = int(np.floor(row)), int(np.floor(column))
    if i < 0 or j < 0 or i + 1 >= height or j + 1 >= width:
        return 0.0, 0.0, 0.0, 0.0
    s, t = row - i, column - j
    at = start + i * width + j
    a, b = (1 - s) * (1 - t) / 255.0, (1 - s) * t / 255.0
    c, d = s * (1 - t) / 255.0, s * t / 255.0
    p, q, u, v = at, at + 1, at + width, at + width + 1
    return (
        a * texels[p, 0] + b * texels[q, 0] + c * texels[u, 0] + d * texels[v, 0],
        a * texels[p, 1] + b * texels[q, 1] + c * texels[u, 1] + d * texels[v, 1],
        a * texels[p, 2] + b * texels[q, 2] + c * texels[u, 2] + d * texels[v, 2],
        a * texels[p, 3] + b * texels[q, 3] + c * texels[u, 3] + d * texels[v, 3],
    )


@compiled
def _level(x: Three, y: Three, per_metre: float, most: int) -> int:
    """The level whose texels are as large as the distance of samples on the sheet, or smaller.

    Args:
        x, y: of three points of the sheet, a sample apart along the rows and columns.
        per_metre: texels of level 0.
        most: the coarsest level.
    """
    area = abs((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))
    texels = max(np.sqrt(area) * per_metre, 1.0)
    return int(min(np.floor(np.log2(texels)), most))


@compiled
def _shine(strength: float, power: float, toward: Array, x: float, y: float, C: Three) -> float:
    """Gloss at a point of the sheet for a lamp and a camera at C."""
    a0, a1, a2 = toward[0] - x, toward[1] - y, toward[2]
    b0, b1, b2 = C[0] - x, C[1] - y, C[2]
    a = 1.0 / np.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    b = 1.0 / np.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
    h0, h1, h2 = a * a0 + b * b0, a * a1 + b * b1, a * a2 + b * b2
    return strength * (h2 / np.sqrt(h0 * h0 + h1 * h1 + h2 * h2)) ** power


@compiled
def _on_plane(X: Array, x: float, y: float, z: float) -> Three:
    """Where the ray of a direction meets the plane of height z, and its slope; far away for rays
    that do not."""
    down = X[2, 0] * x + X[2, 1] * y + X[2, 2]
    t = (z - X[2, 3]) / min(down, -1e-6)
    return (
        X[0, 3] + t * (X[0, 0] * x + X[0, 1] * y + X[0, 2]),
        X[1, 3] + t * (X[1, 0] * x + X[1, 1] * y + X[1, 2]),
        down,
    )


@compiled
def _integrate(
    directions: Array,
    poses: Array,
    surface: Surface,
    side: int,
    hidden: NDArray[np.uint16],
    found: Array,
) -> None:
    moments, rows = poses.shape[:2]
    texels, start, widths, heights, left, top, per_metre = surface.texture
    relief, relief_left, relief_bottom, step = surface.relief
    ground, ground_per_metre = surface.ground
    lights, light_left, light_bottom, light_per_metre = surface.light
    cover, cover_height = surface.cover
    strength, power, lamp = surface.gloss
    over = cover.reshape(-1, 4)
    rough = relief.min() != 0.0 or relief.max() != 0.0
    cells = ground.shape[0]
    apart = 1.0 / side if moments == 1 else 0.5 / side
    share = 1.0 / (moments * side * side)
    for v in range(found.shape[0]):
        row = min(v, rows - 1)
        for u in range(found.shape[1]):
            x0, y0 = directions[v, u, 0], directions[v, u, 1]
            ax, ay = directions[v, u + 1, 0] - x0, directions[v, u + 1, 1] - y0
            bx, by = directions[v + 1, u, 0] - x0, directions[v + 1, u, 1] - y0
            cx = directions[v + 1, u + 1, 0] - x0 - ax - bx
            cy = directions[v + 1, u + 1, 1] - y0 - ay - by
            P = _on_plane(poses[0, row], x0, y0, 0.0)
            Q = _on_plane(poses[0, row], x0 + apart * ax, y0 + apart * ay, 0.0)
            R = _on_plane(poses[0, row], x0 + apart * bx, y0 + apart * by, 0.0)
            level = _level((P[0], Q[0], R[0]), (P[1], Q[1], R[1]), per_metre, len(start) - 1)
            first, width, height = start[level], widths[level], heights[level]
            scale = per_metre / 2.0**level
            red, green, blue = 0.0, 0.0, 0.0
            for k in range(moments):
                X = poses[k, row]
                C = X[0, 3], X[1, 3], X[2, 3]
                stagger_u, stagger_v = 0.0, 0.0
                if moments > 1:  # the same forwards and backwards, so as not to add to the motion
                    turn = min(k, moments - 1 - k)
                    stagger_u = (turn % 2 - 0.5) / (2 * side)
                    stagger_v = (turn // 2 % 2 - 0.5) / (2 * side)
                for i in range(side * side):
                    if (hidden[v, u] >> min(i, 15)) & 1:
                        continue
                    a = (i % side + 0.5) / side + stagger_u
                    b = (i // side + 0.5) / side + stagger_v
                    dx = x0 + a * ax + b * bx + a * b * cx
                    dy = y0 + a * ay + b * by + a * b * cy
                    x, y, down = _on_plane(X, dx, dy, 0.0)
                    if down > -1e-6:
                        red, green, blue = red + ABOVE, green + ABOVE, blue + ABOVE
                        continue
                    if rough:
                        for _ in range(3):
                            z = _bilinear(
                                relief, (y - relief_bottom) / step, (x - relief_left) / step
                            )
                            x, y, down = _on_plane(X, dx, dy, z)
                    r, g, m, paper = _mixed(
                        texels, first, width, height, (top - y) * scale - 0.5,
                        (x - left) * scale - 0.5,
                    )  # fmt: skip
                    r = INK * paper + (PAPER - INK) * r
                    g = INK * paper + (PAPER - INK) * g
                    m = INK * paper + (PAPER - INK) * m
                    if paper < 1.0:
                        i_cell = int(np.floor(y * ground_per_metre)) % cells
                        j_cell = int(np.floor(x * ground_per_metre)) % cells
                        r += (1 - paper) * ground[i_cell, j_cell, 0]
                        g += (1 - paper) * ground[i_cell, j_cell, 1]
                        m += (1 - paper) * ground[i_cell, j_cell, 2]
                    lit = _bilinear(
                        lights,
                        (y - light_bottom) * light_per_metre,
                        (x - light_left) * light_per_metre,
                    )
                    r, g, m = lit * r, lit * g, lit * m
                    if strength > 0.0:
                        shine = PAPER * paper * _shine(strength, power, lamp, x, y, C)
                        r, g, m = r + shine, g + shine, m + shine
                    if cover_height > 0.0:
                        x, y, down = _on_plane(X, dx, dy, cover_height)
                        o = _mixed(
                            over, 0, cover.shape[1], cover.shape[0], (y + AROUND) / GRID,
                            (x + AROUND) / GRID,
                        )  # fmt: skip
                        r = (1 - o[3]) * r + o[0]
                        g = (1 - o[3]) * g + o[1]
                        m = (1 - o[3]) * m + o[2]
                    red, green, blue = red + r, green + g, blue + m
            found[v, u, 0] = share * red
            found[v, u, 1] = share * green
            found[v, u, 2] = share * blue


def table(rng: np.random.Generator) -> Ground:
    """A table top, bright or dark, with a grain."""
    import cv2

    noise = rng.normal(size=(256, 256)).astype(np.float32)
    grain = cv2.GaussianBlur(noise, None, 12.0, sigmaY=1.5, borderType=cv2.BORDER_REFLECT)
    grain /= np.abs(grain).max()
    color = rng.uniform(0.04, 0.6) * np.array([1.0, rng.uniform(0.6, 1.0), rng.uniform(0.4, 1.0)])
    reflectance: Any = color * (1.0 + 0.35 * grain[..., None])
    return Ground(reflectance.astype(np.float32), 1 / 1.5e-3)


def no_gloss() -> Gloss:
    """Of matt paper."""
    return Gloss(0.0, 1.0, np.zeros(3))
