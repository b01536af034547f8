"""Where a photo has the edge of an object, on the normals of an expected outline.

Outside is the board, whose picture is known, or else whatever looks alike along the normal; inside
is the object, whose color is taken from beside the edge. `far_edges` finds the edge within many
pixels, `near_edges` measures it to a small part of one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from burg_drake.cameras.placement.alignment.background import EmptyBoard
from burg_drake.cameras.placement.alignment.contour import ImageContour
from burg_drake.cameras.placement.alignment.pinhole import sample_nearest
from burg_drake.core import Array

STEP = 0.5
"""Between samples on a normal [pixels]."""
DIFFERENT = 0.05
"""Contrast of object and background below which there is no edge, as a share of that of paper and
ink; and the deviation at which a sample fits badly."""
PIXEL = 0.4
"""Standard deviation of the blur by a pixel's area and by interpolation [pixels]."""
SHARP = 1.75
"""How far from an edge it is not seen any more, in standard deviations of the blur."""
BESIDE = 0.6
"""How far from there the color of the object is taken [pixels]: no farther, as many have a rim."""
FLOOR = 0.08
"""Error of an edge that noise does not explain: colors that are not even, meshes, blur. At the
contrast of paper and ink, and inversely proportional to the contrast [pixels]."""
REACH = 4.0
"""How far `near_edges` looks to both sides [pixels]."""
ALIKE = 0.2
"""Root mean square of what a good edge leaves unexplained, as a share of the contrast of paper and
ink."""


@dataclass(frozen=True, eq=False)
class PhotoEdges:
    """Edges of a photo on the normals of an outline.

    Attributes:
        offset: (N,) where they are, outwards from the outline [pixels].
        deviation: (N,) their standard deviations [pixels].
        shading: (N,) how far inwards it is measured, per share by which the object is darker at its
            very edge than beside it, as round objects are [pixels].
        found: (N,) there is one.
        expected: (N,) there should be one: nothing else is in the way, and what is inside the
            outline looks different from what is outside.
    """

    offset: Array
    deviation: Array
    shading: Array
    found: NDArray[np.bool_]
    expected: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class NormalProfiles:
    """What is on the normals of an outline.

    Attributes:
        t: (T,) distances from the outline [pixels].
        image: (N, T, 3) the photo.
        board: (N, T, 3) the board without objects.
        known: (N, T) `board` can be relied on.
        covered: (N, T) the object covers it.
        occluded: (N, T) another object covers it.
    """

    t: Array
    image: Array
    board: Array
    known: NDArray[np.bool_]
    covered: NDArray[np.bool_]
    occluded: NDArray[np.bool_]


def normal_profiles(
    contour: ImageContour,
    image: NDArray[np.float32],
    picture: EmptyBoard,
    others: Array,
    reach: float,
) -> NormalProfiles:
    """Samples a photo on the normals of an outline.

    Args:
        contour: the outline.
        image: (H, W, 3) float32.
        picture: of the empty board.
        others: (H, W) depth of other objects, infinity where there is none.
        reach: to both sides [pixels].
    """
    t = np.arange(-reach, reach + STEP / 2, STEP)
    points = contour.points(t)
    at = points.astype(np.float32)
    x, y = np.ascontiguousarray(at[..., 0]), np.ascontiguousarray(at[..., 1])
    seen = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    board = cv2.remap(
        picture.color.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    other = np.isfinite(sample_nearest(others, points, np.inf))
    known = (sample_nearest(picture.sheet, points, 0.0) > 0.0) & ~other
    shape = (len(contour), len(t), 3)
    return NormalProfiles(
        t, seen.reshape(shape), board.reshape(shape), known, contour.inside(points), other
    )


def far_edges(on: NormalProfiles, picture: EmptyBoard) -> PhotoEdges:
    """The best place on each line for a step from the object to the background."""
    t, reach = on.t, float(on.t[-1])
    far_in, far_out = np.asarray(t < -reach / 2), np.asarray(t > reach / 2)
    object_color = _mean(on.image, on.covered & far_in)
    around = _mean(on.image, np.broadcast_to(far_out, on.covered.shape))
    usable: NDArray[np.bool_] = np.asarray((on.covered & far_in).any(axis=1))
    usable &= ~(on.occluded & (t > -1.0)).any(axis=1)
    tolerance = DIFFERENT * picture.contrast
    known: NDArray[np.bool_] = np.asarray(np.all(on.known[:, t > 0.0], axis=1))
    behind = np.where(known[:, None, None], on.board, around[:, None])
    off_object = np.linalg.norm(on.image - object_color[:, None], axis=-1) / tolerance / 2.0
    off_board = np.linalg.norm(on.image - behind, axis=-1) / tolerance / 2.0
    inside = np.minimum(off_object**2, 1.0)
    outside = np.minimum(off_board**2, 3.0)
    cost = np.cumsum(inside, axis=1) + (outside.sum(axis=1)[:, None] - np.cumsum(outside, axis=1))
    best = cost.argmin(axis=1)
    ends = np.minimum(cost[:, 0], cost[:, -1])
    gain = ends - cost.min(axis=1)
    found = usable & (best > 0) & (best < len(t) - 1) & (gain > 2.0)
    even = np.zeros(len(best))
    return PhotoEdges(t[best] + STEP / 2, even + 1.0, even, found, usable)


def near_edges(on: NormalProfiles, picture: EmptyBoard) -> PhotoEdges:
    """Edges near to the outline, by least squares: a blurred step between two known colors.

    With the object's color F, the background's B(t) and the blurred step s, the image is
    B(t) + s(offset - t) (F - B(t)); where F and B(t) are alike, nothing is learnt.
    """
    t = on.t
    blur = float(np.hypot(picture.blur, PIXEL))
    clear = max(SHARP * blur, 0.9)
    core = on.covered & np.roll(on.covered, 2, axis=1)
    inner = core & (t <= -clear) & (t >= -clear - BESIDE)
    outer = np.broadcast_to((t >= clear) & (t <= clear + 2.0), on.covered.shape) & ~on.covered
    usable = inner.any(axis=1) & outer.any(axis=1) & ~(on.covered & (t > 0.7)).any(axis=1)
    mixed = (on.occluded & (t > 0.0)).any(axis=1) & ~(on.occluded | (t < 0.0)).all(axis=1)
    usable &= ~mixed & ~(on.occluded & (t < 0.0) & (t > -2.0) & ~on.covered).any(axis=1)
    color = _mean(on.image, inner)
    known: NDArray[np.bool_] = np.asarray(np.all(on.known[:, t >= 0.0], axis=1))
    drift = _mean(on.image - on.board, outer)
    board = on.board + drift[:, None]
    behind = np.where(known[:, None, None], board, _mean(on.image, outer)[:, None])
    step = color[:, None] - behind
    weight = ((t > 0.0) | on.covered | (t > -1.0)).astype(float) * (t > -clear - BESIDE) * (t < 3.6)
    offset, slope = np.zeros(len(color)), np.zeros_like(weight)
    for _ in range(4):
        away = (offset[:, None] - t) / blur
        slope = np.exp(-0.5 * away**2) / np.sqrt(2.0 * np.pi) / blur
        left = on.image - behind - ndtr(away)[..., None] * step
        pull = (weight[..., None] * slope[..., None] * step * left).sum(axis=(1, 2))
        power = (weight[..., None] * (slope[..., None] * step) ** 2).sum(axis=(1, 2))
        offset = np.clip(offset + pull / (power + 1.0), -2.5, 2.5)
    left = on.image - behind - ndtr((offset[:, None] - t) / blur)[..., None] * step
    rms = np.sqrt((weight[..., None] * left**2).sum(axis=(1, 2)) / (3 * weight.sum(axis=1) + 1e-9))
    contrast = np.sqrt(power / np.maximum((weight * slope**2).sum(axis=1), 1e-12) / 3.0)
    variance = 2.0 * (picture.noise**2 + (rms / 2.0) ** 2) / np.maximum(power, 1e-9)
    variance += (FLOOR * picture.contrast / np.maximum(contrast, 1.0)) ** 2
    differs = usable & (contrast > DIFFERENT * picture.contrast)
    found = differs & (np.abs(offset) < 2.4)
    found &= rms < ALIKE * picture.contrast
    found &= ~known | (np.abs(drift).max(axis=1) < 0.35 * picture.contrast)
    across = step[:, t == 0.0].mean(axis=1)
    shading = (color * across).sum(axis=1) / np.maximum((across**2).sum(axis=1), 1.0)
    return PhotoEdges(offset, np.sqrt(variance), shading, found & (variance < 1.0), differs)


def _mean(values: Array, where: NDArray[np.bool_]) -> Array:
    """(N, 3) mean color of (N, T, 3) at some samples (N, T) of each line; 0 where there is none."""
    count = np.maximum(where.sum(axis=1), 1)
    return (values * where[..., None]).sum(axis=1) / count[:, None]
