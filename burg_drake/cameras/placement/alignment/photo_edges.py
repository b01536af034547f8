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

from burg_drake.cameras.placement.alignment.background import EmptyBoard
from burg_drake.cameras.placement.alignment.contour import ImageContour
from burg_drake.cameras.placement.alignment.pinhole import sample_nearest
from burg_drake.cameras.placement.alignment.step_fit import StepLines, fit_steps
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
REACH = 5.0
"""How far `near_edges` looks to both sides [pixels]."""
OUTSIDE = 3.0
"""How far from where the edge is not seen any more the light outside is taken [pixels]."""
ALIKE = 0.2
"""Root mean square of what a good edge leaves unexplained, as a share of the contrast of paper and
ink."""
DEPTH = 2.5
"""How thick a strip of another material along an outline is looked at [pixels]."""
BOARD_INSIDE = -0.4
"""Evidence inside an outline below which the board is seen there."""
UNSURE = 1.5
"""Standard deviation of an edge from which on it is none [pixels]."""


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
        light: (N, T, 3) the photo, linear.
        board: (N, T, 3) the board without objects and shadows.
        evidence: (N, T) of something that stands there.
        known: (N, T) `board` can be relied on.
        covered: (N, T) the object covers it.
        strip: (N,) where the surface that begins at the outline ends inwards: at a bend, another
            material, or a part that it hides [pixels]; -infinity if it does not.
        tone: (N, 3) its reflectance over that of what begins there.
        occluded: (N, T) another object covers it.
    """

    t: Array
    light: Array
    board: Array
    evidence: Array
    known: NDArray[np.bool_]
    covered: NDArray[np.bool_]
    strip: Array
    tone: Array
    occluded: NDArray[np.bool_]


def normal_profiles(
    contour: ImageContour,
    light: NDArray[np.float32],
    picture: EmptyBoard,
    others: Array,
    reach: float,
) -> NormalProfiles:
    """Samples a photo on the normals of an outline.

    Args:
        contour: the outline.
        light: (H, W, 3) of the photo, linear.
        picture: of the empty board.
        others: (H, W) depth of other objects, infinity where there is none.
        reach: to both sides [pixels].
    """
    t = np.arange(-reach, reach + STEP / 2, STEP)
    points = contour.points(t)
    at = points.astype(np.float32)

    def sampled(values: NDArray[np.float32]) -> Array:
        found = cv2.remap(
            values, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(found).reshape(len(contour), len(t), *values.shape[2:])

    other = np.isfinite(sample_nearest(others, points, np.inf))
    known = (sample_nearest(picture.sheet, points, 0.0) > 0.0) & ~other
    return NormalProfiles(
        t,
        sampled(light),
        sampled(picture.color),
        sampled(picture.evidence.astype(np.float32)),
        known,
        *contour.inside(points, t),
        other,
    )


def far_edges(on: NormalProfiles, picture: EmptyBoard) -> PhotoEdges:
    """The best place on each line for a step from the object to the background: by the evidence on
    the sheet, by colors beyond it."""
    t, reach = on.t, float(on.t[-1])
    far_in, far_out = np.asarray(t < -reach / 2), np.asarray(t > reach / 2)
    usable: NDArray[np.bool_] = np.asarray((on.covered & far_in).any(axis=1))
    usable &= ~(on.occluded & (t > -1.0)).any(axis=1)
    tolerance = 2.0 * DIFFERENT * picture.contrast
    inner = _mean(on.light, on.covered & far_in)
    outer = _mean(on.light, np.broadcast_to(far_out, on.covered.shape))
    off_object = np.minimum(np.linalg.norm(on.light - inner[:, None], axis=-1) / tolerance, 1.0)
    off_outer = np.minimum(np.linalg.norm(on.light - outer[:, None], axis=-1) / tolerance, 1.0)
    inside = np.where(on.known, np.maximum(-on.evidence, 0.0), off_object**2)
    outside = np.where(on.known, np.maximum(on.evidence, 0.0), off_outer**2)
    cost = np.cumsum(inside, axis=1) + (outside.sum(axis=1)[:, None] - np.cumsum(outside, axis=1))
    best = cost.argmin(axis=1)
    ends = np.minimum(cost[:, 0], cost[:, -1])
    gain = ends - cost.min(axis=1)
    found = usable & (best > 0) & (best < len(t) - 1) & (gain > 2.0)
    even = np.zeros(len(best))
    return PhotoEdges(t[best] + STEP / 2, even + 1.0, even, found, usable)


def near_edges(on: NormalProfiles, picture: EmptyBoard) -> PhotoEdges:
    """Edges near to the outline, by least squares: a blurred step between two explained sides.

    Outside is the board B(t) in a light g(t) that may change, most next to the object, whose shadow
    begins there; inside is the object's color F. With the blurred step s the photo is
    g B + s(offset - t) (F - g B). Where F is grey as well, a shadow's edge looks like the object's,
    and the offset's standard deviation says so, as g is solved for with it. An outline that has the
    board on both sides is a shadow's, and no edge.
    """
    t = on.t
    blur = float(np.hypot(picture.blur, PIXEL))
    clear = max(SHARP * blur, 0.9)
    core = on.covered & np.roll(on.covered, round(clear / STEP), axis=1)
    strip = np.where(on.strip > -clear - BESIDE - DEPTH, on.strip, -np.inf)
    # the object's color, from beyond a strip of another material if there is one
    start = -clear + np.where(np.isfinite(strip), strip, 0.0)[:, None]
    inner = core & (t <= start) & (t >= start - BESIDE)
    outer = np.broadcast_to((t >= clear) & (t <= clear + OUTSIDE), on.covered.shape) & ~on.covered
    usable = inner.any(axis=1) & outer.any(axis=1) & ~(on.covered & (t > 0.7)).any(axis=1)
    mixed = (on.occluded & (t > 0.0)).any(axis=1) & ~(on.occluded | (t < 0.0)).all(axis=1)
    usable &= ~mixed & ~(on.occluded & (t < 0.0) & (t > -2.0) & ~on.covered).any(axis=1)
    color = _mean(on.light, inner)
    behind, left_outside = _behind(on, outer)
    used = (core | (t > -1.0)) & (t > start - BESIDE) & (t < clear + OUTSIDE)
    paper = picture.contrast
    seen = used.any(axis=0)
    lines = StepLines(
        t[seen], on.light[:, seen], behind[:, seen], color, on.tone, strip, used[:, seen]
    )
    fit = fit_steps(lines, blur, picture.noise, paper)
    variance = fit.variance + (FLOOR * paper / np.maximum(fit.contrast, 1e-4)) ** 2
    known: NDArray[np.bool_] = np.asarray(np.all(on.known[:, t >= 0.0], axis=1))
    board_inside = known & (_mean(on.evidence[..., None], inner)[:, 0] < BOARD_INSIDE)
    explained = ~known | (left_outside < ALIKE * paper)
    expected = usable & (explained | board_inside) & (variance < UNSURE**2)
    expected &= fit.contrast > DIFFERENT * paper
    found = expected & (np.abs(fit.offset) < 2.4) & ~board_inside & (fit.rms < ALIKE * paper)
    across = fit.color - behind[:, t == 0.0].mean(axis=1)
    shading = (fit.color * across).sum(axis=1) / np.maximum((across**2).sum(axis=1), 1e-4)
    return PhotoEdges(fit.offset, np.sqrt(variance), shading, found, expected)


def _behind(on: NormalProfiles, outer: NDArray[np.bool_]) -> tuple[Array, Array]:
    """(N, T, 3) what is behind the object, and (N,) root mean square of what
    that leaves outside. Where the board is not known, it is the mean of what is outside.
    """
    known: NDArray[np.bool_] = np.asarray(np.all(on.known[:, on.t >= 0.0], axis=1))
    B = np.where(outer[..., None], on.board, 0.0)
    level = (B * on.light).sum(axis=(1, 2)) / ((B * B).sum(axis=(1, 2)) + 1e-9)
    model = on.board * level[:, None, None]
    left = (((on.light - model) ** 2).mean(axis=-1) * outer).sum(axis=1)
    mean = np.broadcast_to(_mean(on.light, outer)[:, None], model.shape)
    model = np.where(known[:, None, None], model, mean)
    return model, np.sqrt(left / np.maximum(outer.sum(axis=1), 1))


def _mean(values: Array, where: NDArray[np.bool_]) -> Array:
    """(N, C) mean of (N, T, C) at some samples (N, T) of each line; 0 where there is none."""
    count = np.maximum(where.sum(axis=1), 1)
    return (values * where[..., None]).sum(axis=1) / count[:, None]
