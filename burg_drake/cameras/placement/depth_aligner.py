"""Align an object with a depth image: point to plane [Chen and Medioni 1992], and outline.

The outline is used only where the depth behind it is clearly larger.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.placement.alignment import (
    Alignment,
    DisplacementFit,
    fit_displacement,
    limit_step,
    outline_sectors,
    step_units,
)
from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.pinhole_view import (
    ImageContour,
    ImageWindow,
    PinholeView,
    sample_nearest,
    visible_outline,
    window_slices,
)
from burg_drake.core import (
    Array,
    Booleans,
    InvalidInputError,
    Single,
    inverse,
    robust_sd,
    transform_points,
)

MIN_HEIGHT_SIGMAS = 4.0
"""Noise standard deviations above the board at which an object is present."""


def check_depth(depth: NDArray[Any], intrinsics: Intrinsics) -> Single:
    """Depth image (H, W) as float32 in metres, 0 where nothing was measured.

    Raises:
        InvalidInputError: the size is not that of the intrinsics, or the unit is not metres.
    """
    depth = np.asarray(depth)
    if depth.ndim != 2 or depth.dtype.kind not in "fui":
        raise InvalidInputError(
            f"the depth image has shape {depth.shape} and type {depth.dtype}; expected (H, W) in"
            " metres"
        )
    intrinsics.require_size(depth.shape[1], depth.shape[0], "the depth image")
    clean = np.where(np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)
    if not clean.any():
        raise InvalidInputError("the depth image is empty: no pixel has a depth above 0")
    median = float(np.median(clean[clean > 0]))
    if median > 20.0:  # Metres. Larger medians mean that the unit is wrong.
        raise InvalidInputError(
            f"the median of the depth image is {median:g} m; give metres (is it in millimetres?)"
        )
    return clean


class DepthAligner:
    """Aligns objects with one depth image.

    Args:
        view: camera of the image.
        depth: (H, W) image without lens distortion [m]; 0 where nothing was measured.

    Attributes:
        noise_sd: standard deviation of the heights of the board's surface [m].
    """

    def __init__(self, view: PinholeView, depth: Single) -> None:
        min_noise = 5e-4  # Metres.
        self.view = view
        self.convincing_rating, self.required_gain = 2.94, 0.02
        self.min_rating_margin, self.checks_depth = 0.03, True
        self._depth = depth.astype(float)
        u, v = np.meshgrid(np.arange(view.size[0]), np.arange(view.size[1]))
        fx, fy, cx, cy = view.K[0, 0], view.K[1, 1], view.K[0, 2], view.K[1, 2]
        rays = np.stack([(u - cx) / fx, (v - cy) / fy, np.ones_like(u)], axis=-1)
        self._p_SQ = transform_points(view.X_SC, (rays * self._depth[..., None]).reshape(-1, 3))
        self._p_SQ = self._p_SQ.reshape(*depth.shape, 3)
        self._valid = self._depth > 0.0
        height = self._p_SQ[..., 2]
        low = np.abs(height[self._valid & (np.abs(height) < 0.01)])
        spread = robust_sd(low) if len(low) > 100 else 2.0 * min_noise
        self.noise_sd = max(spread, min_noise)
        # Metres. Fits of the right object leave less.
        self.residual_floor, self.max_residual = self.noise_sd, 0.005
        self._above_board = self._valid & (height > MIN_HEIGHT_SIGMAS * self.noise_sd)
        evidence = np.clip(height / (MIN_HEIGHT_SIGMAS * self.noise_sd), 0.0, 1.0) * 2.0 - 1.0
        self.sees_colors, self.smear = False, 0.0
        self.evidence = np.where(self._valid, evidence, 0.0)

    def align(
        self, shape: TargetShape, q: Array, others: Array, *, far: bool = True, turn: bool = True
    ) -> Alignment | None:
        """Aligns an object; see `SilhouetteAligner.align`."""
        # Metres from the surface within which points belong to it, round by round.
        max_distances = (0.03, 0.02, 0.014, 0.01, 0.008, 0.006)
        start, best = q, None
        for number in range(14):  # Iterations of matching and solving.
            limit = max_distances[min(number, len(max_distances) - 1)] if far else max_distances[-1]
            found = _DepthMeasurements(self, shape, q, others, limit)
            solved = found.solve(turn)
            if solved is None or np.linalg.norm(q[:2] - start[:2]) > 0.05:
                return None
            q = q + limit_step(solved.step)
            best = found, solved
            # Metres. Smaller steps end the rounds.
            if limit == max_distances[-1] and np.abs(solved.step[:2]).max() < 2e-5:
                break
        assert best is not None
        return best[0].result(q, best[1])

    def color_similarity(self, shape: TargetShape, q: Array, others: Array) -> float:
        """0, as depth has no colours."""
        return 0.0

    def mismatch(
        self, shape: TargetShape, q: Array, others: Array, window: ImageWindow
    ) -> tuple[float, float]:
        """Area with depths of neither the object nor the empty board; see
        `SilhouetteAligner.mismatch`.
        """
        surface_tolerance = 4e-3  # Metres beyond noise within which a pixel belongs to the surface.
        at = window.pixels()
        own = self.view.hits(shape, q, at)[1]
        seen, hides = sample_nearest(self._depth, at, 0.0), sample_nearest(others, at, 0.0)
        covered = np.isfinite(own)
        tolerance = MIN_HEIGHT_SIGMAS * self.noise_sd + surface_tolerance
        depth_differs = np.abs(seen - np.where(covered, own, 0.0)) > tolerance
        wrong = np.where(covered, depth_differs, sample_nearest(self._above_board, at, 0.0) > 0.0)
        # pixels of another object count only where this one is clearly in front
        free = np.isinf(hides) | (covered & (hides > own + surface_tolerance))
        wrong &= (seen > 0.0) & free
        return float(wrong.sum()), float(covered.sum())

    def points(self, shape: TargetShape, q: Array, others: Array) -> tuple[Array, Booleans]:
        """Measured points (N, 3) in S near a displaced object that belong to no other object, and
        (N,) whether the object's silhouette covers them.
        """
        window = self.view.window(shape, q, 12.0)
        part = window_slices(window)
        free = self._above_board[part] & ~(np.abs(others[part] - self._depth[part]) < 0.01)
        free &= ~(others[part] < self._depth[part])
        covered = np.isfinite(self.view.buffer(shape, q, window))
        p_SQ, inside = self._p_SQ[part][free], covered[free]
        step = max(1, len(p_SQ) // 4000)  # Approximate number of points that are used.
        return p_SQ[::step], inside[::step]

    def edges(self, contour: ImageContour, others: Array) -> tuple[Array, Booleans]:
        """(N,) distance along the outline's normals to the depth edge [pixels], and (N,) whether
        there is one.

        A depth edge is a step from the outline's own depth to clearly larger depth.
        """
        min_depth_step = 0.012  # Metres from an outline to the surface behind it.
        search_distance = 6.0  # Pixels on both sides of the outline.
        t = np.arange(-search_distance, search_distance + 0.1, 0.25)
        points = contour.points(t)
        depth = sample_nearest(self._depth, points, 0.0)
        p_CQ, _ = self.view.project(contour.p_SQ)
        near = p_CQ[:, 2:]
        own = (depth > 0.0) & (depth < near + min_depth_step / 2) & (depth > near - 0.03)
        behind = depth > near + min_depth_step
        count = np.cumprod(own, axis=1).sum(axis=1)  # inner samples at its own depth
        at = np.minimum(count, len(t) - 1)
        falls = (count > 4) & (count < len(t) - 4) & behind[np.arange(len(count)), at]
        falls &= ~np.isfinite(sample_nearest(others, points, np.inf)).any(axis=1)
        return t[at] - 0.125, falls


class _DepthMeasurements:
    """Measurements of a displaced object in a depth image."""

    def __init__(
        self, aligner: DepthAligner, shape: TargetShape, q: Array, others: Array, limit: float
    ) -> None:
        self._shape, self._noise = shape, aligner.noise_sd
        X_SS = shape.displacement(q)
        points, covered = aligner.points(shape, q, others)
        self._count = int(covered.sum())
        surface, normals = shape.surface
        p_SC = transform_points(inverse(X_SS), aligner.view.X_SC[:3, 3][None])[0]
        facing = np.einsum("ni,ni->n", normals, p_SC - surface) > 0.0
        surface, normals = surface[facing], normals[facing]
        moved = transform_points(inverse(X_SS), points)
        if len(moved) and len(surface):
            distance, near = cKDTree(surface).query(moved)
        else:
            distance, near = np.empty(0), np.empty(0, dtype=int)
        close = distance < limit
        self._fits = int((close & covered).sum())
        n = normals[near[close]] @ X_SS[:3, :3].T
        p = points[close]
        on_surface = transform_points(X_SS, surface[near[close]])
        self._offset = np.einsum("ni,ni->n", n, p - on_surface)
        arm = on_surface - shape.p_SR - (q[0], q[1], 0.0)
        turn = arm[:, 0] * n[:, 1] - arm[:, 1] * n[:, 0]
        self._jacobian = np.column_stack([n[:, 0], n[:, 1], turn])
        ray = p - aligner.view.X_SC[:3, 3]
        self._camera_jacobian = np.concatenate([np.cross(ray, n), n], axis=1)
        ray = ray / np.maximum(np.linalg.norm(ray, axis=1), 1e-9)[:, None]
        slant = np.abs(np.einsum("ni,ni->n", n, ray))
        # Metres. Error of a surface point besides noise.
        self._deviation = np.hypot(5e-4, aligner.noise_sd * slant)
        height = np.clip((moved[close][:, 2] / 0.02).astype(int), 0, 20)
        around = np.arctan2(*(moved[close] - shape.p_SR)[:, 1::-1].T) / (2.0 * np.pi) * 24
        self._groups = np.floor(around).astype(np.int64) * 32 + height
        self._add_outline(aligner, shape, q, others)

    def _add_outline(
        self, aligner: DepthAligner, shape: TargetShape, q: Array, others: Array
    ) -> None:
        """Appends measurements of the outline, in metres at the object."""
        contour = visible_outline(aligner.view, shape, q, others)
        offset, falls = aligner.edges(contour, others)
        p_CQ, _ = aligner.view.project(contour.p_SQ[falls])
        pixel = p_CQ[:, 2] / aligner.view.K[0, 0]
        self._surface_points = len(self._offset)
        self._offset = np.concatenate([self._offset, offset[falls] * pixel])
        self._jacobian = np.concatenate(
            [self._jacobian, contour.displacement_jacobian[falls] * pixel[:, None]]
        )
        self._camera_jacobian = np.concatenate(
            [self._camera_jacobian, -contour.camera_jacobian[falls] * pixel[:, None]]
        )
        # Pixels. Quantization (0.29) and smeared edges.
        self._deviation = np.concatenate([self._deviation, 0.6 * pixel])
        self._groups = np.concatenate([self._groups, 100_000 + outline_sectors(contour)[falls]])

    def solve(self, turn: bool) -> DisplacementFit | None:
        """Fits the step to the measurements."""
        if len(self._offset) < 30:
            return None
        return fit_displacement(
            self._jacobian,
            self._offset,
            self._deviation,
            self._groups,
            self._shape.symmetric or not turn,
            step_units(self._shape),
        )

    def result(self, q: Array, solved: DisplacementFit) -> Alignment:
        """Builds the alignment, with the last step applied."""
        residual = (self._offset - self._jacobian @ solved.step)[: self._surface_points]
        fits = np.abs(residual) < 4.0 * self._noise + 2e-3
        share = self._fits / max(self._count, 1) * (fits.mean() if len(fits) else 0.0)
        return Alignment(
            q,
            solved.covariance,
            solved.sensitivity @ self._camera_jacobian,
            float(share),
            float(share),
            float(np.sqrt(np.mean(residual[fits] ** 2))) if fits.any() else float("nan"),
        )
