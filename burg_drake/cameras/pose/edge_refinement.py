"""Refine a pose with thousands of edges of all markers instead of four corners each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.pose.edge_measurement import (
    EDGE_MARGIN_PX,
    MAX_EDGE_OFFSET_PX,
    EdgeFits,
    EdgeViews,
    MarkerEdges,
    fit_edges,
    has_expected_profile,
    offset_variance,
    perturbed_pose,
    predict_pixels,
    project_edges,
)
from burg_drake.cameras.pose.sheet_deviations import (
    Disturbance,
    DisturbanceFit,
    MarkerShifts,
    SheetModes,
    residuals_within_markers,
)
from burg_drake.core import (
    TUKEY_LIMIT,
    Array,
    Booleans,
    Indices,
    Single,
    robust_sd,
    tukey_weights,
)

INITIAL_BLURS = np.array(
    [variance * np.eye(2) for variance in (0.1, 0.5, 2.5)]
    + [[[0.4 + 4.0 * c * c, 4.0 * c * s], [4.0 * c * s, 0.4 + 4.0 * s * s]]
       for c, s in ((1.0, 0.0), (0.7071, 0.7071), (0.0, 1.0), (0.7071, -0.7071))]
)  # fmt: skip
"""Initial covariances of the blur in square pixels: sharp, and motion of 7 pixels."""
FIRST_EDGES = 160  # Edges of the first rounds, in which the pose is coarse.
LAST_EDGES = 800  # Edges of the last rounds.
MIN_EDGES = 24  # Edges of a refined pose.
OFFSET_MODEL_SD_PX = 0.01  # Error of an offset in images without noise.
WEIGHT_ROUNDS = 3  # Rounds of robust weights in a step.


@dataclass(frozen=True, eq=False)
class LightSpread:
    """How light spreads in an image.

    Attributes:
        blur: (2, 2) covariance of lens, motion and pixel together [pixels^2].
        bloom: distance by which white areas are larger on all sides than in the print [pixels]:
            from overexposure, an encoding other than sRGB, or too little ink.
    """

    blur: Array
    bloom: float = 0.0

    @property
    def variance(self) -> float:
        """Mean of both directions [pixels^2]."""
        return float(np.trace(self.blur)) / 2.0


@dataclass(frozen=True, eq=False)
class EdgeRound:
    """Edges and pose of one refinement round.

    Attributes:
        X_SC: (4, 4) pose after the round.
        covariance: (6, 6) of the pose, see `BoardEstimate`.
        views: edges as predicted by the pose before the round.
        fits: edges as measured.
        weight: (N,) weight of each edge, 0 to 1; 0 for outliers.
        residual: (N,) residual of each edge [pixels].
        sd: (N,) expected standard deviation of each edge's offset [pixels].
        spread: how light spreads.
        rms_motion: root mean square motion of the edges in this round [pixels].
    """

    X_SC: Array
    covariance: Array
    views: EdgeViews
    fits: EdgeFits
    weight: Array
    residual: Array
    sd: Array
    spread: LightSpread
    rms_motion: float

    def shift_equations(self, edges: MarkerEdges) -> tuple[Array, Array]:
        """(M, 2, 2) and (M, 2) normal equations of a shift of each marker by its edges' residuals
        [pixels].
        """
        marker, normal = edges.marker[self.views.which], self.views.normal
        information = self.weight / self.sd**2
        count = edges.marker.max() + 1
        G, g = np.zeros((count, 2, 2)), np.zeros((count, 2))
        np.add.at(G, marker, information[:, None, None] * normal[:, :, None] * normal[:, None])
        np.add.at(g, marker, (information * self.residual)[:, None] * normal)
        return G, g


@dataclass(frozen=True, eq=False)
class RefinedPose(EdgeRound):
    """The result of the last round, corrected for shifts of the markers.

    Attributes:
        disturbance: shifts of the markers and their effect.
    """

    disturbance: Disturbance


class EdgeRefinement:
    """Refines poses over one board with one camera."""

    def __init__(self, edges: MarkerEdges, p_SQ: Array, intrinsics: Intrinsics) -> None:
        """Takes the table of edges, the markers' corners (N, 4, 3), and the camera."""
        self._edges = edges
        self._corners = p_SQ
        self._intrinsics = intrinsics
        self._modes = SheetModes(p_SQ, edges.p_SE)

    def refine(
        self,
        light: Single,
        X_SC: Array,
        markers: Indices,
        corners: Array,
    ) -> EdgeRound | None:
        """Refines a pose.

        Args:
            light: (H, W) image in linear light.
            X_SC: (4, 4) pose, accurate to about a pixel at the edges of `markers`.
            markers: indices of the detected markers in the layout.
            corners: (N, 4, 2) corners of these markers in the image [pixels].

        Returns:
            The last round; None if too few edges have the expected profile.
        """
        read = np.zeros(len(self._corners), dtype=bool)
        read[markers] = True
        found = np.flatnonzero(read[self._edges.marker])
        first, last = found[:FIRST_EDGES], found[:LAST_EDGES]
        result = self._iterate(light, X_SC, first, self._initial_spread(light, X_SC, first))
        # Pixels. A first step that moves an edge farther is repeated.
        if result and np.abs(result.fits.offset - result.residual).max() > 0.3:
            result = self._iterate(light, result.X_SC, first, result.spread)
        missed = self._missed_markers(result, read) if result else read
        # Ratio of missed to detected markers above which missed ones are added.
        if result and missed.sum() > 0.25 * read.sum():
            unread = np.flatnonzero(missed[self._edges.marker])
            which = np.concatenate([first, unread[:320]])
            result = self._iterate(light, result.X_SC, which, result.spread)
            if result is not None:
                last = self._edges_in_sight(result, found)[:LAST_EDGES]
        for _ in range(3):  # Rounds with all edges.
            result = result and self._iterate(light, result.X_SC, last, result.spread)
            # Pixels, root mean square. Smaller motions of edges end the rounds.
            if result is None or result.rms_motion < 0.05:
                break
        if result is None:
            return None
        shift = np.zeros((len(self._corners), 2))
        p_C = (self._corners[markers] - result.X_SC[:3, 3]) @ result.X_SC[:3, :3]
        shift[markers] = (corners - self._intrinsics.project(p_C)).mean(axis=1)
        # Fraction of the detected markers above which a search for misplaced markers starts.
        if self._count_misplaced_markers(result, shift) > max(2.0, 0.05 * len(markers)):
            for _ in range(2):  # Rounds of the search.
                result, shift = self._iterate_by_marker(light, result, last, shift)
        return result

    def _count_misplaced_markers(self, result: EdgeRound, shift: Array) -> int:
        """Counts markers whose corners and most edges are not where the pose puts them. Unclear
        edges alone do not count, as small or half hidden markers have them, too.
        """
        marker, n = self._edges.marker[result.views.which], len(self._corners)
        used = np.bincount(marker, weights=result.weight > 0.0, minlength=n)
        unused = used < 0.5 * np.bincount(marker, minlength=n)
        # Pixels. Half of the edges of a marker shifted so far lose their profile.
        return int((unused & (np.linalg.norm(shift, axis=1) > 1.0)).sum())

    def _iterate_by_marker(
        self,
        light: Single,
        last: EdgeRound,
        which: Indices,
        shift: Array,
        step: bool = True,
    ) -> tuple[EdgeRound, Array]:
        """Runs a round that allows a shift of each marker. Its edges are weighted by how well they
        fit each other, not the pose, which would reject misplaced pages as outliers.

        Args:
            light: (H, W) image in linear light.
            last: previous round.
            which: indices of the edges.
            shift: (M, 2) shift of each marker from its place by the pose [pixels].
            step: whether to move the pose to the best fit of all markers.

        Returns:
            The new round, or `last` if too few edges are left; and (M, 2) the shifts relative to
            the pose of that round.
        """
        max_shift = EDGE_MARGIN_PX / 2.0  # Pixels. The fit across an edge stays within the image.
        views = project_edges(self._edges, which, self._intrinsics, last.X_SC, last.spread.bloom)
        marker = self._edges.marker[views.which]
        shift = np.clip(shift, -max_shift, max_shift)
        shifted_views = replace(views, at=views.at + shift[marker])
        fits = fit_edges(light, self._edges, shifted_views, last.spread.blur)
        good = has_expected_profile(fits)
        if good.sum() < MIN_EDGES:
            return last, shift
        sd = np.sqrt(offset_variance(fits, good) + OFFSET_MODEL_SD_PX**2)
        weight = good.astype(float)
        for _ in range(WEIGHT_ROUNDS):
            information = weight / sd**2
            residual = residuals_within_markers(
                views.normal, views.print, fits.offset, information, marker
            )
            weight = _robust_weights(residual / sd, good)
        offset = fits.offset + (views.normal * shift[marker]).sum(axis=1)
        J = np.column_stack([views.motion, views.bloom])
        motion = _weighted_step(J / sd[:, None], offset / sd, weight) if step else np.zeros(7)
        middle = self._edges.p_SE[views.which].mean(axis=0)
        found = replace(
            last,
            X_SC=perturbed_pose(last.X_SC, motion[:6], middle),
            views=views,
            fits=fits,
            weight=weight,
            residual=offset - J @ motion,
            sd=sd,
        )
        return found, self._shifts_by_marker(found)

    def _shifts_by_marker(self, found: EdgeRound) -> Array:
        """(M, 2) shifts of the markers by the residuals of their edges [pixels]; 0 for markers
        without edges.
        """
        G, g = found.shift_equations(self._edges)
        G += np.eye(2) / MAX_EDGE_OFFSET_PX**2
        return np.asarray(np.linalg.solve(G, g[..., None])[..., 0])

    def with_disturbance(self, light: Single, last: EdgeRound) -> RefinedPose:
        """Corrects the pose of the last round for shifts of the markers."""
        found = self._fit_disturbance(last)
        if replace(found.shifts, size=0.0) != MarkerShifts():
            # Weights by the fit to the pose leave out the edges with the largest shifts, so that
            # shifts look smaller than they are.
            last = self._fit_shifted(light, last, found)
            found = self._fit_disturbance(last)
            good = has_expected_profile(last.fits)
            last = replace(last, weight=_robust_weights(found.residual / last.sd, good))
            found = self._fit_disturbance(last)
        covariance = found.covariance.copy()
        covariance[:3, :3] += self._blur_covariance(last)
        last = _apply_disturbance(last, found)
        covariance[3:, 3:] += found.mean_square_aspect * self._stretch_covariance(last.X_SC[:3, 3])
        return RefinedPose(**vars(replace(last, covariance=covariance)), disturbance=found)

    def _fit_shifted(self, light: Single, last: EdgeRound, found: Disturbance) -> EdgeRound:
        """Runs a round that measures the edges at their shifted markers."""
        last = _apply_disturbance(last, found)
        shift = self._shifts_by_marker(last)
        return self._iterate_by_marker(light, last, last.views.which, shift, step=False)[0]

    def _fit_disturbance(self, last: EdgeRound) -> Disturbance:
        return DisturbanceFit(
            last.views,
            last.residual,
            last.weight / last.sd**2,
            self._edges.marker[last.views.which],
            self._modes,
            self._intrinsics.height,
        ).fit(_bloom_prior(), self._intrinsics.known_to or 0.0)

    def _stretch_covariance(self, p_SC: Array) -> Array:
        """(3, 3) covariance of the camera's position per squared relative stretch of the print
        along one axis. The image does not show which axis has the right length, nor which part of
        the sheet is at S's origin.
        """
        middle = np.r_[self._modes.middle, 0.0]
        arm = p_SC - middle
        return np.asarray(0.25 * (np.outer(arm, arm) + np.diag(middle**2)))

    def _blur_covariance(self, last: EdgeRound) -> Array:
        """(3, 3) covariance of the rotation that an asymmetric blur causes."""
        sideways = last.X_SC[:3, :2] / self._intrinsics.focal  # rotation of a pixel
        # Square pixels. Lens and pixel alone cause 0.5 in a sharp image.
        excess = max(last.spread.variance - 0.5, 0.0)
        # Shift by motion or defocus, as a fraction of the blur's standard deviation.
        return np.asarray(0.04**2 * excess * sideways @ sideways.T)

    def _initial_spread(self, light: Single, X_SC: Array, which: Indices) -> LightSpread:
        """The initial blur under which the edges fit best."""
        candidates = np.tile(which[: FIRST_EDGES // len(INITIAL_BLURS)], len(INITIAL_BLURS))
        views = project_edges(self._edges, candidates, self._intrinsics, X_SC)
        if len(views.which) == 0:
            return LightSpread(INITIAL_BLURS[0])
        blurs = np.repeat(INITIAL_BLURS, len(views.which) // len(INITIAL_BLURS), axis=0)
        noise_by_blur = fit_edges(light, self._edges, views, blurs).noise.reshape(
            len(INITIAL_BLURS), -1
        )
        return LightSpread(INITIAL_BLURS[int(np.argmin(np.median(noise_by_blur, axis=1)))])

    def _missed_markers(self, result: EdgeRound, read: Booleans) -> Booleans:
        """(N,) markers in the image that were not read and that the pose predicts well enough."""
        at, variance = predict_pixels(
            self._corners, self._intrinsics, result.X_SC, result.covariance
        )
        size = [self._intrinsics.width, self._intrinsics.height]
        in_image = np.asarray(((at > 0.0) & (at < size)).all(axis=2)).any(axis=1)
        return np.asarray(~read & in_image & (variance < 0.5**2).all(axis=1))  # Pixels.

    def _edges_in_sight(self, result: EdgeRound, found: Indices) -> Indices:
        """Indices of the edges of detected and of partly visible markers."""
        marker, n = self._edges.marker[result.views.which], len(self._corners)
        good = np.bincount(marker, weights=result.weight > 0.0, minlength=n)
        read = np.unique(self._edges.marker[found])
        share = 0.2 if len(read) >= 3 else 0.5  # of a marker's edges must be good
        seen = np.asarray(good > share * np.maximum(np.bincount(marker, minlength=n), 1))
        seen[read] = True
        return np.flatnonzero(seen[self._edges.marker])

    def _iterate(
        self, light: Single, X_SC: Array, which: Indices, spread: LightSpread
    ) -> EdgeRound | None:
        max_bloom = 4.0  # Pixels; with more, no cell can be read.
        views = project_edges(self._edges, which, self._intrinsics, X_SC, spread.bloom)
        if len(views.which) < MIN_EDGES:
            return None
        fits = fit_edges(light, self._edges, views, spread.blur)
        good = has_expected_profile(fits)
        if good.sum() < MIN_EDGES:
            return None
        sd = np.sqrt(offset_variance(fits, good) + OFFSET_MODEL_SD_PX**2)
        J = np.column_stack([views.motion, views.bloom])
        step, weight = _robust_step(J, fits.offset, sd, good)
        residual = fits.offset - J @ step
        blur = _updated_blur(spread.blur, views, fits.widening, weight > 0.5)
        bloom = float(np.clip(spread.bloom + step[6], -max_bloom, max_bloom))
        spread = LightSpread(blur, bloom)
        return EdgeRound(
            perturbed_pose(X_SC, step[:6], self._edges.p_SE[views.which].mean(axis=0)),
            self._covariance(views, residual, sd, weight) * max(1.0, spread.variance),
            views,
            fits,
            weight,
            residual,
            sd,
            spread,
            float(np.sqrt(np.average((J @ step) ** 2, weights=weight))),
        )

    def _covariance(self, views: EdgeViews, residual: Array, sd: Array, weight: Array) -> Array:
        """Covariance (6, 6) of a step, scaled by the residuals.

        Model errors are correlated within a marker: they count once per marker, not per edge.
        """
        total = weight.sum()
        markers = np.count_nonzero(np.bincount(self._edges.marker[views.which[weight > 0.0]]))
        scale = (weight * (residual / sd) ** 2).sum() / max(total - 7.0, 1.0)
        # 0.006 pixels of error are common to the edges of a marker.
        shared_variance = max(total / max(markers, 1) - 1.0, 0.0) * 0.006**2
        J = np.column_stack([views.motion, views.bloom])
        J = J * np.sqrt(weight / (scale * sd**2 + shared_variance))[:, None]
        covariance: Array = np.linalg.inv(J.T @ J + _bloom_prior())[:6, :6]
        return covariance


def _apply_disturbance(last: EdgeRound, found: Disturbance) -> EdgeRound:
    """The round with its pose and residuals corrected by the disturbance's step."""
    residual = last.residual - last.views.motion @ found.step
    return replace(last, X_SC=perturbed_pose(last.X_SC, found.step), residual=residual)


def _bloom_prior() -> Array:
    """(7, 7) prior information about a step of pose (6,) and bloom."""
    prior = np.zeros((7, 7))
    prior[6, 6] = 1.0  # White may look larger on all sides, by about a pixel.
    return prior


def _updated_blur(blur: Array, views: EdgeViews, widening: Array, good: Booleans) -> Array:
    """(2, 2) blur under which the edges fit better; unchanged along axes without edges."""
    n = views.across[good]
    n = n / np.sqrt((n**2).sum(axis=1, keepdims=True))
    across, information = widening[good].T
    A = np.column_stack([n[:, 0] ** 2, 2.0 * n[:, 0] * n[:, 1], n[:, 1] ** 2])
    normal = (A * information[:, None]).T @ A
    normal += 1e-3 * max(np.trace(normal), 1e-9) * np.eye(3)
    x = np.linalg.solve(normal, A.T @ across)
    root = np.linalg.cholesky(blur)
    inverse = np.linalg.inv(root)
    relative = inverse @ np.array([[x[0], x[1]], [x[1], x[2]]]) @ inverse.T
    share, axes = np.linalg.eigh(relative)
    better = blur + root @ (axes * np.clip(share, -0.3, 0.5)) @ axes.T @ root.T
    variance, axes = np.linalg.eigh(better)
    return np.asarray((axes * np.clip(variance, 0.08, 16.0)) @ axes.T)


def _robust_step(motion: Array, offset: Array, sd: Array, good: Booleans) -> tuple[Array, Array]:
    """Robust least squares: step (7,) of pose and bloom, and weights (N,) of the edges."""
    J, e = motion / sd[:, None], offset / sd
    weight = good.astype(float)
    step = _weighted_step(J, e, weight)
    for _ in range(WEIGHT_ROUNDS):
        rest = e - J @ step
        weight = _robust_weights(rest, good)
        step = _weighted_step(J, e, weight)
    return step, weight


def _robust_weights(rest: Array, good: Booleans) -> Array:
    """(N,) Tukey's weights of residuals (N,), by the standard deviation of the good ones; 0 for the
    others.
    """
    return good * tukey_weights(rest / (TUKEY_LIMIT * robust_sd(rest[good])))


def _weighted_step(J: Array, e: Array, weight: Array) -> Array:
    weighted = J * weight[:, None]
    return np.asarray(np.linalg.solve(weighted.T @ J + _bloom_prior(), weighted.T @ e))
