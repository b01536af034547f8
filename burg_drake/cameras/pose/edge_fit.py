"""Fits single edges of markers to the pixels across them.

A few pixels of the row or column that crosses an edge are compared with what they would show if
the edge were where it is predicted: the cells around it, blurred by lens, motion and pixel.
Brightness, contrast and offset are fitted by linear least squares, to the pixels as they are:
nothing is resampled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.pose.edge_projection import EdgeViews
from burg_drake.cameras.pose.edges import AROUND, REACH, MarkerEdges
from burg_drake.core import Array

WINDOW = np.arange(-3, 4)
"""Pixels that are looked at, from the one nearest to the edge's middle; every second of twice as
many where the image is blurred."""
BLURRED = 1.2
"""Variance from which on it is [pixels^2]."""
WIDE_CELL = 2.2
"""Cells of at least so many pixels keep what is two cells away out of the window."""
LEAST_CONTRAST = 4e-4
"""Below it an offset means nothing; keeps the division finite [linear light]."""

MIN_CONTRAST_SHARE = 0.25
"""Least contrast, as a share of the upper quartile of all."""
MAX_RESIDUAL_SHARE = 0.15
"""Most that a fit may leave, as a share of the contrast, besides the image's noise."""
MAX_EDGE_OFFSET = 1.5
"""Largest offset that a fit can be trusted with [pixels]."""


@dataclass(frozen=True, eq=False)
class EdgeFits:
    """Where edges were found.

    Attributes:
        offset: (N,) from the predicted place, along the gradient of u [pixels].
        contrast: (N,) white minus black [linear light]; negative if colors are the wrong
            way round.
        information: (N,) inverse variance of the offset for noise that equals the contrast
            [1/pixels^2].
        noise: (N,) root mean square of what the fit leaves [linear light].
        widening: (N, 2) numerator and denominator of the increase of the blur's variance across the
            edge that would fit it better [pixels^2].
    """

    offset: Array
    contrast: Array
    information: Array
    noise: Array
    widening: Array


def fit_edges(
    light: NDArray[np.float32], edges: MarkerEdges, views: EdgeViews, blur: Array
) -> EdgeFits:
    """Fits brightness, contrast and offset of each edge.

    Args:
        light: (H, W) image in linear light.
        edges: table.
        views: N of them.
        blur: covariance of lens, motion and pixel together [pixels^2], (2, 2) of all edges or
            (N, 2, 2) of each.
    """
    sigma_u, sigma_v = (_width(blur, gradient) for gradient in (views.across, views.along))
    normal = np.sqrt((views.across**2).sum(axis=1, keepdims=True))
    sigma = sigma_u / normal  # across the edge [pixels]
    in_row = (np.abs(views.across[:, 0]) >= np.abs(views.across[:, 1]))[:, None]
    nearest = np.rint(views.at).astype(np.intp)
    window = np.where(sigma**2 < BLURRED, WINDOW, 2 * WINDOW)
    columns = nearest[:, :1] + np.where(in_row, window, 0)
    rows = nearest[:, 1:] + np.where(in_row, 0, window)
    dx, dy = columns - views.at[:, :1], rows - views.at[:, 1:]
    # Half the memory and time of doubles, and 1e-5 pixels at worst.
    u = (views.across[:, :1] * dx + views.across[:, 1:] * dy).astype(np.float32)
    v = (views.along[:, :1] * dx + views.along[:, 1:] * dy).astype(np.float32)

    before, behind = _gaussian((-0.5 - v) / sigma_v)[0], _gaussian((v - 0.5) / sigma_v)[0]
    share = np.stack([before, 1.0 - before - behind, behind], axis=-1)  # of the rows of cells
    wide = bool((normal * WIDE_CELL < 1.0).all() and (sigma**2 < BLURRED).all())
    reach = 1 if wide else REACH
    near = slice(REACH - reach, REACH + reach + 1)
    steps = share @ edges.steps[views.which][:, :, near]
    z = (u[..., None] - AROUND[near].astype(np.float32)) / sigma_u[..., None]
    below, density = _gaussian(z)
    bell = steps * density
    shape = np.einsum("nwk,nwk->nw", steps, below)
    slope = bell.sum(axis=-1) / sigma  # derivatives by the distance in pixels
    bend = np.einsum("nwk,nwk->nw", bell, z) / -(sigma**2)
    return _fit(light[rows, columns].astype(float), shape, slope, bend)


def has_expected_profile(fits: EdgeFits) -> NDArray[np.bool_]:
    """Edges with the right colors, enough contrast, and a profile that fits."""
    right = fits.contrast > 0.0
    if not right.any():
        return right
    usual = np.quantile(fits.contrast[right], 0.75)
    noise = np.median(fits.noise[right])
    return np.asarray(
        (fits.contrast > MIN_CONTRAST_SHARE * usual)
        & (fits.noise < MAX_RESIDUAL_SHARE * fits.contrast + 2.0 * noise)
        & (np.abs(fits.offset) < MAX_EDGE_OFFSET)
        & (fits.contrast**2 * fits.information > 4.0 * fits.noise**2)
    )


def offset_variance(fits: EdgeFits, good: NDArray[np.bool_]) -> Array:
    """(N,) variance of offsets by the image's noise [pixels^2]: light is noisy by its root."""
    contrast = np.maximum(np.abs(fits.contrast), 4e-6)
    noise = np.median(fits.noise[good] / np.sqrt(contrast[good]))
    return np.asarray(noise**2 / (contrast * np.maximum(fits.information, 1e-6)))


def _width(blur: Array, gradient: Array) -> NDArray[np.float32]:
    """(N, 1) standard deviation of a blur along gradients (N, 2), in their units."""
    variance = ((gradient[:, None] @ blur)[:, 0] * gradient).sum(axis=1, keepdims=True)
    return np.asarray(np.sqrt(variance), dtype=np.float32)


def _fit(values: Array, shape: Array, slope: Array, bend: Array) -> EdgeFits:
    """Least squares of `values = brightness + contrast (shape - offset slope)`, edge by edge."""
    parts = np.stack([values, shape, slope, bend])
    values, shape, slope, bend = parts - parts.mean(axis=2, keepdims=True)
    aa, ab, bb = _dot(shape, shape), _dot(shape, slope), _dot(slope, slope)
    va, vb = _dot(values, shape), _dot(values, slope)
    det = np.maximum(aa * bb - ab**2, 1e-12)
    contrast = (va * bb - vb * ab) / det
    tilt = (vb * aa - va * ab) / det
    rest = values - contrast[:, None] * shape - tilt[:, None] * slope
    half_bend = 0.5 * contrast[:, None] * bend  # a Gaussian's derivative by its variance
    return EdgeFits(
        offset=-tilt / np.where(np.abs(contrast) < LEAST_CONTRAST, LEAST_CONTRAST, contrast),
        contrast=contrast,
        information=det / np.maximum(aa, 1e-12),
        noise=np.sqrt(_dot(rest, rest) / (len(WINDOW) - 3)),
        widening=np.stack([_dot(rest, half_bend), _dot(half_bend, half_bend)], axis=1),
    )


def _dot(one: Array, other: Array) -> Array:
    """Scalar products (N,) of rows."""
    return np.asarray(np.einsum("nw,nw->n", one, other))


def _gaussian(z: NDArray[np.floating[Any]]) -> tuple[Array, Array]:
    """The normal distribution and its density, the former within 1e-7 (Abramowitz and Stegun,
    Handbook of Mathematical Functions, 1964, 26.2.17): a third of the time of the exact one."""
    density = np.exp(-0.5 * z * z) * (1.0 / np.sqrt(2.0 * np.pi))
    t = 1.0 / (1.0 + 0.2316419 * np.abs(z))
    tail = 1.330274429 * t
    for coefficient in (-1.821255978, 1.781477937, -0.356563782, 0.319381530):
        tail += coefficient
        tail *= t
    tail *= density
    return np.where(z > 0.0, 1.0 - tail, tail), density
