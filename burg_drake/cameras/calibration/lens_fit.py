"""One least-squares fit of a camera model to views of a target.

Levenberg and Marquardt's steps on the camera, the bend of the target and the poses of all views. Of
each view's pose there is only what the others need: the equations are reduced to these (Schur).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import cv2
import numpy as np

from burg_drake.cameras.calibration.lens_derivatives import lens_derivatives
from burg_drake.cameras.calibration.lens_prior import BENDS, prior
from burg_drake.cameras.calibration.target import CharucoTarget, CharucoView
from burg_drake.cameras.optics import Intrinsics, LensModel
from burg_drake.core import Array, InvalidInputError

COEFFICIENTS = {"pinhole": 0, "radial4": 4, "radial": 5, "rational": 8, "fisheye": 4}
"""Number of distortion coefficients of each lens model."""
PERSPECTIVE_NAMES = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
FISHEYE_NAMES = ("k1", "k2", "k3", "k4")
NOISE = 0.05
"""Of corners, against which all that is weighed in a fit [pixels]."""
BEND = 0.3e-3
"""How far targets bulge, about, from their middle to the ends of their longer side [m]. Glued paper
is not flat; taken as flat, one that rises by 0.5 mm puts cameras off by 0.8 to 2.3 pixels."""
TAIL, SMALLEST_TAIL = 3.0, 0.02
"""Residuals beyond so many times the median one, and so many pixels, count linearly (Huber), so
that a flexible model does not bend to corners that do not belong."""
ROUNDS = 200
SMALL_GAIN = 1e-9
"""The fit has ended when a round lowers the sum of squares by no larger a share."""
MOST_DAMPING = 1e8


class _State(NamedTuple):
    """A camera, the target's bends (3,) and poses on the way: cost, and of N corners residuals
    (N, 2), weights (N,) and derivatives (N, 2, 6) and (N, 2, P + 3)."""

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
    """How much corners tell about which model is right.

    Attributes:
        limit: residuals beyond are of corners that do not belong, and tell no more than this
            [pixels].
        dispersion: how many corners, with errors that are alike, tell as much as one with its own
            (Burnham and Anderson, Model Selection and Multimodel Inference, 2002, section 2.5).
    """

    limit: float
    dispersion: float


@dataclass(frozen=True, eq=False)
class LensFit:
    """A fitted camera model.

    Attributes:
        model: of the lens, a key of `COEFFICIENTS`.
        intrinsics: fitted.
        X_CT: (V, 4, 4) target in the camera's frame, of each view.
        residuals: of each view (N, 2): where corners were seen less where the model puts them
            [pixels].
        bends: (3,) of the target along x^2, x y and y^2 [of what is usual].
        bulge: difference of the target's highest and lowest corner by these [m].
        reduced: of each view (2 N, P + 3) derivatives of its pixels by fx, fy, cx, cy, the
            coefficients and bends, without what a change of the view's pose explains, which is no
            information about them.
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
        """Of a coordinate of a corner, as the residuals tell it [pixels^2]."""
        count = sum(r.size for r in self.residuals)
        return self.squares / max(count - self.size - BENDS - 6 * len(self.residuals), 1)

    @property
    def squares(self) -> float:
        """Sum of the squared residuals [pixels^2]."""
        return float(sum(np.sum(r**2) for r in self.residuals))

    @property
    def size(self) -> int:
        """Number of the camera's parameters."""
        return 4 + COEFFICIENTS[self.model]

    @property
    def typical(self) -> float:
        """Median length of the residuals [pixels]."""
        return float(np.median(np.linalg.norm(np.concatenate(self.residuals), axis=1)))

    def information(self, evidence: LensEvidence, bayesian: bool) -> float:
        """Bayesian information criterion, or Akaike's, which is more generous to large models: the
        lowest of several models is best supported."""
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
    bend: float = BEND,
) -> LensFit:
    """Fits a camera model.

    Args:
        views: images of one camera, all of one size.
        target: what they show.
        model: of the lens, a key of `COEFFICIENTS`.
        start: a camera near by, of a simpler model or the same, and (V, 4, 4) the target in its
            frame.
        bend: how far the target bulges, about [m].

    Raises:
        InvalidInputError: the views do not determine a camera.
    """
    camera = _padded(start[0], model)
    problem = _Problem(views, target, camera, bend)
    state = problem.fitted(camera, np.zeros(BENDS), start[1])
    typical = float(np.median(np.linalg.norm(state.residuals, axis=1)))
    problem.limit = max(TAIL * typical, SMALLEST_TAIL)
    state = problem.fitted(state.intrinsics, state.bends, state.X_CT)
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


def names_of(camera: Intrinsics) -> tuple[str, ...]:
    """Of a camera's parameters."""
    names = FISHEYE_NAMES if camera.is_fisheye else PERSPECTIVE_NAMES[: len(camera.distortion)]
    return ("fx", "fy", "cx", "cy", *names)


def _padded(camera: Intrinsics, model: str) -> Intrinsics:
    """A camera with as many coefficients as a model has."""
    k = np.zeros(COEFFICIENTS[model])
    known = camera.distortion[: len(k)]
    k[: len(known)] = known
    lens: LensModel = "fisheye" if model == "fisheye" else "perspective"
    return replace(camera, model=lens, distortion=tuple(k.tolist()), residual=None)


class _Problem:
    """The sum of squares of a fit, and steps that lower it."""

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

    def at(self, intrinsics: Intrinsics, bends: Array, X_CT: Array) -> _State:
        """Cost and derivatives."""
        X = X_CT[self.view]
        p_TQ = self.p_TQ + (self.rise @ bends)[:, None] * [0.0, 0.0, 1.0]
        p_CQ = np.einsum("nij,nj->ni", X[:, :3, :3], p_TQ) + X[:, :3, 3]
        pixels, by_pose, by_camera = lens_derivatives(intrinsics, p_CQ)
        residuals = self.pixels - pixels
        length = np.maximum(np.linalg.norm(residuals, axis=1), 1e-12)
        weights = np.minimum(1.0, self.limit / length)
        # Huber's: r^2 up to the limit c, then 2 c r - c^2.
        loss = np.sum(weights * length**2 * (2.0 - weights))
        cost = float(loss + NOISE**2 * np.sum(prior(intrinsics, bends)[0] ** 2))
        if not (np.isfinite(cost) and (intrinsics.is_fisheye or (p_CQ[:, 2] > 0.0).all())):
            cost = np.inf
        by_rise = np.einsum("nki,ni->nk", by_pose[..., 3:], X[:, :3, 2])
        by_bends = by_rise[:, :, None] * self.rise[:, None]
        by_others = np.concatenate([by_camera[..., : self.size], by_bends], axis=2)
        return _State(intrinsics, bends, X_CT, cost, residuals, weights, by_pose, by_others)

    def fitted(self, camera: Intrinsics, bends: Array, X_CT: Array) -> _State:
        """The state of lowest cost that steps from a camera lead to.

        Raises:
            InvalidInputError: the views do not determine a camera.
        """
        state, damping = self.at(camera, bends, X_CT), 1e-3
        for _ in range(ROUNDS):
            better, damping = self.step(state, damping)
            if better is None:
                break
            gain, state = 1.0 - better.cost / state.cost, better
            if gain < SMALL_GAIN:
                break
        if not np.isfinite(state.cost):
            raise InvalidInputError(
                f"{len(self.counts)} views of the target do not determine the intrinsics; take"
                " more, with the target tilted to all sides"
            )
        return state

    def step(self, state: _State, damping: float) -> tuple[_State | None, float]:
        """A state of lower cost and the next damping; None if there is no such."""
        root = np.sqrt(state.weights)[:, None]
        Jp, Jc, r = (
            state.by_pose * root[..., None],
            state.by_others * root[..., None],
            state.residuals * root,
        )
        pose = np.add.reduceat(np.einsum("nki,nkj->nij", Jp, Jp), self.starts)
        mixed = np.add.reduceat(np.einsum("nki,nkj->nij", Jp, Jc), self.starts)
        errors, slopes = prior(state.intrinsics, state.bends)
        camera = np.einsum("nki,nkj->ij", Jc, Jc) + NOISE**2 * np.diag(slopes**2)
        of_pose = np.add.reduceat(np.einsum("nki,nk->ni", Jp, r), self.starts)
        of_camera = np.einsum("nki,nk->i", Jc, r)
        of_camera -= NOISE**2 * errors * slopes
        diagonal = np.einsum("vii->vi", pose)
        while damping < MOST_DAMPING:
            damped = pose + damping * diagonal[:, :, None] * np.eye(6)
            solved = np.linalg.solve(damped, np.concatenate([mixed, of_pose[..., None]], axis=2))
            left = camera + damping * np.diag(np.diag(camera))
            left = left - np.einsum("vij,vik->jk", mixed, solved[..., :-1])
            right = of_camera - np.einsum("vij,vi->j", mixed, solved[..., -1])
            scale = 1.0 / np.sqrt(np.maximum(np.diag(left), 1e-300))
            scaled = left * np.outer(scale, scale)
            change = scale * np.linalg.lstsq(scaled, scale * right, rcond=None)[0]
            poses = solved[..., -1] - solved[..., :-1] @ change
            found = self._moved(state, change, poses)
            if found is not None and found.cost < state.cost:
                return found, max(0.1 * damping, 1e-12)
            damping *= 10.0
        return None, damping

    def _moved(self, state: _State, change: Array, poses: Array) -> _State | None:
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
        return self.at(camera, state.bends + change[self.size :], X_CT)
