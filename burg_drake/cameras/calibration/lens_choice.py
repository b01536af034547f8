"""Which model of a lens the corners support, and which others they do not refute."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.cameras.calibration.first_guess import first_guess
from burg_drake.cameras.calibration.lens_fit import (
    COEFFICIENTS,
    TAIL,
    LensEvidence,
    LensFit,
    fit_lens,
)
from burg_drake.cameras.calibration.lens_uncertainty import (
    LensHypothesis,
    error_of,
    hypotheses_of,
    image_grid,
    view_disagreement,
)
from burg_drake.cameras.calibration.target import CharucoTarget, CharucoView
from burg_drake.core import Array

AUTO = "auto"
MODELS = tuple(COEFFICIENTS)
PERSPECTIVE = ("pinhole", "radial4", "radial", "rational")
"""From the simplest on, each of which the next one contains."""
WIDE = np.radians(55.0)
"""Where the image's corners look less far off the axis, a fisheye is not tried: the model has no
tangential distortion, and other lenses have."""


@dataclass(frozen=True, eq=False)
class LensChoice:
    """A fit, and what else the lens may be.

    Attributes:
        fit: of the model that was asked for, or that is supported best.
        supported: the fit that is supported best, to tell which corners do not belong.
        hypotheses: what the lens may be.
        dispersion: of the corners' errors, see `LensEvidence`.
    """

    fit: LensFit
    supported: LensFit
    hypotheses: tuple[LensHypothesis, ...]
    dispersion: float


def choose_lens(views: Sequence[CharucoView], target: CharucoTarget, model: str) -> LensChoice:
    """Fits all models and chooses.

    Args:
        views: of one camera.
        target: that they show.
        model: a key of `COEFFICIENTS`, or `auto`.

    Raises:
        InvalidInputError: the views do not determine a camera.
    """
    perspective, fisheye = _perspective(views, target), _fisheye(views, target)
    fits = [*perspective, fisheye] if _is_wide(fisheye) else perspective
    # All lenses distort a little, so that a pinhole is not chosen.
    evidence = _evidence(fits[1:])
    best = min(fits[1:], key=lambda fit: fit.information(evidence, True))
    # Beside the camera a perspective model means nothing, so it tells nothing about a fisheye.
    hypotheses = hypotheses_of([best] if best is fisheye else fits, evidence)
    supported = best
    if model != AUTO:
        best = next(fit for fit in (*perspective, fisheye) if fit.model == model)
    elif best is not fisheye:
        corners = np.concatenate([view.corners for view in views])
        best = _more_flexible(best, perspective[-1], evidence, hypotheses, corners)
    return LensChoice(best, supported, hypotheses, evidence.dispersion)


def _evidence(fits: Sequence[LensFit]) -> LensEvidence:
    """Views disagree by a model that is wrong, and by one that they do not determine, so that the
    one by which they agree most tells how alike errors are."""
    limit = TAIL * min(fit.typical for fit in fits)
    return LensEvidence(limit, min(view_disagreement(fit) for fit in fits) ** 2)


def _more_flexible(
    best: LensFit,
    rational: LensFit,
    evidence: LensEvidence,
    hypotheses: tuple[LensHypothesis, ...],
    corners: Array,
) -> LensFit:
    """The rational fit, if Akaike's criterion, which is more generous, prefers it, and it is nearer
    to all that the lens may be: it can fit better and yet be wild where no corners were seen."""
    if not rational.information(evidence, False) < best.information(evidence, False):
        return best
    pixels = image_grid(best.intrinsics)
    worst = [
        error_of(fit.intrinsics, hypotheses, corners, pixels).max() for fit in (best, rational)
    ]
    return rational if worst[1] < worst[0] else best


def _perspective(views: Sequence[CharucoView], target: CharucoTarget) -> list[LensFit]:
    """Fits of the perspective models, each from the one before."""
    start = first_guess(views, target, "perspective")
    fits = []
    for model in PERSPECTIVE:
        fits.append(fit_lens(views, target, model, start))
        start = fits[-1].intrinsics, fits[-1].X_CT
    return fits


def _fisheye(views: Sequence[CharucoView], target: CharucoTarget) -> LensFit:
    return fit_lens(views, target, "fisheye", first_guess(views, target, "fisheye"))


def _is_wide(fisheye: LensFit) -> bool:
    camera = fisheye.intrinsics
    corners = camera.rays(image_grid(camera, 2, 2))
    return bool(np.arccos(corners[:, 2]).max() > WIDE)
