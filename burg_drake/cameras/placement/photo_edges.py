"""Find an object's edge in a photo along the normals of its expected outline."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import ndtr

from burg_drake.cameras.placement.board_background import EmptyBoard
from burg_drake.cameras.placement.pinhole_view import ImageContour, sample_nearest
from burg_drake.core import Array, Booleans, Single

TONE_WEIGHTS = (np.diag([1.0, 0.5, 0.5]) @ np.linalg.qr(np.ones((3, 1)), "complete")[0].T).astype(
    np.float32
)
"""(3, 3) RGB to brightness and two tones; tones count half, as JPEG blurs them more."""


@dataclass(frozen=True, eq=False)
class StepLines:
    """Profiles across steps of light.

    Attributes:
        t: (T,) distances from the expected step, outwards [pixels].
        light: (N, T, 3) of the photo.
        behind: (N, T, 3) the background behind the object, in the light farther outside.
        color: (N, 3) of the object, farther inside.
        tone: (N, 3) expected ratio of the object's colour at its edge to `color`.
        strip: (N,) distance from the step to the next material [pixels]; -infinity if there is
            none.
        used: (N, T) samples that are used.
    """

    t: Array
    light: Array
    behind: Array
    color: Array
    tone: Array
    strip: Array
    used: Booleans


@dataclass(frozen=True, eq=False)
class EdgeSteps:
    """Fitted steps.

    Attributes:
        offset: (N,) distance from the expected step [pixels].
        variance: (N,) of the offset [pixels^2].
        rms: (N,) root mean square residual of the light.
        contrast: (N,) contrast of the two sides of the step.
        color: (N, 3) of the object at its edge.
    """

    offset: Array
    variance: Array
    rms: Array
    contrast: Array
    color: Array


def fit_steps(lines: StepLines, blur: float, noise: float, paper: float) -> EdgeSteps:
    """Fits steps to all profiles by Gauss-Newton.

    Args:
        lines: the profiles.
        blur: of the photo and of sampling [pixels].
        noise: of the photo over paper.
        paper: light of paper.
    """
    # Pixels from the outline between which the light outside is linear.
    knot_distances = (0.0, 1.0, 2.0, 4.0)
    max_offset = 2.5  # Pixels of a step from its expected place.
    t = lines.t
    knots = np.stack(
        [np.interp(t, knot_distances, row) for row in np.eye(len(knot_distances))[:-1]], axis=1
    )
    # Relative change of the light between knots; shadows begin at the object.
    rise = np.diff(np.eye(len(knot_distances)), axis=0)[:, :-1] / [[0.6], [0.35], [0.12]]
    strip = np.isfinite(lines.strip)
    k = len(knot_distances)
    n = k + 6
    at, outer, edge, inner = 0, slice(1, k), slice(k, n - 3), slice(n - 3, n)
    prior = np.zeros((len(lines.color), n, n))
    prior[:, at, at] = 0.1
    prior[:, outer, outer] = rise.T @ rise
    # the edge's colour is near the inner one, or that of a strip of another material
    tie = _tone_prior(lines.color * lines.tone, strip, paper)
    prior[:, edge, edge] = tie
    prior[:, inner, inner] = _tone_prior(lines.color, np.zeros_like(strip), paper) + tie
    prior[:, edge, inner] = prior[:, inner, edge] = -tie
    sigma = noise * np.sqrt(0.3 + np.maximum(lines.light.mean(axis=-1), 0.0) / paper)
    weight = np.broadcast_to((lines.used / sigma)[..., None], lines.light.shape).astype(np.float32)
    x = np.zeros((len(lines.color), n))
    count = 3 * lines.used.sum(axis=1) + 1e-9
    for _ in range(4):  # Iterations.
        away = (x[:, :1] - t) / blur
        covered = ndtr(away)[..., None]
        slope = (np.exp(-0.5 * away**2) / np.sqrt(2.0 * np.pi) / blur)[..., None]
        beyond = away + np.where(strip, lines.strip, -1e3)[:, None] / blur
        strip_share = np.where(strip[:, None], ndtr(beyond), 0.0)[..., None]
        fall = np.exp(-0.5 * beyond**2)[..., None] / np.sqrt(2.0 * np.pi) / blur
        lit_background = lines.behind * np.maximum(1.0 + x[:, outer] @ knots.T, 0.0)[..., None]
        edge_color = (lines.color * lines.tone + x[:, edge])[:, None]
        inner_color = (lines.color + x[:, inner])[:, None]
        residual = (
            lines.light
            - lit_background
            - covered * (edge_color - lit_background)
            - strip_share * (inner_color - edge_color)
        )
        J = np.zeros((*residual.shape, n), np.float32)
        J[..., at] = slope * (edge_color - lit_background) + fall * (inner_color - edge_color)
        J[..., outer] = ((1.0 - covered) * lines.behind)[..., None] * knots[:, None]
        for channel in range(3):
            J[..., channel, edge.start + channel] = (covered - strip_share)[..., 0]
            J[..., channel, inner.start + channel] = strip_share[..., 0]
        J = (TONE_WEIGHTS @ J * weight[..., None]).reshape(len(x), -1, n)
        e = (residual @ TONE_WEIGHTS.T * weight).reshape(len(x), -1).astype(np.float32)
        # rough profiles get less weight
        rough = np.maximum((e**2).sum(axis=1) / count, 1.0)[:, None, None]
        normal = J.transpose(0, 2, 1) @ J / rough + prior
        pull = (J.transpose(0, 2, 1) @ e[..., None] / rough - prior @ x[..., None])[..., 0]
        x = x + np.linalg.solve(normal, pull[..., None])[..., 0]
        x[:, at] = np.clip(x[:, at], -max_offset, max_offset)
        x[:, outer] = np.clip(x[:, outer], -0.95, 1.0)
    # neighbouring samples share pixels, hence 2
    variance = 2.0 * np.linalg.inv(normal)[:, at, at]
    rms = np.sqrt((lines.used[..., None] * residual**2).sum(axis=(1, 2)) / count)
    here = int(np.argmin(np.abs(t)))
    contrast = np.linalg.norm(edge_color[:, 0] - lit_background[:, here], axis=1) / np.sqrt(3.0)
    return EdgeSteps(x[:, at], variance, rms, contrast, edge_color[:, 0])


def _tone_prior(color: Array, strip: Booleans, paper: float) -> Array:
    """(N, 3, 3) inverse covariance of colours (N, 3); they vary less in tone than in brightness."""
    surface_sds = (0.15, 0.03)  # Relative brightness and tone of the object at its edge ...
    strip_sds = (0.8, 0.15)  # ... and of a strip of another material.
    bright, tone = np.where(strip[:, None], strip_sds, surface_sds).T
    length = np.linalg.norm(color, axis=1)
    along = color / np.maximum(length, 1e-6)[:, None]
    of_tone = (tone * paper) ** -2.0
    of_bright = (bright * length + tone * paper) ** -2.0
    outer = along[:, :, None] * along[:, None]
    inverse: Array = of_tone[:, None, None] * np.eye(3)
    return np.asarray(inverse + (of_bright - of_tone)[:, None, None] * outer)


PROFILE_STEP_PX = 0.5
"""Spacing of samples on a normal, in pixels."""
MIN_EDGE_CONTRAST = 0.05
"""Least contrast of an edge, as a fraction of the contrast of paper and ink."""
FINE_SEARCH_PX = 5.0
"""Pixels on both sides of an outline that the fine search covers."""


@dataclass(frozen=True, eq=False)
class PhotoEdges:
    """Edges of a photo on the normals of an outline.

    Attributes:
        offset: (N,) distance of each edge outwards from the outline [pixels].
        deviation: (N,) standard deviation of each offset [pixels].
        shading: (N,) inward shift of the measured edge per relative darkening of the object at its
            edge, as of round objects [pixels].
        found: (N,) True where an edge was found.
        expected: (N,) True where an edge should be visible: nothing occludes it, and the two sides
            of the outline look different.
    """

    offset: Array
    deviation: Array
    shading: Array
    found: Booleans
    expected: Booleans


@dataclass(frozen=True, eq=False)
class NormalProfiles:
    """Samples of photo and empty board on the normals of an outline.

    Attributes:
        t: (T,) distances from the outline [pixels].
        light: (N, T, 3) the photo, linear.
        board: (N, T, 3) the board without objects and shadows.
        evidence: (N, T) evidence of an object, see `EmptyBoard`.
        known: (N, T) True where `board` can be relied on.
        covered: (N, T) True where the object is seen, if nothing occludes it.
        strip: (N,) inner end of the strip of surface next to the outline: a bend, another material,
            or a part behind it [pixels]; -infinity if there is none.
        tone: (N, 3) ratio of the strip's reflectance to that of the surface inside.
        occluded: (N, T) True where another object is in front.
    """

    t: Array
    light: Array
    board: Array
    evidence: Array
    known: Booleans
    covered: Booleans
    strip: Array
    tone: Array
    occluded: Booleans


def sample_normal_profiles(
    contour: ImageContour,
    light: Single,
    background: EmptyBoard,
    others: Array,
    reach: float,
) -> NormalProfiles:
    """Samples a photo on the normals of an outline.

    Args:
        contour: the outline.
        light: (H, W, 3) of the photo, linear.
        picture: of the empty board.
        others: (H, W) depth of other objects, infinity where there is none.
        reach: length of the normals to both sides [pixels].
    """
    t = np.arange(-reach, reach + PROFILE_STEP_PX / 2, PROFILE_STEP_PX)
    points = contour.points(t)
    at = points.astype(np.float32)

    def sampled(values: Single) -> Array:
        found = cv2.remap(
            values, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
        return np.asarray(found).reshape(len(contour), len(t), *values.shape[2:])

    other = np.isfinite(sample_nearest(others, points, np.inf))
    known = (sample_nearest(background.sheet, points, 0.0) > 0.0) & ~other
    return NormalProfiles(
        t,
        sampled(light),
        sampled(background.color),
        sampled(background.evidence.astype(np.float32)),
        known,
        *contour.surface_strip(points, t),
        other,
    )


def find_far_edges(profiles: NormalProfiles, background: EmptyBoard) -> PhotoEdges:
    """Finds the best step from object to background on each normal: by evidence on the sheet, by
    colours outside it.
    """
    t, light, covered = profiles.t, profiles.light, profiles.covered
    reach = float(t[-1])
    far_in, far_out = np.asarray(t < -reach / 2), np.asarray(t > reach / 2)
    usable: Booleans = np.asarray((covered & far_in).any(axis=1))
    usable &= ~(profiles.occluded & (t > -1.0)).any(axis=1)
    tolerance = 2.0 * MIN_EDGE_CONTRAST * background.contrast
    inner = _mean_of_samples(light, covered & far_in)
    outer = _mean_of_samples(light, np.broadcast_to(far_out, covered.shape))
    off_object = np.minimum(np.linalg.norm(light - inner[:, None], axis=-1) / tolerance, 1.0)
    off_outer = np.minimum(np.linalg.norm(light - outer[:, None], axis=-1) / tolerance, 1.0)
    inside = np.where(profiles.known, np.maximum(-profiles.evidence, 0.0), off_object**2)
    outside = np.where(profiles.known, np.maximum(profiles.evidence, 0.0), off_outer**2)
    cost = np.cumsum(inside, axis=1) + (outside.sum(axis=1)[:, None] - np.cumsum(outside, axis=1))
    best = cost.argmin(axis=1)
    ends = np.minimum(cost[:, 0], cost[:, -1])
    gain = ends - cost.min(axis=1)
    found = usable & (best > 0) & (best < len(t) - 1) & (gain > 2.0)
    even = np.zeros(len(best))
    return PhotoEdges(t[best] + PROFILE_STEP_PX / 2, even + 1.0, even, found, usable)


def find_near_edges(profiles: NormalProfiles, background: EmptyBoard) -> PhotoEdges:
    """Finds edges near the outline by least squares: a blurred step between two modelled sides.

    The outside is the board B(t) in a light g(t), which varies most at the object, where its shadow
    begins. The inside is the object's colour F. With the blurred step s the photo is g B + s(offset
    - t) (F - g B). Where F is grey as well, the edge of a shadow looks like the object's edge; the
    offset's standard deviation includes this, as g is fitted as well. An outline with the board on
    both sides belongs to a shadow and is no edge.
    """
    inner_width = 0.6  # Pixels over which the object's colour is sampled; many objects have a rim.
    outer_width = 3.0  # Pixels over which the light outside is sampled.
    max_rms_share = 0.2  # Residual of a good edge, as a fraction of the contrast of paper and ink.
    t, light = profiles.t, profiles.light
    covered, occluded = profiles.covered, profiles.occluded
    # Pixels. Standard deviation from pixel area and interpolation.
    blur = float(np.hypot(background.blur, 0.4))
    # Blur standard deviations from an edge at which it is no longer seen.
    clear = max(1.75 * blur, 0.9)
    core = covered & np.roll(covered, round(clear / PROFILE_STEP_PX), axis=1)
    # Pixels. Thickest strip of another material along an outline.
    strip = np.where(profiles.strip > -clear - inner_width - 2.5, profiles.strip, -np.inf)
    # the object's colour, sampled inside a strip of another material if there is one
    start = -clear + np.where(np.isfinite(strip), strip, 0.0)[:, None]
    inner = core & (t <= start) & (t >= start - inner_width)
    outer = (t >= clear) & (t <= clear + outer_width) & ~covered
    usable = inner.any(axis=1) & outer.any(axis=1) & ~(covered & (t > 0.7)).any(axis=1)
    mixed = (occluded & (t > 0.0)).any(axis=1) & ~(occluded | (t < 0.0)).all(axis=1)
    usable &= ~mixed & ~(occluded & (t < 0.0) & (t > -2.0) & ~covered).any(axis=1)
    color = _mean_of_samples(light, inner)
    behind, left_outside = _background_light(profiles, outer)
    used = (core | (t > -1.0)) & (t > start - inner_width) & (t < clear + outer_width)
    paper = background.contrast
    seen = used.any(axis=0)
    lines = StepLines(
        t[seen], light[:, seen], behind[:, seen], color, profiles.tone, strip, used[:, seen]
    )
    fit = fit_steps(lines, blur, background.noise, paper)
    # Pixels at the contrast of paper and ink; grows as the contrast falls.
    variance = fit.variance + (0.08 * paper / np.maximum(fit.contrast, 1e-4)) ** 2
    known: Booleans = np.asarray(np.all(profiles.known[:, t >= 0.0], axis=1))
    # Evidence inside the outline below which the board is seen there.
    board_inside = known & (_mean_of_samples(profiles.evidence[..., None], inner)[:, 0] < -0.4)
    explained = ~known | (left_outside < max_rms_share * paper)
    # Pixels. Edges with a larger standard deviation are dropped.
    expected = usable & (explained | board_inside) & (variance < 1.5**2)
    expected &= fit.contrast > MIN_EDGE_CONTRAST * paper
    found = expected & ~board_inside
    found &= (np.abs(fit.offset) < 2.4) & (fit.rms < max_rms_share * paper)
    across = fit.color - behind[:, t == 0.0].mean(axis=1)
    shading = (fit.color * across).sum(axis=1) / np.maximum((across**2).sum(axis=1), 1e-4)
    return PhotoEdges(fit.offset, np.sqrt(variance), shading, found, expected)


def _background_light(profiles: NormalProfiles, outer: Booleans) -> tuple[Array, Array]:
    """(N, T, 3) background behind the object: the board, or the mean light outside where the board
    is unknown; and (N,) root mean square residual of the board outside.
    """
    known: Booleans = np.asarray(np.all(profiles.known[:, profiles.t >= 0.0], axis=1))
    B = np.where(outer[..., None], profiles.board, 0.0)
    level = (B * profiles.light).sum(axis=(1, 2)) / ((B * B).sum(axis=(1, 2)) + 1e-9)
    model = profiles.board * level[:, None, None]
    square_error = (((profiles.light - model) ** 2).mean(axis=-1) * outer).sum(axis=1)
    mean = np.broadcast_to(_mean_of_samples(profiles.light, outer)[:, None], model.shape)
    model = np.where(known[:, None, None], model, mean)
    return model, np.sqrt(square_error / np.maximum(outer.sum(axis=1), 1))


def _mean_of_samples(values: Array, where: Booleans) -> Array:
    """(N, C) mean of values (N, T, C) at some samples (N, T) of each line; 0 without samples."""
    count = np.maximum(where.sum(axis=1), 1)
    return (values * where[..., None]).sum(axis=1) / count[:, None]
