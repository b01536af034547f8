"""How far a fitted camera model may be off, over the image.

The corners that were seen often support several models about as well, which differ where none was
seen. So the error of one is taken over all of them, each weighed by how well it fits (Burnham and
Anderson, Model Selection and Multimodel Inference, 2002, section 4.3): how far it is from the one,
and how far its own parameters may be off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from burg_drake.cameras.calibration.lens_derivatives import lens_derivatives
from burg_drake.cameras.calibration.lens_fit import LensEvidence, LensFit
from burg_drake.cameras.calibration.lens_prior import prior
from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array

BOUND = 2.0
"""Standard deviations that errors exceed in one of 20 cases."""
LEAST_WEIGHT = 1e-4
"""Models that are supported less do not count."""
ALIGNED = 400
"""Corners at which models are turned onto each other, at most."""


@dataclass(frozen=True, eq=False)
class LensHypothesis:
    """A model that the corners do not refute.

    Attributes:
        weight: how well it is supported; those of all hypotheses add up to 1.
        intrinsics: fitted.
        covariance: (P, P) of fx, fy, cx, cy and the coefficients.
    """

    weight: float
    intrinsics: Intrinsics
    covariance: Array


class CalibratedCamera(Protocol):
    """A camera model, what else it may be, and where that was seen."""

    @property
    def intrinsics(self) -> Intrinsics:
        """The camera."""

    @property
    def hypotheses(self) -> tuple[LensHypothesis, ...]:
        """What it may be."""

    @property
    def corners(self) -> Array:
        """(N, 2) that were seen [pixels]."""


def image_grid(intrinsics: Intrinsics, columns: int = 13, rows: int = 9) -> Array:
    """(rows * columns, 2) places spread over the image from edge to edge [pixels]."""
    u = np.linspace(0.0, intrinsics.width - 1.0, columns)
    v = np.linspace(0.0, intrinsics.height - 1.0, rows)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def covariance_of(fit: LensFit) -> Array:
    """(P, P) of the camera's parameters, as if the corners' errors were independent."""
    return _covariance(fit)[: fit.size, : fit.size]


def hypotheses_of(fits: Sequence[LensFit], evidence: LensEvidence) -> tuple[LensHypothesis, ...]:
    """Fits of several models to the same corners, weighed by Akaike's criterion."""
    information = np.array([fit.information(evidence, False) for fit in fits])
    weights = np.exp(-0.5 * (information - information.min()))
    kept = [k for k in range(len(fits)) if weights[k] > LEAST_WEIGHT * weights.sum()]
    total = float(weights[kept].sum())
    return tuple(
        LensHypothesis(
            float(weights[k]) / total,
            fits[k].intrinsics,
            evidence.dispersion * covariance_of(fits[k]),
        )
        for k in kept
    )


def view_disagreement(fit: LensFit) -> float:
    """How many times as far views disagree as they would if all corners had errors of their own.

    Errors of neighbouring corners are alike: blur, a bent target, a shutter that reads line by
    line. What the camera changes by when one view is left out knows that (the jackknife), over
    where corners were seen. At least 1.
    """
    H, squares = _information(fit), np.zeros_like(_information(fit))
    count = len(fit.residuals)
    for J, r in zip(fit.reduced, fit.residuals, strict=True):
        change = _inverse(H - J.T @ J, fit) @ (J.T @ r.ravel())
        squares += (count - 1) / count * np.outer(change, change)
    J = np.concatenate(fit.reduced)
    independent = float(np.einsum("ni,ij,nj->", J, _covariance(fit), J))
    seen = float(np.einsum("ni,ij,nj->", J, squares, J))
    return float(np.sqrt(max(1.0, seen / max(independent, 1e-300))))


def uncertainty(calibrated: CalibratedCamera, pixels: Array) -> Array:
    """How far the camera model may be off at places of the image.

    A turn of the camera that explains the difference where corners were seen does not count: the
    camera's pose takes it up.

    Args:
        calibrated: such as a `Calibration`.
        pixels: (N, 2) places [pixels].

    Returns:
        (N,) root mean square distance [pixels].
    """
    return error_of(calibrated.intrinsics, calibrated.hypotheses, calibrated.corners, pixels)


def error_of(
    camera: Intrinsics, hypotheses: Sequence[LensHypothesis], corners: Array, pixels: Array
) -> Array:
    """The same of any camera.

    Args:
        camera: whose error is asked for.
        hypotheses: what the true camera may be.
        corners: (N, 2) that were seen [pixels].
        pixels: (N, 2) places [pixels].
    """
    seen = corners[:: max(1, len(corners) // ALIGNED)]
    total = np.zeros(len(pixels))
    for hypothesis in hypotheses:
        here = _Differences(camera, hypothesis.intrinsics, pixels)
        there = _Differences(camera, hypothesis.intrinsics, seen)
        turn = np.linalg.lstsq(there.by_turn, there.columns, rcond=None)[0]
        columns = (here.columns - here.by_turn @ turn).reshape(len(pixels), 2, -1)
        off, J = columns[..., 0], columns[..., 1:]
        variance = np.einsum("nip,pq,niq->n", J, hypothesis.covariance, J)
        total += hypothesis.weight * (np.sum(off**2, axis=1) + np.maximum(variance, 0.0))
    return np.asarray(np.sqrt(total))


class _Differences:
    """How far another camera shows what one shows at some pixels: (2 N, 1 + P), its distance from
    there and how that changes with its parameters; and (2 N, 3), with a turn of it."""

    def __init__(self, one: Intrinsics, other: Intrinsics, pixels: Array) -> None:
        found, by_pose, by_camera = lens_derivatives(other, one.rays(pixels))
        count = 4 + len(other.distortion)
        self.by_turn = by_pose[..., :3].reshape(-1, 3)
        self.columns = np.column_stack(
            [(found - pixels).ravel(), by_camera[..., :count].reshape(-1, count)]
        )


def _covariance(fit: LensFit) -> Array:
    """(P + 3, P + 3) of the parameters of camera and target."""
    return np.asarray(fit.variance * _inverse(_information(fit), fit))


def _information(fit: LensFit) -> Array:
    """(P + 3, P + 3) inverse covariance for corners of variance 1, the prior's included."""
    J = np.concatenate(fit.reduced)
    return np.asarray(J.T @ J + fit.variance * np.diag(prior(fit.intrinsics, fit.bends)[1] ** 2))


def _inverse(information: Array, fit: LensFit) -> Array:
    """Of a matrix whose parameters have the scales of a fit's."""
    scale = 1.0 / np.sqrt(np.diag(_information(fit)))
    outer = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(information * outer, rcond=1e-14, hermitian=True) * outer)
