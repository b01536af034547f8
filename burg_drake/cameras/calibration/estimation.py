"""Calibrate a camera: choose the lens model, reject outliers and fit."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from burg_drake.cameras.calibration.charuco_target import (
    MIN_CORNERS,
    CharucoTarget,
    CharucoView,
    find_target,
)
from burg_drake.cameras.calibration.lens_fit import (
    COEFFICIENT_COUNTS,
    HUBER_RATIO,
    LensEvidence,
    LensFit,
    fit_lens,
    guess_camera,
    parameter_names,
)
from burg_drake.cameras.calibration.lens_uncertainty import (
    CalibrationAccuracy,
    LensHypothesis,
    calibration_accuracy,
    camera_covariance,
    camera_error,
    image_grid,
    lens_hypotheses,
    view_disagreement,
)
from burg_drake.cameras.frame_source import Image
from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.core import Array, InvalidInputError, UnknownNameError, suggest_names

AUTO_LENS_MODEL = "auto"  # Choose the lens model by evidence.
LENS_MODELS = tuple(COEFFICIENT_COUNTS)  # Names of all lens models.


@dataclass(frozen=True, eq=False)
class LensChoice:
    """The chosen fit and the plausible alternatives.

    Attributes:
        fit: of the requested model, or of the best supported one.
        supported: the best supported fit, for the rejection of outliers.
        hypotheses: plausible lenses.
        dispersion: of the corners' errors, see `LensEvidence`.
    """

    fit: LensFit
    supported: LensFit
    hypotheses: tuple[LensHypothesis, ...]
    dispersion: float


def choose_lens(views: Sequence[CharucoView], target: CharucoTarget, model: str) -> LensChoice:
    """Fits all lens models and chooses one.

    Args:
        views: views of one camera.
        target: target that the views show.
        model: a key of `COEFFICIENT_COUNTS`, or `auto`.

    Raises:
        InvalidInputError: the views do not determine a camera.
    """
    perspective = _fit_perspective_models(views, target)
    fisheye = fit_lens(views, target, "fisheye", guess_camera(views, target, "fisheye"))
    # A fisheye is tried only if the image's corners are farther off the axis.
    corner_rays = fisheye.intrinsics.rays(image_grid(fisheye.intrinsics, 2, 2))
    is_wide = np.arccos(corner_rays[:, 2]).max() > np.radians(55.0)
    fits = [*perspective, fisheye] if is_wide else perspective
    # All lenses distort a little, so that the pinhole, the first fit, is not chosen.
    # Views disagree by a wrong model and by one that they do not determine. So the model with the
    # least disagreement shows the correlation of errors.
    limit = HUBER_RATIO * min(fit.median_residual for fit in fits[1:])
    evidence = LensEvidence(limit, min(view_disagreement(fit) for fit in fits[1:]) ** 2)
    best = min(fits[1:], key=lambda fit: fit.criterion(evidence, True))
    # Perspective models are invalid beside the camera, so they say nothing about a fisheye.
    hypotheses = lens_hypotheses([best] if best is fisheye else fits, evidence)
    supported = best
    if model != AUTO_LENS_MODEL:
        best = next(fit for fit in (*perspective, fisheye) if fit.model == model)
    elif best is not fisheye:
        corners = np.concatenate([view.corners for view in views])
        best = _rational_if_better(best, perspective[-1], evidence, hypotheses, corners)
    return LensChoice(best, supported, hypotheses, evidence.dispersion)


def _rational_if_better(
    best: LensFit,
    rational: LensFit,
    evidence: LensEvidence,
    hypotheses: tuple[LensHypothesis, ...],
    corners: Array,
) -> LensFit:
    """The rational fit if Akaike's more generous criterion prefers it and it is nearer to all
    hypotheses; else the best fit. A rational lens may fit better and still be wild where there
    are no corners.
    """
    if not rational.criterion(evidence, False) < best.criterion(evidence, False):
        return best
    pixels = image_grid(best.intrinsics)
    worst = [
        camera_error(fit.intrinsics, hypotheses, corners, pixels).max() for fit in (best, rational)
    ]
    return rational if worst[1] < worst[0] else best


def _fit_perspective_models(views: Sequence[CharucoView], target: CharucoTarget) -> list[LensFit]:
    """Fits the perspective models, each from the one before."""
    start = guess_camera(views, target, "perspective")
    fits = []
    # From the simplest on; each model contains the one before.
    for model in ("pinhole", "radial4", "radial", "rational"):
        fits.append(fit_lens(views, target, model, start))
        start = fits[-1].intrinsics, fits[-1].X_CT
    return fits


MAX_VIEW_BLUR = 0.08
"""Largest blur of a usable view, as a fraction of a square's side."""


@dataclass(frozen=True, eq=False)
class CalibratedView:
    """A view that the calibration used.

    Attributes:
        view: the corners that were used.
        X_CT: (4, 4) target in the camera's frame.
        residuals: (N, 2) measured minus projected corners [pixels].
    """

    view: CharucoView
    X_CT: Array
    residuals: Array

    @property
    def rms(self) -> float:
        """Root mean square reprojection error of the corners [pixels]."""
        return rms_length(self.residuals)

    @property
    def tilt(self) -> float:
        """Angle between the camera's axis and the target's normal [rad]."""
        return float(np.arccos(np.clip(self.X_CT[2, 2], -1.0, 1.0)))


@dataclass(frozen=True, eq=False)
class Calibration:
    """The calibration of a camera from images of a target.

    Attributes:
        intrinsics: with the residual of the calibration.
        target: target in the images.
        model: of the lens: `pinhole`, `radial4` (k1, k2, p1, p2), `radial` (k3 also), `rational`
            (k4, k5, k6 also) or `fisheye`.
        views: views that were used.
        rejected: names of rejected images, and the reasons.
        covariance: (P, P) of fx, fy, cx, cy and the coefficients, if the lens is of this model.
        hypotheses: lenses that are plausible by these corners, see `camera_error`.
        bulge: height difference of the target's highest and lowest corner [m].
    """

    intrinsics: Intrinsics
    target: CharucoTarget
    model: str
    views: tuple[CalibratedView, ...]
    rejected: tuple[tuple[str, str], ...]
    covariance: Array
    hypotheses: tuple[LensHypothesis, ...]
    bulge: float

    @cached_property
    def corners(self) -> Array:
        """(N, 2) corners of all views [pixels]."""
        return np.concatenate([used.view.corners for used in self.views])

    @cached_property
    def accuracy(self) -> CalibrationAccuracy:
        """Error bounds of the calibrated camera over the image."""
        return calibration_accuracy(self.intrinsics, self.hypotheses, self.corners)

    @property
    def promise(self) -> CalibrationAccuracy:
        """Deprecated name of `accuracy`; it goes in 0.3."""
        warnings.warn("promise is accuracy since 0.1", DeprecationWarning, stacklevel=2)
        return self.accuracy

    @property
    def rms(self) -> float:
        """Root mean square reprojection error over all views [pixels]."""
        return rms_length(np.concatenate([view.residuals for view in self.views]))

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Value and standard deviation of fx, fy, cx, cy and the coefficients, by name."""
        k = self.intrinsics
        values = (*k.focal, *k.center, *k.distortion)
        deviations = np.sqrt(np.diag(self.covariance)).tolist()
        return dict(zip(parameter_names(k), zip(values, deviations, strict=True), strict=True))


def rms_length(residuals: Array) -> float:
    """Root mean square length of (N, 2) residuals."""
    return float(np.sqrt(np.mean(np.sum(np.square(residuals), axis=1))))


def calibrate(
    images: Sequence[Image],
    target: CharucoTarget,
    *,
    model: str = AUTO_LENS_MODEL,
    names: Sequence[str] | None = None,
) -> Calibration:
    """Calibrates a camera.

    Args:
        images: (H, W, 3) RGB or (H, W) gray, of one camera at one resolution, focus and zoom.
        target: target that the images show.
        model: of the lens, see `calibrate_views`.
        names: of the images; numbers from 0 if not given.

    Raises:
        InvalidInputError: too few images show the target, or they do not determine a camera.
        UnknownNameError: no such model.
    """
    views, rejected = [], []
    for number, image in enumerate(images):
        name = f"image {number}" if names is None else names[number]
        found = find_target(image, target, name)
        if isinstance(found, str):
            rejected.append((name, found))
        else:
            views.append(found)
    return calibrate_views(views, target, model=model, rejected=rejected)


def calibrate_views(
    views: Sequence[CharucoView],
    target: CharucoTarget,
    *,
    model: str = AUTO_LENS_MODEL,
    rejected: Sequence[tuple[str, str]] = (),
) -> Calibration:
    """Calibrates a camera from corners that were found.

    Args:
        views: views of one camera.
        target: target that the views show.
        model: of the lens: `pinhole`, `radial4`, `radial`, `rational`, `fisheye`, or `auto`: the
            one of the last four that the residuals support best; a fisheye only if the lens is
            wide.
        rejected: images without a view, and the reasons.

    Raises:
        InvalidInputError: fewer than 3 views can be used, or they do not determine a camera.
        UnknownNameError: no such model.
    """
    known = (AUTO_LENS_MODEL, *LENS_MODELS)
    if model not in known:
        raise UnknownNameError(
            f"lens model {model!r} does not exist; {suggest_names(model, known)}"
        )
    kept, refused = _select_usable_views(views)
    refused = [*rejected, *refused]
    _require_views(kept, refused)
    chosen = choose_lens(kept, target, model)
    for _ in range(6):  # Rounds of outlier rejection, at most.
        cleaned, outliers = _reject_outliers(kept, chosen.supported)
        if cleaned == kept:
            break
        kept, refused = cleaned, refused + outliers
        _require_views(kept, refused)
        chosen = choose_lens(kept, target, model)
    fit = chosen.fit
    found = zip(kept, fit.X_CT, fit.residuals, strict=True)
    used = tuple(CalibratedView(*of_view) for of_view in found)
    residual = rms_length(np.concatenate(fit.residuals))
    calibration = Calibration(
        replace(fit.intrinsics, residual=residual),
        target,
        fit.model,
        used,
        tuple(refused),
        chosen.dispersion * camera_covariance(fit),
        chosen.hypotheses,
        fit.bulge,
    )
    accuracy, known_to = calibration.accuracy, None
    if np.isfinite(accuracy.error_bound):
        known_to = max(round(accuracy.error_bound, 3), 1e-3)  # above 0 with exact corners, too
    intrinsics = replace(
        calibration.intrinsics, known_to=known_to, except_at=accuracy.excepted_parts
    )
    return replace(calibration, intrinsics=intrinsics)


def _select_usable_views(
    views: Sequence[CharucoView],
) -> tuple[list[CharucoView], list[tuple[str, str]]]:
    """Selects sharp and different views of the most frequent size; returns them and the rejected
    ones.
    """
    sizes = Counter(view.size for view in views)
    kept: list[CharucoView] = []
    refused = []
    for view in views:
        (size, _), *_ = sizes.most_common(1)
        # Fraction of the diagonal; nearer views are duplicates.
        duplicate = next(
            (other for other in kept if corner_displacement(view, other) < 0.005), None
        )
        if view.size != size:
            reason = "has {} x {} pixels, the others have {} x {}".format(*view.size, *size)
        elif view.blur > MAX_VIEW_BLUR * view.side:
            reason = f"is blurred: its edges are {view.blur:.1f} pixels wide"
        elif duplicate is not None:
            reason = f"shows the target in the same place as {duplicate.name}"
        else:
            kept.append(view)
            continue
        refused.append((view.name, reason))
    return kept, refused


def corner_displacement(view: CharucoView, other: CharucoView) -> float:
    """Mean distance of corners between two views, as a share of the image's diagonal.

    Infinite if the views have less than half of their corners in common.
    """
    _, mine, its = np.intersect1d(view.ids, other.ids, return_indices=True)
    if view.size != other.size or 2 * len(mine) < max(len(view.ids), len(other.ids)):
        return float("inf")
    lengths = np.linalg.norm(view.corners[mine] - other.corners[its], axis=1)
    return float(lengths.mean() / np.hypot(*view.size))


def _require_views(views: Sequence[CharucoView], refused: Sequence[tuple[str, str]]) -> None:
    min_views = 3  # Fewer views do not determine a camera.
    if len(views) < min_views:
        count = len(views) + len(refused)
        first = f"; {refused[0][0]} {refused[0][1]}" if refused else ""
        raise InvalidInputError(
            f"{len(views)} of {count} images can be used; a calibration needs at least"
            f" {min_views}, better 15{first}"
        )


def _reject_outliers(
    views: list[CharucoView], fit: LensFit
) -> tuple[list[CharucoView], list[tuple[str, str]]]:
    """Removes views and corners that do not fit the others."""
    lengths = [np.linalg.norm(r, axis=1) for r in fit.residuals]
    typical = float(np.median(np.concatenate(lengths)))
    rms = np.array([rms_length(r) for r in fit.residuals])
    median = float(np.median(rms))
    limit = max(3.0 * median, 0.3)  # Pixels.
    corner_limit = max(5.0 * typical, 0.15)  # Pixels.
    kept, refused = [], []
    for view, length, of_view in zip(views, lengths, rms, strict=True):
        # The worst first: they shift the view's pose and with it other corners.
        good = length <= max(corner_limit, 0.5 * length.max())
        # A few wrong corners are removed without their view.
        if of_view > limit and (good.mean() < 0.8 or rms_length(length[good, None]) > limit):
            reason = f"is {of_view:.2f} pixels off, the median is {median:.2f}"
        elif good.sum() < MIN_CORNERS:
            reason = (
                f"has {good.sum()} corners that agree with the other images; {MIN_CORNERS} are"
                " needed"
            )
        else:
            part = replace(view, ids=view.ids[good], corners=view.corners[good])
            kept.append(view if good.all() else part)
            continue
        refused.append((view.name, reason))
    return kept, refused
