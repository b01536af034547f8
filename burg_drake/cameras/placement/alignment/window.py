"""Parts of an image, seen by a finer or coarser raster."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.core import Array


@dataclass(frozen=True)
class Window:
    """A part of an image, seen by a finer or coarser raster; pixel centres at integers.

    Attributes:
        left, top: first column and row of the image.
        width, height: columns and rows of the image.
        scale: raster pixels per pixel of the image, each way.
    """

    left: int
    top: int
    width: int
    height: int
    scale: float = 1.0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the raster."""
        return round(self.height * self.scale), round(self.width * self.scale)

    def scaled(self, scale: float) -> Window:
        """The same part, seen by a raster of another scale."""
        return replace(self, scale=scale)

    def pixels(self) -> Array:
        """(H, W, 2) image points of the raster's pixels."""
        v, u = np.mgrid[: self.shape[0], : self.shape[1]]
        return self.image(np.stack([u, v], axis=-1))

    def raster(self, pixels: Array) -> Array:
        """(..., 2) raster coordinates of image points."""
        return (pixels - (self.left - 0.5, self.top - 0.5)) * self.scale - 0.5

    def image(self, raster: Array) -> Array:
        """(..., 2) image points of raster coordinates."""
        return (raster + 0.5) / self.scale + (self.left - 0.5, self.top - 0.5)


def window_around(pixels: Array, margin: float, size: tuple[int, int], scale: float) -> Window:
    """The window of an image around some of its points; empty if all are outside.

    Args:
        pixels: (N, 2).
        margin: around them [pixels].
        size: width and height of the image.
        scale: of the window's raster.
    """
    low = np.floor(pixels.min(axis=0) - margin).astype(int)
    high = np.ceil(pixels.max(axis=0) + margin).astype(int) + 1
    low, high = np.clip(low, 0, size), np.clip(high, 0, size)
    width, height = np.maximum(high - low, 0)
    return Window(int(low[0]), int(low[1]), int(width), int(height), scale)
