"""Uncertainty of a fitted lens over the image, and the accuracy reported for each image part."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.calibration.charuco_target import CharucoView
from burg_drake.cameras.calibration.lens_fit import (
    LensEvidence,
    LensFit,
    lens_derivatives,
)
from burg_drake.cameras.intrinsics import (
    IMAGE_PARTS,
    MAX_REPORTED_ERROR_PX,
    Intrinsics,
    describe_accuracy,
)
from burg_drake.core import Array, Indices

COVERAGE_GRID = (6, 8)
"""Rows and columns of the grid on which corners are counted."""


def corner_coverage(views: Sequence[CharucoView], size: tuple[int, int]) -> NDArray[np.int_]:
    """Counts the corners in each cell of the image.

    Args:
        views: of the target.
        size: width and height of the image [pixels].

    Returns:
        Counts in the shape of `COVERAGE_GRID`, rows from the top.
    """
    corners = np.concatenate([view.corners for view in views] or [np.empty((0, 2))])
    edges = [
        np.linspace(-0.5, n - 0.5, k + 1) for n, k in zip(size[::-1], COVERAGE_GRID, strict=True)
    ]
    counts, *_ = np.histogram2d(corners[:, 1], corners[:, 0], bins=edges)
    whole: NDArray[np.int_] = counts.astype(int)
    return whole


def unseen_parts(counts: NDArray[np.int_]) -> tuple[str, ...]:
    """Finds `IMAGE_PARTS` without corners, or with corners along less than half of an edge, by the
    counts of `corner_coverage`.
    """
    bands = (slice(0, 1), slice(1, -1), slice(-1, None))
    cells = (counts[rows, columns] for rows in bands for columns in bands)
    # Fraction of an edge's cells in which corners must be seen.
    return tuple(
        name for name, part in zip(IMAGE_PARTS, cells, strict=True) if (part > 0).mean() < 0.5
    )


def image_part_indices(pixels: Array, size: tuple[int, int]) -> Indices:
    """(N,) index into `IMAGE_PARTS` for each pixel (N, 2)."""
    bands = []
    for values, length, count in zip(pixels.T, size, COVERAGE_GRID[::-1], strict=True):
        cell = np.floor((values + 0.5) / length * count)
        bands.append((cell >= 1).astype(int) + (cell >= count - 1))
    return np.asarray(3 * bands[1] + bands[0])


BOUND_SIGMAS = 2.0
"""Standard deviations that an error exceeds in one of 20 cases."""


@dataclass(frozen=True, eq=False)
class LensHypothesis:
    """A lens model that is consistent with the corners.

    Attributes:
        weight: support of the model; the weights of all hypotheses add up to 1.
        intrinsics: fitted intrinsics.
        covariance: (P, P) of fx, fy, cx, cy and the coefficients.
    """

    weight: float
    intrinsics: Intrinsics
    covariance: Array


def image_grid(intrinsics: Intrinsics, columns: int = 13, rows: int = 9) -> Array:
    """(rows * columns, 2) points spread over the image from edge to edge [pixels]."""
    u = np.linspace(0.0, intrinsics.width - 1.0, columns)
    v = np.linspace(0.0, intrinsics.height - 1.0, rows)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def camera_covariance(fit: LensFit) -> Array:
    """(P, P) of the camera's parameters, as if the corners' errors were independent."""
    return _fit_covariance(fit)[: fit.size, : fit.size]


def lens_hypotheses(fits: Sequence[LensFit], evidence: LensEvidence) -> tuple[LensHypothesis, ...]:
    """Weights the fits of several models to the same corners by Akaike's criterion."""
    criteria = np.array([fit.criterion(evidence, False) for fit in fits])
    weights = np.exp(-0.5 * (criteria - criteria.min()))
    # Models with less support are dropped.
    kept = [k for k in range(len(fits)) if weights[k] > 1e-4 * weights.sum()]
    total = float(weights[kept].sum())
    covariance = [evidence.dispersion * camera_covariance(fits[k]) for k in kept]
    return tuple(
        LensHypothesis(float(weights[k]) / total, fits[k].intrinsics, found)
        for k, found in zip(kept, covariance, strict=True)
    )


def view_disagreement(fit: LensFit) -> float:
    """Ratio of the views' disagreement to that expected from independent errors of the corners.

    Errors of neighbouring corners are correlated by blur, a bent target or a rolling shutter. The
    jackknife measures this by the change of the projected corners when one view is left out. At
    least 1.
    """
    squares = np.zeros_like(fit.information)
    count = len(fit.residuals)
    for J, r in zip(fit.reduced, fit.residuals, strict=True):
        change = _scaled_inverse(fit.information - J.T @ J, fit) @ (J.T @ r.ravel())
        squares += (count - 1) / count * np.outer(change, change)
    J = np.concatenate(fit.reduced)
    independent = float(np.einsum("ni,ij,nj->", J, _fit_covariance(fit), J))
    seen = float(np.einsum("ni,ij,nj->", J, squares, J))
    return float(np.sqrt(max(1.0, seen / max(independent, 1e-300))))


def camera_error(
    camera: Intrinsics, hypotheses: Sequence[LensHypothesis], corners: Array, pixels: Array
) -> Array:
    """Expected error of a camera model at image points.

    A rotation of the camera that explains the difference at the corners does not count, as the
    camera's pose compensates it.

    Args:
        camera: camera to assess.
        hypotheses: plausible true cameras.
        corners: (N, 2) detected corners [pixels].
        pixels: (N, 2) image points [pixels].

    Returns:
        (N,) root mean square distance [pixels]; infinite where a fisheye looks aside or back.
    """
    # Corners at which two models are rotated onto each other.
    seen = corners[:: max(1, len(corners) // 400)]
    total = np.zeros(len(pixels))
    for hypothesis in hypotheses:
        columns, by_turn = _camera_differences(camera, hypothesis.intrinsics, pixels)
        seen_columns, seen_by_turn = _camera_differences(camera, hypothesis.intrinsics, seen)
        turn = np.linalg.lstsq(seen_by_turn, seen_columns, rcond=None)[0]
        columns = (columns - by_turn @ turn).reshape(len(pixels), 2, -1)
        off, J = columns[..., 0], columns[..., 1:]
        variance = np.einsum("nip,pq,niq->n", J, hypothesis.covariance, J)
        total += hypothesis.weight * (np.sum(off**2, axis=1) + np.maximum(variance, 0.0))
    total[camera.rays(pixels)[:, 2] <= 0.0] = np.inf
    return np.asarray(np.sqrt(total))


def _camera_differences(one: Intrinsics, other: Intrinsics, pixels: Array) -> tuple[Array, Array]:
    """Image differences of two cameras at the pixels of one: (2 N, 1 + P) the differences and their
    derivatives by the other camera's parameters; and (2 N, 3) by a rotation of the other camera.
    """
    found, by_pose, by_camera = lens_derivatives(other, one.rays(pixels))
    count = 4 + len(other.distortion)
    columns = [(found - pixels).ravel(), by_camera[..., :count].reshape(-1, count)]
    return np.column_stack(columns), by_pose[..., :3].reshape(-1, 3)


def _fit_covariance(fit: LensFit) -> Array:
    """(P + 3, P + 3) of the parameters of camera and target."""
    return np.asarray(fit.variance * _scaled_inverse(fit.information, fit))


def _scaled_inverse(information: Array, fit: LensFit) -> Array:
    """Inverts an information matrix, scaled by a fit's parameter scales."""
    scale = 1.0 / np.sqrt(np.diag(fit.information))
    outer = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(information * outer, rcond=1e-14, hermitian=True) * outer)


NOTABLE_ERROR_PX = 0.5  # Error bound that is worth reporting, in pixels.
MAX_KNOWN_ERROR_PX = 3.0  # Error bound above which the camera counts as unknown, in pixels.
MAX_FISHEYE_ANGLE = np.radians(85.0)
"""Radians from a fisheye's axis up to which an accuracy is given."""


class Promise:
    """Deprecated name of `CalibrationAccuracy`; it goes in 0.3."""

    error_bound: Any
    excepted_parts: Any

    def __new__(cls, *args: Any, **fields: Any) -> Any:
        """Makes a `CalibrationAccuracy`."""
        if cls is Promise:
            _warn_of_old_name("Promise is CalibrationAccuracy")
        return super().__new__(CalibrationAccuracy)

    @property
    def known_to(self) -> float:
        """Deprecated name of `error_bound`."""
        _warn_of_old_name("known_to is error_bound")
        return float(self.error_bound)

    @property
    def except_at(self) -> tuple[str, ...]:
        """Deprecated name of `excepted_parts`."""
        _warn_of_old_name("except_at is excepted_parts")
        return tuple(self.excepted_parts)


def _warn_of_old_name(what: str) -> None:
    warnings.warn(f"{what} since 0.1", DeprecationWarning, stacklevel=3)


@dataclass(frozen=True, eq=False)
class CalibrationAccuracy(Promise):
    """Bounds of the distance at which the true and the calibrated camera show the same point.

    In 19 of 20 cases the distance is smaller than the bound.

    Attributes:
        parts: the bound in each part of the image [pixels]; without parts that are everywhere more
            than 85 degrees off the axis.
        unknown: share of the image with a bound above 3 pixels.
    """

    parts: dict[str, float]
    unknown: float

    @property
    def excepted_parts(self) -> tuple[str, ...]:
        """Parts without a bound, or with a bound much larger than that of the middle (of the best
        part if the middle has none); the worst first.
        """
        bounds = {name: self.parts.get(name, np.inf) for name in IMAGE_PARTS}
        best = self.parts.get("middle", min(self.parts.values()))
        limit = max(NOTABLE_ERROR_PX, 2.0 * best)
        worse = [name for name, bound in bounds.items() if not bound <= limit]
        return tuple(sorted(worse, key=lambda name: -bounds[name]))

    @property
    def error_bound(self) -> float:
        """The largest bound outside the excepted parts [pixels]; infinite if there are none."""
        excepted = self.excepted_parts
        known_bounds = [bound for name, bound in self.parts.items() if name not in excepted]
        return max(known_bounds, default=np.inf)

    def bound(self, name: str) -> str:
        """The bound of a part, as text."""
        if name not in self.parts:
            return f"beyond {np.degrees(MAX_FISHEYE_ANGLE):.0f} degrees"
        bound = self.parts[name]
        if bound < MAX_REPORTED_ERROR_PX:
            return f"{bound:.2g}"
        return f"more than {MAX_REPORTED_ERROR_PX:g}"

    def __str__(self) -> str:
        bounds = {name: self.bound(name) for name in self.excepted_parts}
        return f"known {describe_accuracy(self.error_bound, self.excepted_parts, bounds)}"


def calibration_accuracy(
    camera: Intrinsics, hypotheses: Sequence[LensHypothesis], corners: Array
) -> CalibrationAccuracy:
    """The accuracy of a calibrated camera; see `camera_error`."""
    # Columns and rows of the points where the error is computed.
    pixels = image_grid(camera, 17, 13)
    pixels = pixels[camera.rays(pixels)[:, 2] > np.cos(MAX_FISHEYE_ANGLE)]
    if not len(pixels):  # views without information
        return CalibrationAccuracy(dict.fromkeys(IMAGE_PARTS, np.inf), 1.0)
    error = camera_error(camera, hypotheses, corners, pixels)
    bound = np.nan_to_num(BOUND_SIGMAS * error, nan=np.inf)
    part = image_part_indices(pixels, (camera.width, camera.height))
    parts = {
        name: float(bound[part == k].max())
        for k, name in enumerate(IMAGE_PARTS)
        if (part == k).any()
    }
    return CalibrationAccuracy(parts, float((~(bound <= MAX_KNOWN_ERROR_PX)).mean()))
