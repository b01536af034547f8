"""Least-squares fit of a lens model to views of a target: initial guess, derivatives, prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np

from burg_drake.cameras.calibration.charuco_target import CharucoTarget, CharucoView
from burg_drake.cameras.intrinsics import Intrinsics, LensModel
from burg_drake.core import Array, InvalidInputError

FOCAL_LENGTH_GUESSES = np.geomspace(0.25, 3.0, 11)
"""Initial focal lengths, as fractions of the image's diagonal."""


def guess_camera(
    views: Sequence[CharucoView], target: CharucoTarget, model: LensModel
) -> tuple[Intrinsics, Array]:
    """Guesses a camera without distortion, and (V, 4, 4) poses of the target in its frame, by the
    focal length that explains the median view best.
    """
    width, height = views[0].size
    found = []
    for share in FOCAL_LENGTH_GUESSES:
        focal = float(share * np.hypot(width, height))
        camera = Intrinsics(
            width=width,
            height=height,
            focal=(focal, focal),
            center=(0.5 * (width - 1), 0.5 * (height - 1)),
            model=model,
            distortion=(0.0,) * 4,
        )
        view_poses = [_fit_view_pose(view, target, camera) for view in views]
        errors, X_CT = zip(*view_poses, strict=True)
        found.append((np.median(errors), camera, np.array(X_CT)))
    return min(found, key=lambda one: one[0])[1:]


def _fit_view_pose(
    view: CharucoView, target: CharucoTarget, camera: Intrinsics
) -> tuple[float, Array]:
    """Mean reprojection error of a view at the best pose [pixels], and the pose (4, 4)."""
    p_TQ = target.p_TQ[view.ids]
    straight = np.ascontiguousarray((camera.undistort(view.corners) - camera.center) / camera.focal)
    _, rotations, translations, _ = cv2.solvePnPGeneric(
        p_TQ, straight, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    best = (np.inf, _frontal_pose(p_TQ, straight))
    for rotation, translation in zip(rotations, translations, strict=True):
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = cv2.Rodrigues(rotation)[0], np.ravel(translation)
        p_CQ = p_TQ @ X[:3, :3].T + X[:3, 3]
        if not (p_CQ[:, 2] > 0.0).all():
            continue
        residual = camera.project(p_CQ) - view.corners
        error = float(np.linalg.norm(residual, axis=1).mean())
        if error < best[0]:
            best = error, X
    return best


def _frontal_pose(p_TQ: Array, straight: Array) -> Array:
    """(4, 4) pose of a target that is parallel to the image and has its size there: for views that
    no pose explains, which are rejected later.
    """
    size = float(np.std(p_TQ[:, :2]) / max(float(np.std(straight)), 1e-9))
    X = np.eye(4)
    X[:3, 3] = size * np.r_[straight.mean(axis=0), 1.0] - p_TQ.mean(axis=0)
    return X


def lens_derivatives(intrinsics: Intrinsics, p_CQ: Array) -> tuple[Array, Array, Array]:
    """Projects points and differentiates the projection.

    Args:
        intrinsics: of the camera.
        p_CQ: (N, 3) points in front of the camera, in its frame [m].

    Returns:
        `(pixels, by_pose, by_camera)`: (N, 2); (N, 2, 6) by a small rotation [rad] of the points
        about the camera's axes and a translation [m]; (N, 2, P) by fx, fy, cx, cy and the
        coefficients, of which a perspective model has 5 at least.
    """
    zero, points = np.zeros(3), np.ascontiguousarray(p_CQ, dtype=float).reshape(-1, 1, 3)
    k = np.array(intrinsics.distortion)
    if intrinsics.is_fisheye:
        pixels, J = cv2.fisheye.projectPoints(points, zero, zero, intrinsics.K, k)
        pose, camera = slice(8, 14), slice(8)
    else:
        k = np.pad(k, (0, max(5 - len(k), 0)))
        pixels, J = cv2.projectPoints(points, zero, zero, intrinsics.K, k)
        pose, camera = slice(6), slice(6, None)
    J = np.asarray(J).reshape(len(points), 2, -1)
    return np.asarray(pixels).reshape(-1, 2), J[..., pose], J[..., camera]


BEND_TERMS = 3
"""Number of terms of a target's bend: x^2, x y and y^2."""
PERSPECTIVE_POWERS = np.array([2, 4, 2, 2, 6, 2, 4, 6])
"""Power of the distance from the centre in each coefficient's term."""
FISHEYE_POWERS = np.array([2, 4, 6, 8])
"""Power of the distance from the centre in each coefficient's term."""


def lens_prior(camera: Intrinsics, bends: Array) -> tuple[Array, Array]:
    """Prior of the parameters of a camera and a target.

    Returns:
        `(errors, slopes)`: (P + 3,) deviations of the parameters from their expected values, in
        standard deviations, and their derivatives.
    """
    focal_log_sd = 0.5  # Standard deviation of the logarithm of the focal length over the diagonal.
    center_sd = 0.1  # Standard deviation of the principal point, as a fraction of the diagonal.
    size = np.array([camera.width, camera.height])
    diagonal = float(np.hypot(*size))
    reach = min(1.0, 0.5 * diagonal / camera.focal[0])
    powers = FISHEYE_POWERS if camera.is_fisheye else PERSPECTIVE_POWERS[: len(camera.distortion)]
    # Each term of the lens formula has a standard deviation of 1 in the image's corners.
    weights = reach**powers
    center_deviation = (np.array(camera.center) - 0.5 * (size - 1)) / (center_sd * diagonal)
    focal = np.array(camera.focal)
    errors = np.r_[
        np.log(focal / diagonal) / focal_log_sd, center_deviation, weights * camera.distortion
    ]
    slopes = np.r_[1.0 / (focal_log_sd * focal), [1.0 / (center_sd * diagonal)] * 2, weights]
    return np.r_[errors, bends], np.r_[slopes, np.ones(BEND_TERMS)]


COEFFICIENT_COUNTS = {"pinhole": 0, "radial4": 4, "radial": 5, "rational": 8, "fisheye": 4}
"""Number of distortion coefficients of each lens model."""
CORNER_SD_PX = 0.05
"""Standard deviation of corners against which the prior is weighted, in pixels."""
HUBER_RATIO = 3.0  # Residuals above this multiple of the median count linearly (Huber).


class _LensFitState(NamedTuple):
    """Camera, bends (3,) and poses (V, 4, 4) of a fit; their cost; and residuals (N, 2), weights
    (N,) and derivatives (N, 2, 6) and (N, 2, P + 3) of N corners.
    """

    intrinsics: Intrinsics
    bends: Array
    X_CT: Array
    cost: float
    residuals: Array
    weights: Array
    by_pose: Array
    by_others: Array


@dataclass(frozen=True)
class LensEvidence:
    """Evidence of the corners for the comparison of lens models.

    Attributes:
        limit: larger residuals belong to outliers and count as this one [pixels].
        dispersion: number of corners with correlated errors that count as one independent corner
            (Burnham and Anderson, Model Selection and Multimodel Inference, 2002, section 2.5).
    """

    limit: float
    dispersion: float


@dataclass(frozen=True, eq=False)
class LensFit:
    """A fitted camera model.

    Attributes:
        model: of the lens, a key of `COEFFICIENT_COUNTS`.
        intrinsics: fitted intrinsics.
        X_CT: (V, 4, 4) pose of the target in the camera's frame in each view.
        residuals: (N, 2) measured minus projected corners of each view [pixels].
        bends: (3,) bends of the target along x^2, x y and y^2, in usual bends.
        bulge: height difference of the target's highest and lowest corner by `bends` [m].
        reduced: (2 N, P + 3) derivatives of each view's pixels by fx, fy, cx, cy, the coefficients
            and bends, without the part that a change of the view's pose explains.
    """

    model: str
    intrinsics: Intrinsics
    X_CT: Array
    residuals: tuple[Array, ...]
    bends: Array
    bulge: float
    reduced: tuple[Array, ...]

    @property
    def variance(self) -> float:
        """Variance of a corner's coordinate, from the residuals [pixels^2]."""
        count = sum(r.size for r in self.residuals)
        return self.squares / max(count - self.size - BEND_TERMS - 6 * len(self.residuals), 1)

    @property
    def squares(self) -> float:
        """Sum of the squared residuals [pixels^2]."""
        return float(sum(np.sum(r**2) for r in self.residuals))

    @property
    def size(self) -> int:
        """Number of the camera's parameters."""
        return 4 + COEFFICIENT_COUNTS[self.model]

    @cached_property
    def information(self) -> Array:
        """(P + 3, P + 3) inverse covariance of the parameters of camera and target for corners of
        variance 1, the prior included.
        """
        J = np.concatenate(self.reduced)
        slopes = lens_prior(self.intrinsics, self.bends)[1]
        return np.asarray(J.T @ J + self.variance * np.diag(slopes**2))

    @property
    def median_residual(self) -> float:
        """Median length of the residuals [pixels]."""
        return float(np.median(np.linalg.norm(np.concatenate(self.residuals), axis=1)))

    def criterion(self, evidence: LensEvidence, bayesian: bool) -> float:
        """Bayesian information criterion, or Akaike's, which penalizes large models less. The best
        supported model has the lowest value.
        """
        squares = np.sum(np.concatenate(self.residuals) ** 2, axis=1)
        n = 2 * len(squares)
        total = max(float(np.minimum(squares, evidence.limit**2).sum()), 1e-18)
        penalty = np.log(n) if bayesian else 2.0
        return float(n * np.log(total / n) / evidence.dispersion + penalty * self.size)


def fit_lens(
    views: Sequence[CharucoView],
    target: CharucoTarget,
    model: str,
    start: tuple[Intrinsics, Array],
    bend: float = 0.3e-3,
) -> LensFit:
    """Fits a camera model.

    Args:
        views: views of one camera, all of one size.
        target: target that the views show.
        model: of the lens, a key of `COEFFICIENT_COUNTS`.
        start: initial camera, of the same or a simpler model, and (V, 4, 4) poses of the target in
            its frame.
        bend: usual bulge of a target [m].

    Raises:
        InvalidInputError: the views do not determine a camera.
    """
    camera = _pad_coefficients(start[0], model)
    problem = _LensFitProblem(views, target, camera, bend)
    state = problem.minimize(camera, np.zeros(BEND_TERMS), start[1])
    typical = float(np.median(np.linalg.norm(state.residuals, axis=1)))
    problem.limit = max(HUBER_RATIO * typical, 0.02)  # Pixels.
    state = problem.minimize(state.intrinsics, state.bends, state.X_CT)
    ends = np.cumsum(problem.counts)[:-1]
    reduced = []
    for of_pose, of_others in zip(
        np.split(state.by_pose, ends), np.split(state.by_others, ends), strict=True
    ):
        basis = np.linalg.qr(of_pose.reshape(-1, 6))[0]
        flat = of_others.reshape(len(basis), -1)
        reduced.append(flat - basis @ (basis.T @ flat))
    return LensFit(
        model,
        state.intrinsics,
        state.X_CT,
        tuple(np.split(state.residuals, ends)),
        state.bends,
        float(np.ptp(problem.rise @ state.bends)),
        tuple(reduced),
    )


def parameter_names(camera: Intrinsics) -> tuple[str, ...]:
    """Names of a camera's parameters."""
    names: tuple[str, ...] = ("k1", "k2", "k3", "k4")  # OpenCV's order.
    if not camera.is_fisheye:
        names = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")[: len(camera.distortion)]
    return ("fx", "fy", "cx", "cy", *names)


def _pad_coefficients(camera: Intrinsics, model: str) -> Intrinsics:
    """Pads a camera's coefficients to the number of a model."""
    count = COEFFICIENT_COUNTS[model]
    distortion = (*camera.distortion, *(0.0,) * count)[:count]
    lens: LensModel = "fisheye" if model == "fisheye" else "perspective"
    return replace(camera, model=lens, distortion=distortion, residual=None)


class _LensFitProblem:
    """The least-squares problem of a fit, and its minimization."""

    def __init__(
        self,
        views: Sequence[CharucoView],
        target: CharucoTarget,
        camera: Intrinsics,
        bend: float,
    ) -> None:
        self.size = 4 + len(camera.distortion)
        self.limit = np.inf
        self.counts = [len(view.ids) for view in views]
        self.view = np.repeat(np.arange(len(views)), self.counts)
        self.starts = np.r_[0, np.cumsum(self.counts)[:-1]]
        self.p_TQ = np.concatenate([target.p_TQ[view.ids] for view in views])
        self.pixels = np.concatenate([view.corners for view in views])
        half = 0.5 * np.array(target.size)
        x, y = ((self.p_TQ[:, :2] - half) / half.max()).T
        self.rise = bend * np.stack([x * x, x * y, y * y], axis=1)

    def evaluate(self, intrinsics: Intrinsics, bends: Array, X_CT: Array) -> _LensFitState:
        """Computes cost and derivatives."""
        X = X_CT[self.view]
        p_TQ = self.p_TQ + (self.rise @ bends)[:, None] * [0.0, 0.0, 1.0]
        p_CQ = np.einsum("nij,nj->ni", X[:, :3, :3], p_TQ) + X[:, :3, 3]
        pixels, by_pose, by_camera = lens_derivatives(intrinsics, p_CQ)
        residuals = self.pixels - pixels
        length = np.maximum(np.linalg.norm(residuals, axis=1), 1e-12)
        weights = np.minimum(1.0, self.limit / length)
        # Huber's loss: r^2 up to the limit c, then 2 c r - c^2.
        loss = np.sum(weights * length**2 * (2.0 - weights))
        cost = float(loss + CORNER_SD_PX**2 * np.sum(lens_prior(intrinsics, bends)[0] ** 2))
        if not (np.isfinite(cost) and (p_CQ[:, 2] > 0.0).all()):
            cost = np.inf
        by_rise = np.einsum("nki,ni->nk", by_pose[..., 3:], X[:, :3, 2])
        by_bends = by_rise[:, :, None] * self.rise[:, None]
        by_others = np.concatenate([by_camera[..., : self.size], by_bends], axis=2)
        return _LensFitState(intrinsics, bends, X_CT, cost, residuals, weights, by_pose, by_others)

    def minimize(self, camera: Intrinsics, bends: Array, X_CT: Array) -> _LensFitState:
        """Minimizes the cost from an initial camera.

        Raises:
            InvalidInputError: the views do not determine a camera.
        """
        state, damping = self.evaluate(camera, bends, X_CT), 1e-3
        for _ in range(200):  # Iterations, at most.
            better, damping = self.step(state, damping)
            if better is None:
                break
            gain, state = 1.0 - better.cost / state.cost, better
            if gain < 1e-9:  # The fit ends when the sum of squares decreases by a smaller fraction.
                break
        if not np.isfinite(state.cost):
            raise InvalidInputError(
                f"{len(self.counts)} views of the target do not determine the intrinsics; take"
                " more, with the target tilted to all sides"
            )
        return state

    def step(self, state: _LensFitState, damping: float) -> tuple[_LensFitState | None, float]:
        """Finds a state of lower cost and the next damping; None if there is none."""
        root = np.sqrt(state.weights)[:, None]
        Jp, Jc = state.by_pose * root[..., None], state.by_others * root[..., None]
        r = state.residuals * root
        pose = np.add.reduceat(np.einsum("nki,nkj->nij", Jp, Jp), self.starts)
        mixed = np.add.reduceat(np.einsum("nki,nkj->nij", Jp, Jc), self.starts)
        errors, slopes = lens_prior(state.intrinsics, state.bends)
        camera = np.einsum("nki,nkj->ij", Jc, Jc) + CORNER_SD_PX**2 * np.diag(slopes**2)
        of_pose = np.add.reduceat(np.einsum("nki,nk->ni", Jp, r), self.starts)
        of_camera = np.einsum("nki,nk->i", Jc, r)
        of_camera -= CORNER_SD_PX**2 * errors * slopes
        diagonal = np.einsum("vii->vi", pose)
        while damping < 1e8:  # Levenberg-Marquardt damping at which no step lowers the cost.
            damped = pose + damping * diagonal[:, :, None] * np.eye(6)
            solved = np.linalg.solve(damped, np.concatenate([mixed, of_pose[..., None]], axis=2))
            reduced_camera = camera + damping * np.diag(np.diag(camera))
            reduced_camera = reduced_camera - np.einsum("vij,vik->jk", mixed, solved[..., :-1])
            right = of_camera - np.einsum("vij,vi->j", mixed, solved[..., -1])
            scale = 1.0 / np.sqrt(np.maximum(np.diag(reduced_camera), 1e-300))
            scaled = reduced_camera * np.outer(scale, scale)
            change = scale * np.linalg.lstsq(scaled, scale * right, rcond=None)[0]
            poses = solved[..., -1] - solved[..., :-1] @ change
            found = self._take_step(state, change, poses)
            if found is not None and found.cost < state.cost:
                return found, max(0.1 * damping, 1e-12)
            damping *= 10.0
        return None, damping

    def _take_step(self, state: _LensFitState, change: Array, poses: Array) -> _LensFitState | None:
        k = state.intrinsics
        values = np.r_[k.focal, k.center, k.distortion] + change[: self.size]
        if not np.isfinite(values).all() or values[:2].min() <= 0.0:
            return None
        camera = replace(
            k,
            focal=(float(values[0]), float(values[1])),
            center=(float(values[2]), float(values[3])),
            distortion=tuple(values[4:].tolist()),
        )
        X_CT = state.X_CT.copy()
        for X, twist in zip(X_CT, poses, strict=True):
            R = cv2.Rodrigues(twist[:3])[0]
            X[:3, :3], X[:3, 3] = R @ X[:3, :3], R @ X[:3, 3] + twist[3:]
        return self.evaluate(camera, state.bends + change[self.size :], X_CT)
