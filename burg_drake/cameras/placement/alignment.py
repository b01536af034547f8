"""Alignment of an object with an image: interface, result, and robust least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.pinhole_view import ImageContour, ImageWindow, PinholeView
from burg_drake.core import TUKEY_LIMIT, Array, Indices, robust_sd, tukey_weights, wrap_to_pi


@dataclass(frozen=True, eq=False)
class DisplacementFit:
    """A displacement fitted to measurements.

    Attributes:
        step: (3,) x, y [m] and angle [rad]; the angle is 0 where it is not fitted.
        covariance: (3, 3) of the step.
        weights: (N,) robust weights of the measurements, in [0, 1]; 0 for outliers.
        scale: ratio of the measurements' actual standard deviation to the stated one.
        sensitivity: (3, N) derivatives of the step by each measurement.
    """

    step: Array
    covariance: Array
    weights: Array
    scale: float
    sensitivity: Array


def fit_displacement(
    jacobian: Array,
    offset: Array,
    deviation: Array,
    groups: Indices,
    symmetric: bool,
    unit: Array,
    nuisance: Array | None = None,
) -> DisplacementFit | None:
    """Solves `jacobian @ step + nuisance @ unknown = offset` by robust least squares.

    Args:
        jacobian: (N, 3) derivatives of `offset` by the step.
        offset: (N,) measurements.
        deviation: (N,) standard deviations of `offset`.
        groups: (N,) index of each measurement's neighbourhood. The covariance is the sandwich
            estimator for clustered errors [White 1980; Liang and Zeger 1986]: errors may correlate
            within a neighbourhood.
        symmetric: leave the angle out.
        unit: (3,) typical sizes of the step's components, for good conditioning.
        nuisance: (N, M) derivatives of `offset` by other unknowns, which have mean 0 and standard
            deviation 1.

    Returns:
        The fit, or None if the measurements do not determine the step.
    """
    used = [0, 1] if symmetric else [0, 1, 2]
    extra = np.empty((len(offset), 0)) if nuisance is None else nuisance
    A = np.hstack([(jacobian * unit)[:, used], extra]) / deviation[:, None]
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
    small_sample_factor = len(sums) / max(len(sums) - len(used), 1)
    covariance = small_sample_factor * bread @ sums.T @ sums @ bread + bread
    n, unit = len(used), unit[used]
    step, step_covariance, sensitivity = np.zeros(3), np.zeros((3, 3)), np.zeros((3, len(b)))
    step[used] = x[:n] * unit
    step_covariance[np.ix_(used, used)] = covariance[:n, :n] * np.outer(unit, unit)
    sensitivity[used] = unit[:, None] * (bread @ (A * weights[:, None]).T)[:n] / deviation
    return DisplacementFit(step, step_covariance, weights, scale, sensitivity)


def _solve_robustly(A: Array, b: Array, prior: Array, n: int) -> tuple[Array, Array, float] | None:
    """Solution x, weights and scale of `A x = b`; None if the first `n` values of x are not
    determined.
    """
    if len(b) < 4 * n:
        return None
    x: Array = np.zeros(A.shape[1])
    scale = max(robust_sd(b), 1.0)
    weights: Array = np.ones(len(b))
    for _ in range(12):  # Rounds of reweighting.
        weights = tukey_weights((b - A @ x) / scale / TUKEY_LIMIT)
        if weights.sum() < 4 * n:
            return None
        normal = (A * weights[:, None]).T @ A + prior
        values = np.linalg.eigvalsh(normal[:n, :n])
        if values[0] <= 1e-6 * values[-1]:
            return None
        x = np.asarray(np.linalg.solve(normal, (A * weights[:, None]).T @ b), dtype=float)
        scale = max(min(scale, robust_sd((b - A @ x)[weights > 0.0])), 0.3)
    return x, weights, scale


@dataclass(frozen=True, eq=False)
class Alignment:
    """The alignment of an object with an image.

    Attributes:
        q: (3,) displacement, see `TargetShape.displacement`.
        covariance: (3, 3) of `q` if the camera's pose were exact.
        camera_jacobian: (3, 6) derivatives of `q` by the error of the camera's pose, which is
            defined in `BoardEstimate`.
        agreement: share of the measurable points of the object that agree with the image.
        coverage: share of all points that agree, unmeasurable ones included.
        residual: root mean square residual of the inliers [pixels, or metres for depth].
        ambiguous: whether another place fits almost as well.
        equivalent_turns: turns from `q` that fit as well [rad]; see `add_rotation_ambiguity`.
    """

    q: Array
    covariance: Array
    camera_jacobian: Array
    agreement: float
    coverage: float
    residual: float
    ambiguous: bool = False
    equivalent_turns: tuple[float, ...] = ()

    def total_covariance(self, camera_covariance: Array) -> Array:
        """(3, 3) covariance of `q`, the error of the camera's pose included.

        Args:
            camera_covariance: (6, 6) covariance of the camera's pose; NaN where it is not known.
        """
        known = np.where(np.isfinite(camera_covariance), camera_covariance, 0.0)
        return self.covariance + self.camera_jacobian @ known @ self.camera_jacobian.T


class Aligner(Protocol):
    """Aligns objects with one image."""

    view: PinholeView
    """Camera of the image."""
    evidence: Array
    """(H, W) from +1, where an object stands, to -1, where the board is seen; 0 where unknown."""
    smear: float
    """Distance by which evidence extends beyond the object [pixels]."""
    residual_floor: float
    """Smaller residuals are treated as this one when two alignments are compared."""
    convincing_rating: float
    """Rating of a place from which on no other place is tried; ratings are at most 3, or 4 with
    colours."""
    required_gain: float
    """Rating by which a place far from the target's angle must exceed one near it."""
    min_rating_margin: float
    """Rating by which a place must exceed all others to be unambiguous."""
    checks_depth: bool
    """Whether depth that disagrees with an object at a place lowers the rating of the place."""
    sees_colors: bool
    """Whether the image has colours."""
    max_residual: float
    """Largest RMS residual of a correct alignment."""

    def align(
        self, shape: TargetShape, q: Array, others: Array, *, far: bool = True, turn: bool = True
    ) -> Alignment | None:
        """Aligns an object; None if the image does not determine its place."""

    def color_similarity(self, shape: TargetShape, q: Array, others: Array) -> float:
        """Colour similarity of a displaced object and the image, 0 to 1; 0 for an image without
        colours, 0.5 for an object without colours.
        """

    def mismatch(
        self, shape: TargetShape, q: Array, others: Array, window: ImageWindow
    ) -> tuple[float, float]:
        """Area of a window that disagrees with a displaced object, and area of the object's
        silhouette [raster pixels].
        """


def limit_step(step: Array) -> Array:
    """Limits a step (3,) to the range in which measurements are searched."""
    limit = np.array([0.02, 0.02, 0.3])  # Metres and radians.
    return np.clip(step, -limit, limit)


def step_units(shape: TargetShape) -> Array:
    """(3,) 1 mm along x and y, and the turn that moves an object's outline by about 1 mm [rad]."""
    radius = float(np.linalg.norm(np.ptp(shape.p_SV[:, :2], axis=0))) / 2
    return np.array([1e-3, 1e-3, 1e-3 / radius])


def are_different_places(a: Alignment, b: Alignment) -> bool:
    """Whether two alignments are at different places."""
    turn = wrap_to_pi(a.q[2] - b.q[2])
    return bool(np.hypot(*(a.q - b.q)[:2]) > 0.003 or abs(turn) > np.deg2rad(5.0))


def outline_sectors(contour: ImageContour) -> Indices:
    """(N,) index of each outline point's sector, of 36 around the outline's middle."""
    x, y = (contour.pixels - contour.pixels.mean(axis=0)).T if len(contour) else np.empty((2, 0))
    # Neighbouring points of a sector may have correlated errors.
    return np.floor(np.arctan2(y, x) / (2.0 * np.pi) * 36).astype(np.int64)
