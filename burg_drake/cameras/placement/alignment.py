"""Alignment of an object with an image: interface, result, and robust least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.pinhole_view import ImageContour, ImageWindow, PinholeView
from burg_drake.core import Array, Indices


@dataclass(frozen=True, eq=False)
class DisplacementFit:
    """A displacement fitted to measurements.

    Attributes:
        step: (3,) x, y [m] and angle [rad]; the angle is 0 where it is not fitted.
        covariance: (3, 3) of it.
        weights: (N,) robust weights of the measurements, in [0, 1]; 0 for outliers.
        scale: ratio of the measurements' actual to their stated standard deviation.
        sensitivity: (3, N) derivatives of the step by each measurement.
    """

    step: Array
    covariance: Array
    weights: Array
    scale: float
    sensitivity: Array


def fit_displacement(
    along: Array,
    offset: Array,
    deviation: Array,
    groups: Indices,
    symmetric: bool,
    unit: Array,
    nuisance: Array | None = None,
) -> DisplacementFit | None:
    """Solves `along @ step + nuisance @ unknown = offset` with Tukey's weights.

    Args:
        along: (N, 3).
        offset: (N,) measured.
        deviation: (N,) standard deviations of `offset`.
        groups: (N,) number of the neighbourhood that a measurement belongs to. The covariance is
            the sandwich of clustered errors [White 1980; Liang and Zeger 1986]: errors may be alike
            within a neighbourhood.
        symmetric: leave the angle out.
        unit: (3,) typical sizes of the step's parts, for good conditioning.
        nuisance: (N, M) derivatives of `offset` by other unknowns, of mean 0 and standard deviation
            1.

    Returns:
        The fit, or None if the measurements do not determine the step.
    """
    used = [0, 1] if symmetric else [0, 1, 2]
    extra = np.empty((len(offset), 0)) if nuisance is None else nuisance
    A = np.hstack([(along * unit)[:, used], extra]) / deviation[:, None]
    b = offset / deviation
    prior = np.diag([0.0] * len(used) + [1.0] * extra.shape[1])
    solved = _solve_robustly(A, b, prior, len(used))
    if solved is None:
        return None
    x, weights, scale = solved
    bread = np.linalg.inv((A * weights[:, None]).T @ A + prior)
    scores = A * (weights * (b - A @ x))[:, None]
    _, group = np.unique(groups, return_inverse=True)
    sums = np.zeros((group.max() + 1, A.shape[1]))
    np.add.at(sums, group, scores)
    few = len(sums) / max(len(sums) - len(used), 1)
    covariance = few * bread @ sums.T @ sums @ bread + bread
    n, unit = len(used), unit[used]
    step, spread, gain = np.zeros(3), np.zeros((3, 3)), np.zeros((3, len(b)))
    step[used] = x[:n] * unit
    spread[np.ix_(used, used)] = covariance[:n, :n] * np.outer(unit, unit)
    gain[used] = unit[:, None] * (bread @ (A * weights[:, None]).T)[:n] / deviation
    return DisplacementFit(step, spread, weights, scale, gain)


def _solve_robustly(A: Array, b: Array, prior: Array, n: int) -> tuple[Array, Array, float] | None:
    """Solution, weights and scale of `A x = b`; None if its first `n` are not determined."""
    mad_to_sd = 1.4826  # Standard deviation over median absolute deviation of normal errors.
    if len(b) < 4 * n:
        return None
    x: Array = np.zeros(A.shape[1])
    scale = max(mad_to_sd * float(np.median(np.abs(b))), 1.0)
    weights: Array = np.ones(len(b))
    for _ in range(12):  # Rounds of reweighting.
        weights = _tukey_weights((b - A @ x) / scale)
        if weights.sum() < 4 * n:
            return None
        normal = (A * weights[:, None]).T @ A + prior
        values = np.linalg.eigvalsh(normal[:n, :n])
        if values[0] <= 1e-6 * values[-1]:
            return None
        x = np.asarray(np.linalg.solve(normal, (A * weights[:, None]).T @ b), dtype=float)
        near = (b - A @ x)[weights > 0.0]
        scale = max(min(scale, mad_to_sd * float(np.median(np.abs(near)))), 0.3)
    return x, weights, scale


def _tukey_weights(residual: Array) -> Array:
    r = residual / 4.685  # Standard deviations; 95 % efficiency on normal errors.
    return np.where(np.abs(r) < 1.0, (1.0 - r**2) ** 2, 0.0)


@dataclass(frozen=True, eq=False)
class Alignment:
    """The alignment of an object with an image.

    Attributes:
        q: (3,) displacement, see `TargetShape.displacement`.
        covariance: (3, 3) of `q`, without the camera's error.
        camera: (3, 6) derivatives of `q` by the camera's error, as in `BoardEstimate`.
        agreement: share of the measurements that should be visible and agree with the result.
        coverage: share of all measurements that agrees, uninformative ones included.
        residual: root mean square residual of the inliers; pixels, or metres for depth.
        ambiguous: another place fits almost as well.
        equivalent_turns: turns from `q` that fit as well [rad]; see `add_rotation_ambiguity`.
    """

    q: Array
    covariance: Array
    camera: Array
    agreement: float
    coverage: float
    residual: float
    ambiguous: bool = False
    equivalent_turns: tuple[float, ...] = ()

    def spread(self, camera: Array) -> Array:
        """(3, 3) covariance of `q` with the camera's error.

        Args:
            camera: (6, 6) covariance of the camera's pose; NaN where it is not known.
        """
        known = np.where(np.isfinite(camera), camera, 0.0)
        return self.covariance + self.camera @ known @ self.camera.T


class Aligner(Protocol):
    """Aligns an object with an image."""

    view: PinholeView
    evidence: Array
    smear: float
    """How far evidence reaches beyond what stands there [pixels]."""
    residual_floor: float
    """Residuals below this tell nothing about which of two alignments is better."""
    convincing_rating: float
    """Rating of a place near the target's angle at which no other is tried; at most 3, or 4
    with colors."""
    required_gain: float
    """By how much a place far from the target's angle must be rated higher."""
    min_rating_margin: float
    """By how much a place must be rated higher than any other to be sure."""
    checks_depth: bool
    """What stands beside the object speaks against a place."""
    sees_colors: bool
    """The image has colors."""
    max_residual: float
    """Root mean square that the alignment of the right object does not leave."""

    def align(
        self, shape: TargetShape, q: Array, others: Array, *, far: bool = True, turn: bool = True
    ) -> Alignment | None:
        """Align an object; None if the image does not determine its place."""

    def color_similarity(self, shape: TargetShape, q: Array, others: Array) -> float:
        """Color similarity of a displaced object and the image, 0 to 1; 0 for an image without
        colors, 0.5 for an object without.
        """

    def mismatch(
        self, shape: TargetShape, q: Array, others: Array, window: ImageWindow
    ) -> tuple[float, float]:
        """Area that disagrees with a displaced object, and its silhouette [raster pixels]."""


def wrap_to_pi(angle: float) -> float:
    """Wrap an angle to -pi to pi [rad]."""
    return float((angle + np.pi) % (2.0 * np.pi) - np.pi)


def are_different_places(a: Alignment, b: Alignment) -> bool:
    """Whether two alignments are at different places."""
    turn = wrap_to_pi(a.q[2] - b.q[2])
    return bool(np.hypot(*(a.q - b.q)[:2]) > 0.003 or abs(turn) > np.deg2rad(5.0))


def outline_sectors(contour: ImageContour) -> Indices:
    """(N,) index of the sector around the outline that each point belongs to."""
    x, y = (contour.pixels - contour.pixels.mean(axis=0)).T if len(contour) else np.empty((2, 0))
    # Neighbouring points of a sector may have correlated errors.
    return np.floor(np.arctan2(y, x) / (2.0 * np.pi) * 36).astype(np.int64)
