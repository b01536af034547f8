"""What lies or moves over the board: hands, and flat things such as books and tools."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .light import AROUND, GRID, Light, grid, lamp_light
from .paper import Array, Board, Image

HAND_HEIGHT = 0.02
"""Of a hand's back over the board [m]."""
THING_HEIGHT = 0.004
SKIN = ((0.58, 0.34, 0.24), (0.42, 0.22, 0.14), (0.20, 0.10, 0.06))
"""Linear reflectance of three skins."""
SOFT = 0.7e-3
"""Standard deviation of a hand's edge [m]."""
SHARE_STEP = 2e-3
FRACTION = 4
"""Binary digits of the fractions of a cell that drawing takes."""


class Cover(NamedTuple):
    """A flat layer over the board.

    Attributes:
        radiance: (R, C, 4) what it sends to the camera [1/255] times cover, and cover; cells as in
            a `Map`.
        height: over z = 0 [m].
    """

    radiance: Image
    height: float


def nothing() -> Cover:
    """Of an empty board."""
    return Cover(np.zeros((1, 1, 4), np.uint8), 0.0)


def hand(light: Light, size: tuple[float, float], rng: np.random.Generator) -> Cover:
    """A hand that reaches over the board: forearm, palm, fingers and thumb, of capsules."""
    middle = rng.uniform(0.25, 0.75, 2) * size
    heading = rng.uniform(0, 2 * np.pi)
    along, aside = (np.array([np.cos(a), np.sin(a)]) for a in (heading, heading + np.pi / 2))
    thumb = rng.choice([-1.0, 1.0])

    def at(forward: float, left: float) -> Array:
        return middle + forward * along + thumb * left * aside

    capsules = [
        (at(-0.32, 0.0), at(-0.04, 0.0), 0.030),
        (at(-0.02, 0.012), at(0.035, 0.012), 0.028),
    ]
    capsules += [(at(-0.02, -0.012), at(0.03, -0.012), 0.028)]
    for k, length in enumerate((0.065, 0.075, 0.070, 0.055)):
        root = 0.033 - 0.022 * k
        spread = np.radians(8.0 - 6.0 * k + rng.uniform(-3, 3))
        reach = length * rng.uniform(0.75, 1.0)
        tip = at(0.05 + reach * np.cos(spread), root + reach * np.sin(spread))
        capsules.append((at(0.045, root), tip, 0.0085))
    capsules.append((at(0.0, 0.03), at(0.035, 0.075), 0.011))
    alpha = np.zeros(grid(size).shape[:2], np.uint8)
    for start, end, radius in capsules:
        ends = [
            tuple(((p + AROUND) / GRID * 2**FRACTION).astype(int).tolist()) for p in (start, end)
        ]
        cv2.line(alpha, *ends, 255, round(2 * radius / GRID), cv2.LINE_AA, FRACTION)
    alpha = cv2.GaussianBlur(alpha, None, SOFT / GRID)
    round_shade = cv2.blur(cv2.blur(alpha, (25, 25)), (25, 25)) / 255.0
    skin = np.array(SKIN[rng.integers(len(SKIN))])
    color = (alpha * (0.55 + 0.45 * round_shade))[..., None] * skin
    drawn = np.dstack([np.round(color).astype(np.uint8), alpha])
    return Cover(_lit(drawn, light, size), HAND_HEIGHT)


def things(
    board: Board, seen: NDArray[np.bool_], share: float, light: Light, rng: np.random.Generator
) -> tuple[Cover, float]:
    """Rectangles as of books, boxes and tools that cover a share of the markers' area.

    Args:
        board: with the markers.
        seen: (N,) markers that count.
        share: of their area.
        light: on them.
        rng: where they lie.

    Returns:
        The layer, and the share that it covers, within 0.03 of what was asked.
    """
    inner = (np.arange(SHARE_STEP / 2, board.side, SHARE_STEP)) / board.side
    u, v = np.meshgrid(inner, inner)
    corners = board.p_SQ[seen]
    across, down = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    p = corners[:, 0, None] + u.reshape(-1, 1) * across[:, None] + v.reshape(-1, 1) * down[:, None]
    p = p.reshape(-1, 2)
    hidden = np.zeros(len(p), bool)
    shape = grid(board.size).shape[:2]
    drawn = np.zeros((*shape, 4), np.uint8)
    size = 0.5
    while abs(hidden.mean() - share) > 0.03:
        middle = p[rng.choice(np.flatnonzero(~hidden))]
        half = rng.uniform(0.02, 0.20, 2) * size
        angle = rng.uniform(0, np.pi)
        axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        below = (np.abs((p - middle) @ axes.T) < half).all(axis=1)
        if (hidden | below).mean() > share + 0.03:
            size *= 0.9
            continue
        hidden |= below
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        outline = middle + (signs * half) @ axes
        cells = np.round((outline + AROUND) / GRID * 2**FRACTION).astype(np.int32)
        color = 255.0 * rng.uniform(0.02, 0.9) * rng.uniform(0.3, 1.0, 3)
        cv2.fillConvexPoly(drawn, cells, (*color.tolist(), 255.0), cv2.LINE_AA, FRACTION)
    return Cover(_lit(drawn, light, board.size), THING_HEIGHT), float(hidden.mean())


def shadow_below(cover: Cover, light: Light) -> Array:
    """(R, C) share of the lamp that a layer keeps from the table, with a soft edge."""
    share = light.lamp[2] / (light.lamp[2] - cover.height)
    x, y = ((light.lamp[k] + AROUND) / GRID for k in (0, 1))
    grow = np.array([[share, 0, (1 - share) * x], [0, share, (1 - share) * y]])
    alpha = cover.radiance[..., 3]
    shadow = cv2.warpAffine(alpha, grow, alpha.shape[::-1])
    soft = max(light.radius * cover.height / light.lamp[2] / GRID, 0.5)
    return cv2.GaussianBlur(shadow, None, soft) / 255.0


def _lit(reflectance: Image, light: Light, size: tuple[float, float]) -> Image:
    """(R, C, 4) radiance of a layer of that reflectance, both times cover [1/255]."""
    lamp = lamp_light(light, size, grid(size)).astype(np.float32)
    lit = [cv2.multiply(reflectance[..., k], lamp, dtype=cv2.CV_8U) for k in range(3)]
    return np.dstack([*lit, reflectance[..., 3]])
