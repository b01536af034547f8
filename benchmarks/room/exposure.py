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
from .paper import Array
from .sheet import Relief, Texture

sys.path.append(str(Path(__file__).parents[1]))
from oracle.compiled import compiled  # noqa: E402

PAPER, INK = 0.82, 0.035
"""Linear reflectance of white paper and of toner."""
SIDE = 4
"""Samples along a pixel's side."""


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


def radiance(camera: Camera, X_SC: Array, surface: Surface, side: int = SIDE) -> Array:
    """What the pixels receive.

    Args:
        camera: with its lens.
        X_SC: (N, R, 4, 4) optical frame of each of N moments of the exposure, and in each moment
            of R rows of the image; R is 1 for a camera that exposes all rows at once.
        surface: what is in sight.
        side: samples along a pixel's side at each moment; those of four moments that follow each
            other are staggered.

    Returns:
        (H, W, 3) radiance; 1 is that of a white surface in the middle of the board.
    """
    directions = corner_directions(camera)
    height, width = directions.shape[0] - 1, directions.shape[1] - 1
    if X_SC.shape[1] not in (1, height):
        raise ValueError(f"poses of {X_SC.shape[1]} rows, the image has {height}; give 1 or all")
    found = np.zeros((height, width, 3))
    poses = np.ascontiguousarray(X_SC[:, :, :3], dtype=float)
    _integrate(directions, poses, surface, side, found)
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
def _printed(texture: Texture, level: int, x: float, y: float, out: Array) -> None:
    """Reflectance times cover, and cover, at a point of the sheet."""
    width, height = texture.width[level], texture.height[level]
    scale = texture.per_metre / 2.0**level
    column = (x - texture.left) * scale - 0.5
    row = (texture.top - y) * scale - 0.5
    i, j = int(np.floor(row)), int(np.floor(column))
    out[:] = 0.0
    if i < -1 or j < -1 or i >= height or j >= width:
        return
    s, t = row - i, column - j
    for down in range(2):
        for right in range(2):
            if 0 <= i + down < height and 0 <= j + right < width:
                weight = (s if down else 1 - s) * (t if right else 1 - t) / 255.0
                at = texture.start[level] + (i + down) * width + j + right
                for k in range(4):
                    out[k] += weight * texture.texels[at, k]


@compiled
def _covering(cover: Cover, x: float, y: float, out: Array) -> None:
    """Radiance times cover, and cover, of what is above a point of its plane."""
    column, row = (x + AROUND) / GRID, (y + AROUND) / GRID
    i, j = int(np.floor(row)), int(np.floor(column))
    out[:] = 0.0
    if i < 0 or j < 0 or i + 1 >= cover.radiance.shape[0] or j + 1 >= cover.radiance.shape[1]:
        return
    s, t = row - i, column - j
    for down in range(2):
        for right in range(2):
            weight = (s if down else 1 - s) * (t if right else 1 - t) / 255.0
            for k in range(4):
                out[k] += weight * cover.radiance[i + down, j + right, k]


@compiled
def _toward(pose: Array, direction: Array, out: Array) -> None:
    for k in range(3):
        out[k] = pose[k, 0] * direction[0] + pose[k, 1] * direction[1] + pose[k, 2]


@compiled
def _level(directions: Array, pose: Array, v: int, u: int, spacing: float, finest: float) -> int:
    """The level whose texels are as large as the distance of samples on the sheet, or smaller."""
    p = np.empty((3, 2))
    ray = np.empty(3)
    for k in range(3):
        _toward(pose, directions[v + k // 2, u + k % 2], ray)
        if ray[2] > -1e-6:
            return 0
        t = -pose[2, 3] / ray[2]
        p[k, 0], p[k, 1] = pose[0, 3] + t * ray[0], pose[1, 3] + t * ray[1]
    a, b = p[1] - p[0], p[2] - p[0]
    area = abs(a[0] * b[1] - a[1] * b[0])
    return int(max(np.floor(np.log2(max(np.sqrt(area) * spacing * finest, 1.0))), 0.0))


@compiled
def _reflected(surface: Surface, level: int, C: Array, ray: Array, out: Array, layer: Array) -> None:
    """Radiance that a ray from a camera at C meets."""
    if ray[2] > -1e-6:
        out[:3] = 0.3
        return
    z = 0.0
    x, y = 0.0, 0.0
    relief = surface.relief
    for _ in range(3):
        t = (z - C[2]) / ray[2]
        x, y = C[0] + t * ray[0], C[1] + t * ray[1]
        z = _bilinear(relief.z, (y - relief.bottom) / relief.step, (x - relief.left) / relief.step)
    _printed(surface.texture, level, x, y, layer)
    ground = surface.ground
    cells = ground.reflectance.shape[0]
    i, j = int(np.floor(y * ground.per_metre)) % cells, int(np.floor(x * ground.per_metre)) % cells
    light = surface.light
    lit = _bilinear(
        light.values, (y - light.bottom) * light.per_metre, (x - light.left) * light.per_metre
    )
    shine = 0.0
    if surface.gloss.strength > 0.0:
        shine = PAPER * layer[3] * _shine(surface.gloss, x, y, C)
    for k in range(3):
        paper = INK * layer[3] + (PAPER - INK) * layer[k]
        out[k] = lit * (paper + (1 - layer[3]) * ground.reflectance[i, j, k]) + shine
    if surface.cover.height > 0.0:
        t = (surface.cover.height - C[2]) / ray[2]
        _covering(surface.cover, C[0] + t * ray[0], C[1] + t * ray[1], layer)
        for k in range(3):
            out[k] = (1 - layer[3]) * out[k] + layer[k]


@compiled
def _shine(gloss: Gloss, x: float, y: float, C: Array) -> float:
    a = np.array([gloss.lamp[0] - x, gloss.lamp[1] - y, gloss.lamp[2]])
    b = np.array([C[0] - x, C[1] - y, C[2]])
    half = a / np.sqrt((a * a).sum()) + b / np.sqrt((b * b).sum())
    return gloss.strength * (half[2] / np.sqrt((half * half).sum())) ** gloss.power


@compiled
def _integrate(directions: Array, poses: Array, surface: Surface, side: int, found: Array) -> None:
    moments, rows = poses.shape[:2]
    direction, ray, light, layer = np.empty(2), np.empty(3), np.empty(4), np.empty(4)
    texture = surface.texture
    spacing = 1.0 / side if moments == 1 else 0.5 / side
    share = 1.0 / (moments * side * side)
    for v in range(found.shape[0]):
        row = min(v, rows - 1)
        for u in range(found.shape[1]):
            level = _level(directions, poses[0, row], v, u, spacing, texture.per_metre)
            level = min(level, len(texture.start) - 1)
            corners = directions[v : v + 2, u : u + 2]
            for k in range(moments):
                pose = poses[k, row]
                stagger_u = 0.0 if moments == 1 else (k % 2 - 0.5) / (2 * side)
                stagger_v = 0.0 if moments == 1 else (k // 2 % 2 - 0.5) / (2 * side)
                for i in range(side):
                    b = (i + 0.5) / side + stagger_v
                    for j in range(side):
                        a = (j + 0.5) / side + stagger_u
                        for c in range(2):
                            above = (1 - a) * corners[0, 0, c] + a * corners[0, 1, c]
                            below = (1 - a) * corners[1, 0, c] + a * corners[1, 1, c]
                            direction[c] = (1 - b) * above + b * below
                        _toward(pose, direction, ray)
                        _reflected(surface, level, pose[:, 3], ray, light, layer)
                        for c in range(3):
                            found[v, u, c] += share * light[c]


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


