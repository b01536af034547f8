"""Surfaces and lines blended into an image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from burg_drake.cameras.overlay.antialiasing import strokes
from burg_drake.cameras.projection import NOTHING, SurfaceImage
from burg_drake.core import Array, Bytes

RIM = 1.2
"""Width of the dark rim on both sides of a line, which stands out from the board's white
[pixels]."""


def fill(image: Bytes, surface: SurfaceImage, colors: Array, opacity: float) -> None:
    """Blends surfaces into an image (H, W, 3), in place.

    Args:
        surface: what each pixel shows.
        colors: (N, 3) of the instances, 0 to 255.
        opacity: 0 to 1.
    """
    at = np.flatnonzero(surface.owner.ravel() != NOTHING)
    if not len(at) or opacity == 0.0:
        return
    weight = round(256 * opacity)
    # All colours that occur, times their weight; the row is 256 times the instance plus the shade.
    shaded = colors[:, None, :] * np.arange(256)[None, :, None] / 255.0
    table = np.round(weight * shaded).astype(np.uint16).reshape(-1, 3)
    row = surface.owner.ravel()[at].astype(np.int32) * 256 + surface.shade.ravel()[at]
    flat = image.reshape(-1, 3)
    mixed = np.take(flat, at, axis=0) * np.uint16(256 - weight)
    mixed += np.take(table, row, axis=0)
    mixed >>= 8
    flat[at] = mixed


@dataclass(frozen=True, eq=False)
class Ink:
    """Lines to be drawn.

    Attributes:
        ends: (N, 2, 2) of short lines [pixels].
        colors: (N, 3), 0 to 255.
        width: (N,) [pixels].
        opacity: (N,) 0 to 1.
        rim: (N,) opacity of the dark rim, 0 to 1.
    """

    ends: Array
    colors: Array
    width: Array
    opacity: Array
    rim: Array


def stroke(image: Bytes, inks: Sequence[Ink]) -> None:
    """Draws lines into an image (H, W, 3), in place; a pixel takes the nearest."""
    ends, colors, width, opacity, rim = (
        np.concatenate([getattr(ink, field.name) for ink in inks]) for field in fields(Ink)
    )
    drawn = width > 0.0
    ends, colors, width = ends[drawn], colors[drawn], width[drawn]
    if not len(ends):
        return
    pixels = strokes(ends, 0.5 * width, RIM + 0.5, (image.shape[1], image.shape[0]))
    flat = image.reshape(-1, 3)
    dark = rim[drawn][pixels.line] * pixels.cover(RIM)
    under = np.take(flat, pixels.at, axis=0) * (1.0 - dark[:, None])
    core = (opacity[drawn][pixels.line] * pixels.cover())[:, None]
    flat[pixels.at] = np.round(under + core * (colors[pixels.line] - under)).astype(np.uint8)
