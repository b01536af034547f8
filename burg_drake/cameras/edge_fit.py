"""Fits single edges of markers to the pixels across them.

A few pixels of the row or column that crosses an edge are compared with what they would show if
the edge were where it is predicted: the cells around it, blurred by lens and pixel. Brightness,
contrast and offset are fitted by linear least squares, to the pixels as they are: nothing is
resampled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from burg_drake.cameras.edge_views import EdgeViews
from burg_drake.cameras.marker_edges import AROUND, REACH, MarkerEdges
from burg_drake.core.frames import Array

WINDOW = np.arange(-3, 4)
"""Pixels that are looked at, from the one nearest to the edge's middle; every second of twice as
many where the image is blurred."""
BLURRED = 1.2
"""Variance from which on it is [pixels^2]."""
WIDE_CELL = 2.2
"""Cells of at least so many pixels keep what is two cells away out of the window."""
LEAST_CONTRAST = 1.0
"""Below it an offset means nothing; keeps the division finite [8-bit levels]."""


@dataclass(frozen=True, eq=False)
class EdgeFits:
    """Where edges were found.

    Attributes:
        offset: (N,) from the predicted place, along the gradient of u [pixels].
        contrast: (N,) white minus black [8-bit levels]; negative if colors are the wrong way round.
        information: (N,) inverse variance of the offset for noise that equals the contrast
            [1/pixels^2].
        noise: (N,) root mean square of what the fit leaves [8-bit levels].
        widening: (N, 2) numerator and denominator of the increase of the blur's variance that would
            fit the edge better [pixels^2].
    """

    offset: Array
    contrast: Array
    information: Array
    noise: Array
    widening: Array


def fit_edges(
    grey: NDArray[np.uint8], edges: MarkerEdges, views: EdgeViews, blur: float
) -> EdgeFits:
    """Fits brightness, contrast and offset of each edge.

    Args:
        grey: (H, W) image.
        edges: table.
        views: N of them.
        blur: variance of lens and pixel together [pixels^2].
    """
    in_row = (np.abs(views.across[:, 0]) >= np.abs(views.across[:, 1]))[:, None]
    nearest = np.rint(views.at).astype(np.intp)
    window = WINDOW if blur < BLURRED else 2 * WINDOW
    columns = nearest[:, :1] + np.where(in_row, window, 0)
    rows = nearest[:, 1:] + np.where(in_row, 0, window)
    dx, dy = columns - views.at[:, :1], rows - views.at[:, 1:]
    u = views.across[:, :1] * dx + views.across[:, 1:] * dy
    v = views.along[:, :1] * dx + views.along[:, 1:] * dy
    sigma = np.sqrt(blur)
    sigma_u = sigma * np.linalg.norm(views.across, axis=1, keepdims=True)
    sigma_v = sigma * np.linalg.norm(views.along, axis=1, keepdims=True)

    before, behind = ndtr((-0.5 - v) / sigma_v), ndtr((v - 0.5) / sigma_v)
    share = np.stack([before, 1.0 - before - behind, behind], axis=-1)  # of the rows of cells
    wide = (sigma_u * WIDE_CELL).max() < sigma
    reach = 1 if wide and blur < BLURRED else REACH
    near = slice(REACH - reach, REACH + reach + 1)
    steps = share @ edges.steps[views.which][:, :, near]
    z = (u[..., None] - AROUND[near]) / sigma_u[..., None]
    bell = steps * np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi)
    shape = (steps * ndtr(z)).sum(axis=-1)
    slope = bell.sum(axis=-1) / sigma  # derivatives by the distance in pixels
    bend = -(bell * z).sum(axis=-1) / blur
    return _fit(grey[rows, columns].astype(float), shape, slope, bend)


def _fit(values: Array, shape: Array, slope: Array, bend: Array) -> EdgeFits:
    """Least squares of `values = brightness + contrast (shape - offset slope)`, edge by edge."""
    values, shape, slope, bend = (
        part - part.mean(axis=1, keepdims=True) for part in (values, shape, slope, bend)
    )
    aa, ab, bb = (shape**2).sum(axis=1), (shape * slope).sum(axis=1), (slope**2).sum(axis=1)
    va, vb = (values * shape).sum(axis=1), (values * slope).sum(axis=1)
    det = np.maximum(aa * bb - ab**2, 1e-12)
    contrast = (va * bb - vb * ab) / det
    tilt = (vb * aa - va * ab) / det
    rest = values - contrast[:, None] * shape - tilt[:, None] * slope
    half_bend = 0.5 * contrast[:, None] * bend  # a Gaussian's derivative by its variance
    return EdgeFits(
        offset=-tilt / np.where(np.abs(contrast) < LEAST_CONTRAST, LEAST_CONTRAST, contrast),
        contrast=contrast,
        information=det / np.maximum(aa, 1e-12),
        noise=np.sqrt((rest**2).sum(axis=1) / (len(WINDOW) - 3)),
        widening=np.stack([(rest * half_bend).sum(axis=1), (half_bend**2).sum(axis=1)], axis=1),
    )
