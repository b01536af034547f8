"""Intrinsics of a camera from images of a ChArUco target.

Here is which images and corners count. `lens_choice` fits models of the lens to them, `promise` and
`quality` tell how far the result can be trusted.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from burg_drake.cameras.calibration.lens_choice import AUTO, MODELS, choose_lens
from burg_drake.cameras.calibration.lens_fit import LensFit, names_of
from burg_drake.cameras.calibration.lens_uncertainty import LensHypothesis, covariance_of
from burg_drake.cameras.calibration.promise import Promise, promise_of
from burg_drake.cameras.calibration.target import (
    LEAST_CORNERS,
    CharucoTarget,
    CharucoView,
    find_target,
)
from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.sources import Image
from burg_drake.core import Array, InvalidInputError, UnknownNameError, nearest

LEAST_VIEWS = 3
"""Fewer do not determine a camera."""
BLURRED = 0.08
"""Blur of a view, as a share of a square's side, from which markers smear into the corners."""
SAME = 0.005
"""Views whose corners lie so near to each other, as a share of the image's diagonal, are one."""
OUTLIER, TOLERATED = 3.0, 0.3
"""A view is left out when its residual is beyond that many times the median view's, and beyond
that many pixels."""
WRONG_CORNER, TOLERATED_CORNER = 5.0, 0.15
"""Likewise a corner, against the median corner."""
ROUNDS = 6


@dataclass(frozen=True, eq=False)
class CalibratedView:
    """A view that the calibration used.

    Attributes:
        view: the corners that were used.
        X_CT: (4, 4) target in the camera's frame.
        residuals: (N, 2) where corners were seen less where the model puts them [pixels].
    """

    view: CharucoView
    X_CT: Array
    residuals: Array

    @property
    def rms(self) -> float:
        """Root mean square distance of the corners from where the model puts them [pixels]."""
        return rms_of(self.residuals)

    @property
    def tilt(self) -> float:
        """Angle between the camera's axis and the target's normal [rad]."""
        return float(np.arccos(np.clip(self.X_CT[2, 2], -1.0, 1.0)))


@dataclass(frozen=True, eq=False)
class Calibration:
    """What images of a target tell of a camera.

    Attributes:
        intrinsics: with the residual of the calibration.
        target: that was seen.
        model: of the lens: `pinhole`, `radial4` (k1, k2, p1, p2), `radial` (k3 also), `rational`
            (k4, k5, k6 also) or `fisheye`.
        views: that were used.
        rejected: names of the other images, and why each does not count.
        covariance: (P, P) of fx, fy, cx, cy and the coefficients, if the lens is of this model.
        hypotheses: what the lens may be by these corners, see `uncertainty`.
        bulge: how far the target is from flat, by its highest and lowest corner [m].
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
        """(N, 2) of all views [pixels]."""
        return np.concatenate([used.view.corners for used in self.views])

    @cached_property
    def promise(self) -> Promise:
        """To how many pixels the camera is known, and where it is not."""
        return promise_of(self)

    @property
    def rms(self) -> float:
        """As of a view, over all views [pixels]."""
        return rms_of(np.concatenate([view.residuals for view in self.views]))

    @property
    def parameters(self) -> dict[str, tuple[float, float]]:
        """Value and standard deviation of fx, fy, cx, cy and the coefficients, by name."""
        k = self.intrinsics
        values = (*k.focal, *k.center, *k.distortion)
        deviations = np.sqrt(np.diag(self.covariance)).tolist()
        return dict(zip(names_of(k), zip(values, deviations, strict=True), strict=True))


def rms_of(residuals: Array) -> float:
    """Root mean square length of (N, 2) residuals."""
    return float(np.sqrt(np.mean(np.sum(np.square(residuals), axis=1))))


def calibrate(
    images: Sequence[Image],
    target: CharucoTarget,
    *,
    model: str = AUTO,
    names: Sequence[str] | None = None,
) -> Calibration:
    """Calibrates a camera.

    Args:
        images: (H, W, 3) RGB or (H, W) gray, of one camera at one resolution, focus and zoom.
        target: that they show.
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
    model: str = AUTO,
    rejected: Sequence[tuple[str, str]] = (),
) -> Calibration:
    """Calibrates a camera from corners that were found.

    Args:
        views: of one camera.
        target: that they show.
        model: of the lens: `pinhole`, `radial4`, `radial`, `rational`, `fisheye`, or `auto`: the
            one of the last four that the residuals support best; a fisheye only if the lens is
            wide.
        rejected: images that are no views, and why.

    Raises:
        InvalidInputError: fewer than `LEAST_VIEWS` can be used, or they do not determine a camera.
        UnknownNameError: no such model.
    """
    if model not in (AUTO, *MODELS):
        raise UnknownNameError(
            f"lens model {model!r} does not exist; {nearest(model, (AUTO, *MODELS))}"
        )
    kept, refused = _usable(views)
    refused = [*rejected, *refused]
    _require_views(kept, refused)
    chosen = choose_lens(kept, target, model)
    for _ in range(ROUNDS):
        cleaned, outliers = _without_outliers(kept, chosen.supported)
        if cleaned == kept:
            break
        kept, refused = cleaned, refused + outliers
        _require_views(kept, refused)
        chosen = choose_lens(kept, target, model)
    fit = chosen.fit
    found = zip(kept, fit.X_CT, fit.residuals, strict=True)
    used = tuple(CalibratedView(*of_view) for of_view in found)
    residual = rms_of(np.concatenate(fit.residuals))
    calibration = Calibration(
        replace(fit.intrinsics, residual=residual),
        target,
        fit.model,
        used,
        tuple(refused),
        chosen.dispersion * covariance_of(fit),
        chosen.hypotheses,
        fit.bulge,
    )
    promise = calibration.promise
    # Of exact corners it would be rounded to nothing.
    known_to = max(round(promise.known_to, 3), 1e-3) if np.isfinite(promise.known_to) else None
    promised = replace(calibration.intrinsics, known_to=known_to, except_at=promise.except_at)
    return replace(calibration, intrinsics=promised)


def _usable(
    views: Sequence[CharucoView],
) -> tuple[list[CharucoView], list[tuple[str, str]]]:
    """Views of the size that most have, sharp and different; and the others."""
    sizes = Counter(view.size for view in views)
    kept: list[CharucoView] = []
    refused = []
    for view in views:
        (size, _), *_ = sizes.most_common(1)
        twin = next((other for other in kept if displacement(view, other) < SAME), None)
        if view.size != size:
            reason = "has {} x {} pixels, the others have {} x {}".format(*view.size, *size)
        elif view.blur > BLURRED * view.side:
            reason = f"is blurred: its edges are {view.blur:.1f} pixels wide"
        elif twin is not None:
            reason = f"shows the target in the same place as {twin.name}"
        else:
            kept.append(view)
            continue
        refused.append((view.name, reason))
    return kept, refused


def displacement(view: CharucoView, other: CharucoView) -> float:
    """Mean distance of corners between two views, as a share of the image's diagonal.

    Infinite where they have less than half of their corners in common.
    """
    _, mine, its = np.intersect1d(view.ids, other.ids, return_indices=True)
    if view.size != other.size or 2 * len(mine) < max(len(view.ids), len(other.ids)):
        return float("inf")
    lengths = np.linalg.norm(view.corners[mine] - other.corners[its], axis=1)
    return float(lengths.mean() / np.hypot(*view.size))


def _require_views(views: Sequence[CharucoView], refused: Sequence[tuple[str, str]]) -> None:
    if len(views) < LEAST_VIEWS:
        count = len(views) + len(refused)
        first = f"; {refused[0][0]} {refused[0][1]}" if refused else ""
        raise InvalidInputError(
            f"{len(views)} of {count} images can be used; a calibration needs at least"
            f" {LEAST_VIEWS}, better 15{first}"
        )


def _without_outliers(
    views: list[CharucoView], fit: LensFit
) -> tuple[list[CharucoView], list[tuple[str, str]]]:
    """Views without those, and without corners, that do not fit to the others."""
    lengths = [np.linalg.norm(r, axis=1) for r in fit.residuals]
    typical = float(np.median(np.concatenate(lengths)))
    rms = np.array([rms_of(r) for r in fit.residuals])
    limit = max(OUTLIER * float(np.median(rms)), TOLERATED)
    corner_limit = max(WRONG_CORNER * typical, TOLERATED_CORNER)
    kept, refused = [], []
    for view, length, of_view in zip(views, lengths, rms, strict=True):
        # The worst first: they pull the view's pose, and with it other corners, off their place.
        good = length <= max(corner_limit, 0.5 * length.max())
        # A few wrong corners are left out by themselves, without their view.
        if of_view > limit and (good.mean() < 0.8 or rms_of(length[good, None]) > limit):
            refused.append(
                (
                    view.name,
                    f"is {of_view:.2f} pixels off, the median is {np.median(rms):.2f}",
                )
            )
        elif good.sum() < LEAST_CORNERS:
            refused.append(
                (
                    view.name,
                    f"has {good.sum()} corners that agree with the other images;"
                    f" {LEAST_CORNERS} are needed",
                )
            )
        else:
            part = replace(view, ids=view.ids[good], corners=view.corners[good])
            kept.append(view if good.all() else part)
    return kept, refused
