"""Fits blurred steps from an object to the board behind it, on many lines at once.

Each side has what may differ from where it is looked at: the light on the board changes next to an
object, whose shadow begins there, and the object may end in a thin strip of another material. Both
are solved for together with where the step is, so that its variance covers them: where a shadow's
edge would look the same as the object's, it is large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from burg_drake.core import Array

KNOTS = (0.0, 1.0, 2.0, 4.0)
"""Distances from the outline between which the light outside changes linearly [pixels]."""
CHANGES = (0.6, 0.35, 0.12)
"""Standard deviations of its change from one to the next, as shares of the light: most next to the
object, where its shadow begins."""
FARTHEST = 2.5
"""Most distance of a step from where it is expected [pixels]."""
STEPS = 4
SHADE, STRIP = (0.15, 0.03), (0.8, 0.15)
"""Standard deviations of the object's brightness at its edge, as a share of itself, and of its
tone, as a share of paper's light: against a little farther in, and of a strip."""


COARSE = 0.5
"""Weight of differences of tone over that of brightness: cameras and JPEG blur tones more, and a
bright side then seems to end too early."""
TONES = (np.diag([1.0, COARSE, COARSE]) @ np.linalg.qr(np.ones((3, 1)), "complete")[0].T).astype(
    np.float32
)
"""(3, 3) brightness and two tones of red, green and blue, weighted."""


@dataclass(frozen=True, eq=False)
class StepLines:
    """Lines across steps.

    Attributes:
        t: (T,) distances from the expected step, outwards [pixels].
        light: (N, T, 3) of the photo.
        behind: (N, T, 3) what is behind the object in the light from farther outside.
        color: (N, 3) of the object, farther in.
        tone: (N, 3) of the object at its edge, expected, over that.
        strip: (N,) where, from the step, another material begins [pixels]; -infinity where none
            does.
        used: (N, T) samples that count.
    """

    t: Array
    light: Array
    behind: Array
    color: Array
    tone: Array
    strip: Array
    used: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Steps:
    """Steps that were fitted.

    Attributes:
        offset: (N,) where they are [pixels].
        variance: (N,) of that.
        rms: (N,) root mean square of what is left of the light.
        contrast: (N,) of both sides.
        color: (N, 3) of the object at its edge.
    """

    offset: Array
    variance: Array
    rms: Array
    contrast: Array
    color: Array


def fit_steps(lines: StepLines, blur: float, noise: float, paper: float) -> Steps:
    """Fits all lines by Gauss and Newton.

    Args:
        lines: the lines.
        blur: of the photo and of sampling [pixels].
        noise: of the photo over paper.
        paper: light of paper.
    """
    t = lines.t
    knots = np.stack([np.interp(t, KNOTS, row) for row in np.eye(len(KNOTS))[:-1]], axis=1)
    rise = np.diff(np.eye(len(KNOTS)), axis=0)[:, :-1] / np.array(CHANGES)[:, None]
    strip = np.isfinite(lines.strip)
    n = len(KNOTS) + 6
    at, outer, edge, inner = 0, slice(1, len(KNOTS)), slice(len(KNOTS), n - 3), slice(n - 3, n)
    prior = np.zeros((len(lines.color), n, n))
    prior[:, at, at] = 0.1
    prior[:, outer, outer] = rise.T @ rise
    # the edge's color keeps to the inner one's, or may be quite another
    tie = _tone_prior(lines.color * lines.tone, strip, paper)
    prior[:, edge, edge] = tie
    prior[:, inner, inner] = _tone_prior(lines.color, np.zeros_like(strip), paper) + tie
    prior[:, edge, inner] = prior[:, inner, edge] = -tie
    sigma = noise * np.sqrt(0.3 + np.maximum(lines.light.mean(axis=-1), 0.0) / paper)
    weight = np.broadcast_to((lines.used / sigma)[..., None], lines.light.shape).astype(np.float32)
    x = np.zeros((len(lines.color), n))
    count = 3 * lines.used.sum(axis=1) + 1e-9
    for _ in range(STEPS):
        away = (x[:, :1] - t) / blur
        covered = ndtr(away)[..., None]
        slope = (np.exp(-0.5 * away**2) / np.sqrt(2.0 * np.pi) / blur)[..., None]
        beyond = away + np.where(strip, lines.strip, -1e3)[:, None] / blur
        deep = np.where(strip[:, None], ndtr(beyond), 0.0)[..., None]
        fall = np.exp(-0.5 * beyond**2)[..., None] / np.sqrt(2.0 * np.pi) / blur
        lit = lines.behind * np.maximum(1.0 + x[:, outer] @ knots.T, 0.0)[..., None]
        first = (lines.color * lines.tone + x[:, edge])[:, None]
        second = (lines.color + x[:, inner])[:, None]
        left = lines.light - lit - covered * (first - lit) - deep * (second - first)
        J = np.zeros((*left.shape, n), np.float32)
        J[..., at] = slope * (first - lit) + fall * (second - first)
        J[..., outer] = ((1.0 - covered) * lines.behind)[..., None] * knots[:, None]
        for channel in range(3):
            J[..., channel, edge.start + channel] = (covered - deep)[..., 0]
            J[..., channel, inner.start + channel] = deep[..., 0]
        J = (TONES @ J * weight[..., None]).reshape(len(x), -1, n)
        e = (left @ TONES.T * weight).reshape(len(x), -1).astype(np.float32)
        # what is rough on a line says less
        rough = np.maximum((e**2).sum(axis=1) / count, 1.0)[:, None, None]
        normal = J.transpose(0, 2, 1) @ J / rough + prior
        pull = (J.transpose(0, 2, 1) @ e[..., None] / rough - prior @ x[..., None])[..., 0]
        x = x + np.linalg.solve(normal, pull[..., None])[..., 0]
        x[:, at] = np.clip(x[:, at], -FARTHEST, FARTHEST)
        x[:, outer] = np.clip(x[:, outer], -0.95, 1.0)
    # neighbouring samples share pixels, hence 2
    variance = 2.0 * np.linalg.inv(normal)[:, at, at]
    rms = np.sqrt((lines.used[..., None] * left**2).sum(axis=(1, 2)) / count)
    here = int(np.argmin(np.abs(t)))
    contrast = np.linalg.norm(first[:, 0] - lit[:, here], axis=1) / np.sqrt(3.0)
    return Steps(x[:, at], variance, rms, contrast, first[:, 0])


def _tone_prior(color: Array, strip: NDArray[np.bool_], paper: float) -> Array:
    """(N, 3, 3) inverse covariance of colors (N, 3), which vary by their brightness more than by
    their tone."""
    bright, tone = np.where(strip[:, None], STRIP, SHADE).T
    length = np.linalg.norm(color, axis=1)
    along = color / np.maximum(length, 1e-6)[:, None]
    of_tone = (tone * paper) ** -2.0
    of_bright = (bright * length + tone * paper) ** -2.0
    outer = along[:, :, None] * along[:, None]
    inverse: Array = of_tone[:, None, None] * np.eye(3)
    return np.asarray(inverse + (of_bright - of_tone)[:, None, None] * outer)
