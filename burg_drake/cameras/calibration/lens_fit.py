"""One least-squares fit of a camera model to views of a target, by OpenCV, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from burg_drake.cameras.calibration.target import CharucoTarget, CharucoView
from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array, InvalidInputError, make_pose

_NO_TANGENTIAL = cv2.CALIB_ZERO_TANGENT_DIST
_FIXED = cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
MODELS = {
    "pinhole": (0, _FIXED | _NO_TANGENTIAL),
    "radial4": (4, cv2.CALIB_FIX_K3),
    "radial": (5, 0),
    "rational": (8, cv2.CALIB_RATIONAL_MODEL),
}
"""Number of distortion coefficients of each lens model, and OpenCV's flags."""
NAMES = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
CRITERIA = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 300, 1e-14)


@dataclass(frozen=True, eq=False)
class LensFit:
    """A fitted camera model.

    Attributes:
        model: of the lens, a key of `MODELS`.
        intrinsics: fitted.
        X_CT: (V, 4, 4) target in the camera's frame, of each view.
        residuals: of each view (N, 2): where corners were seen less where the model puts them
            [pixels].
        covariance: (P, P) of fx, fy, cx, cy and the coefficients.
    """

    model: str
    intrinsics: Intrinsics
    X_CT: Array
    residuals: tuple[Array, ...]
    covariance: Array

    @property
    def squares(self) -> float:
        """Sum of the squared residuals [pixels^2]."""
        return float(sum(np.sum(r**2) for r in self.residuals))

    def information(self, bayesian: bool) -> float:
        """Bayesian information criterion, or Akaike's, which is more generous to large models: the
        lowest of several models is best supported."""
        n = sum(r.size for r in self.residuals)
        penalty = np.log(n) if bayesian else 2.0
        return float(n * np.log(self.squares / n) + penalty * len(self.covariance))


def fit_lens(
    views: Sequence[CharucoView], target: CharucoTarget, model: str, start: LensFit | None = None
) -> LensFit:
    """Fits a camera model.

    Args:
        views: images of one camera, all of one size.
        target: what they show.
        model: of the lens, a key of `MODELS`.
        start: a fit of a simpler model to begin from.

    Raises:
        InvalidInputError: the views do not determine a camera.
    """
    count, flags = MODELS[model]
    width, height = views[0].size
    points = [target.p_TQ[view.ids].astype(np.float32) for view in views]
    pixels = [view.corners.astype(np.float32) for view in views]
    K, k = np.eye(3), np.zeros(max(count, 5))
    if start is not None:
        K, flags = start.intrinsics.K.copy(), flags | cv2.CALIB_USE_INTRINSIC_GUESS
        k[: len(start.intrinsics.distortion)] = start.intrinsics.distortion
    try:
        _, K, k, rotations, translations = cv2.calibrateCamera(
            points, pixels, (width, height), K, k, flags=flags, criteria=CRITERIA
        )
    except cv2.error as error:
        raise InvalidInputError(
            f"{len(views)} views of the target do not determine a camera; take more, tilted to"
            " all sides"
        ) from error
    k = np.asarray(k, dtype=float).ravel()[: max(count, 5)]
    if not (np.isfinite(K).all() and np.isfinite(k).all() and K[0, 0] > 0.0 and K[1, 1] > 0.0):
        raise InvalidInputError("the views of the target do not determine a camera; tilt it more")
    residuals, reduced = [], []
    for p, q, rotation, translation in zip(points, pixels, rotations, translations, strict=True):
        expected, J = cv2.projectPoints(p.astype(float), rotation, translation, K, k)
        residuals.append(q.astype(float) - np.asarray(expected).reshape(-1, 2))
        reduced.append(_of_camera(J, count))
    X_CT = [
        make_pose(cv2.Rodrigues(r)[0], np.ravel(t))
        for r, t in zip(rotations, translations, strict=True)
    ]
    return LensFit(
        model,
        Intrinsics(
            width=width,
            height=height,
            focal=(float(K[0, 0]), float(K[1, 1])),
            center=(float(K[0, 2]), float(K[1, 2])),
            distortion=tuple(k[:count].tolist()),
        ),
        np.array(X_CT),
        tuple(residuals),
        _covariance(np.concatenate(reduced), residuals),
    )


def _of_camera(J: Array, count: int) -> Array:
    """Derivatives of a view's pixels by the camera's parameters, without what a change of the
    view's pose explains, which is no information about the camera.

    Args:
        J: by the pose, focal lengths, center and coefficients, as OpenCV gives them.
        count: of the model's coefficients.
    """
    of_pose = np.linalg.qr(J[:, :6])[0]
    of_camera = J[:, 6 : 10 + count]
    return np.asarray(of_camera - of_pose @ (of_pose.T @ of_camera))


def _covariance(J: Array, residuals: Sequence[Array]) -> Array:
    """(P, P) of the camera's parameters: J (M, P) derivatives of all pixels, poses marginalised."""
    freedom = sum(r.size for r in residuals) - J.shape[1] - 6 * len(residuals)
    variance = sum(np.sum(r**2) for r in residuals) / max(freedom, 1)
    scale = np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    inverse = np.linalg.pinv((J / scale).T @ (J / scale), rcond=1e-14)
    return np.asarray(variance * inverse / np.outer(scale, scale))
