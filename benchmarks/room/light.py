"""Lamps, and the shadows of what stands in their way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .paper import Array

GRID = 0.5e-3
"""Of maps on the table [m]."""
AROUND = 0.1
"""How far maps reach beyond the board [m]; what is further has the value of their edge."""


class Map(NamedTuple):
    """Values on the plane z = 0, bilinear between the middles of cells.

    Attributes:
        values: (R, C) row 0 at the least y.
        left, bottom: of the middle of the first cell [m].
        per_metre: cells [1/m].
    """

    values: NDArray[np.float32]
    left: float
    bottom: float
    per_metre: float


@dataclass(frozen=True)
class Shadow:
    """A flat thing that keeps a lamp's light from the table.

    Attributes:
        corners: (M, 3) of a convex polygon above the board, in S [m].
    """

    corners: tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class Light:
    """What lights the room.

    Attributes:
        ambient: share of the light that comes from everywhere; the rest is the lamp's.
        lamp: where it is, in S [m].
        radius: of the lamp [m]; of 0 its shadows are hard.
        shadows: of what is in the way.
    """

    ambient: float = 0.5
    lamp: tuple[float, float, float] = (0.3, 0.2, 2.0)
    radius: float = 0.0
    shadows: tuple[Shadow, ...] = ()


def grid(size: tuple[float, float]) -> Array:
    """(R, C, 2) middles of a map's cells around a board."""
    x, y = (np.arange(-AROUND, s + AROUND, GRID) for s in size)
    return np.stack(np.meshgrid(x, y), axis=-1)


def map_of(values: Array) -> Map:
    """The map of values on a `grid`."""
    return Map(values.astype(np.float32), -AROUND, -AROUND, 1 / GRID)


def irradiance(light: Light, size: tuple[float, float]) -> Array:
    """(R, C) light on the table over that in the middle of the board without shadows."""
    p = grid(size)
    return light.ambient + (1 - light.ambient) * _of_lamp(light, size, p) * _lit(light, p)


def lamp_light(light: Light, size: tuple[float, float], p: Array) -> Array:
    """(...,) the same at points (..., 2) without shadows."""
    return light.ambient + (1 - light.ambient) * _of_lamp(light, size, p)


def shadow_of(light: Light, shadow: Shadow) -> Array:
    """(M, 2) corners of the shadow that a point-like lamp casts on z = 0 [m]."""
    lamp, corners = np.array(light.lamp), np.array(shadow.corners)
    share = lamp[2] / (lamp[2] - corners[:, 2:])
    return (lamp + share * (corners - lamp))[:, :2]


def _of_lamp(light: Light, size: tuple[float, float], p: Array) -> Array:
    """Falls off by the cosine and the square of the distance."""
    x, y, z = light.lamp

    def fall(p: Array) -> Array:
        return ((p[..., 0] - x) ** 2 + (p[..., 1] - y) ** 2 + z * z) ** -1.5

    return fall(p) / fall(np.array(size) / 2)


def _lit(light: Light, p: Array) -> Array:
    """(R, C) share of the lamp that a point sees."""
    lit = np.ones(p.shape[:2])
    for shadow in light.shadows:
        corners = shadow_of(light, shadow)
        height = np.mean([c[2] for c in shadow.corners])
        width = max(2 * light.radius * height / (light.lamp[2] - height), GRID)
        along = np.roll(corners, -1, axis=0) - corners
        sense = np.sign(along[0, 0] * along[1, 1] - along[0, 1] * along[1, 0])
        outward = sense * np.stack([along[:, 1], -along[:, 0]], axis=-1)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        away = np.max(
            [
                (p[..., 0] - c[0]) * n[0] + (p[..., 1] - c[1]) * n[1]
                for c, n in zip(corners, outward, strict=True)
            ],
            axis=0,
        )
        lit *= np.clip(0.5 + away / width, 0.0, 1.0)
    return lit
