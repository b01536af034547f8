"""Align an object with a photo by its outline, from several pixels to hundredths of one."""

from __future__ import annotations

import numpy as np

from burg_drake.cameras.placement.alignment import (
    Alignment,
    DisplacementFit,
    fit_displacement,
    limit_step,
    outline_sectors,
    step_units,
)
from burg_drake.cameras.placement.board_background import EmptyBoard
from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.photo_edges import (
    FINE_SEARCH_PX,
    NormalProfiles,
    PhotoEdges,
    find_far_edges,
    find_near_edges,
    sample_normal_profiles,
)
from burg_drake.cameras.placement.pinhole_view import (
    ImageContour,
    ImageWindow,
    PinholeView,
    sample_nearest,
    visible_outline,
)
from burg_drake.core import Array, Booleans, Bytes, srgb_to_linear

MIN_RESIDUAL_PX = 0.1
"""Smaller residuals of an outline are treated as this one, in pixels."""
MIN_OUTLINE_EDGES = 12  # Edges of an outline that an alignment needs.


class SilhouetteAligner:
    """Aligns objects with one photo.

    Args:
        view: camera of the photo.
        image: (H, W, 3) photo without lens distortion, sRGB.
        background: prediction of the empty board.
    """

    def __init__(self, view: PinholeView, image: Bytes, background: EmptyBoard) -> None:
        self.view = view
        self.convincing_rating, self.required_gain = 3.4, 0.15
        self.min_rating_margin, self.checks_depth = 0.08, False
        self.sees_colors, self.smear = True, background.smear
        self.evidence = background.evidence
        # Pixels per pixel of blur. Fits of the right object leave less.
        self.max_residual = 0.8 * max(1.0, background.blur)
        self.residual_floor = MIN_RESIDUAL_PX
        self._light = srgb_to_linear(image)
        self._relative_light = self._light / background.paper
        self._background = background

    def align(
        self, shape: TargetShape, q: Array, others: Array, *, far: bool = True, turn: bool = True
    ) -> Alignment | None:
        """Aligns an object.

        Args:
            shape: the object.
            q: (3,) initial displacement.
            others: (H, W) depth of other objects, infinity where there is none.
            far: whether the initial displacement may be many pixels off.
            turn: whether the angle is fitted, too.

        Returns:
            The alignment; None if the photo does not determine the object's place.
        """
        near = self._coarse_fit(shape, q, others) if far else q
        if near is None:
            return None
        rounds = 3 if far or not turn else 6  # Fewer suffice for a place that is only compared.
        return self._fine_fit(shape, near, others, turn, rounds)

    def color_similarity(self, shape: TargetShape, q: Array, others: Array) -> float:
        """Similarity of the photo's tones to those of a displaced object's mesh, from 0 to 1.

        Args:
            shape: the object.
            q: (3,) displacement of the object.
            others: (H, W) depth of other objects.

        Returns:
            Mean over the object's visible surface; 0.5 if its mesh has no colours, or nothing is
            visible.
        """
        if shape.colors is None:
            return 0.5
        at = self.view.window(shape, q, 0.0).with_raster(1200).pixels()
        face, depth = self.view.hits(shape, q, at)
        seen = np.isfinite(depth) & (depth < sample_nearest(others, at, np.inf))
        if seen.sum() < 10:
            return 0.5
        column, row = np.round(at[seen]).astype(int).T
        height, width = self._relative_light.shape[:2]
        row, column = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
        light = self._relative_light[row, column].astype(float)
        reflectance = shape.colors[face[seen]]
        total, expected = light.sum(axis=1, keepdims=True), reflectance.sum(axis=1, keepdims=True)
        difference = np.linalg.norm(
            light / np.maximum(total, 1e-3) - reflectance / np.maximum(expected, 1e-3), axis=1
        )
        # Fraction of paper's light below which a tone is unreliable.
        weight = np.clip(np.minimum(total, expected)[:, 0] / (3 * 0.03), 0.05, 1.0)
        # Difference of chromaticity at which the similarity is one half.
        return float((weight / (1.0 + (difference / 0.08) ** 2)).sum() / weight.sum())

    def mismatch(
        self, shape: TargetShape, q: Array, others: Array, window: ImageWindow
    ) -> tuple[float, float]:
        """Area of a window that disagrees with a displaced object, without the area of other
        objects; and area of the object's silhouette [raster pixels].
        """
        at = window.pixels()
        own = np.isfinite(self.view.hits(shape, q, at)[1])
        free = np.isinf(sample_nearest(others, at, 0.0))
        evidence = np.where(free, sample_nearest(self.evidence, at, 0.0), 0.0)
        return float(np.maximum(np.where(own, -evidence, evidence), 0.0).sum()), float(own.sum())

    def _coarse_fit(self, shape: TargetShape, q: Array, others: Array) -> Array | None:
        """The displacement to about a pixel, from a start that may be many pixels off; None
        without an outline.
        """
        # Search distance of each round, as a fraction of the image's width.
        for share in (1 / 45, 1 / 45, 1 / 80, 1 / 110):
            contour = visible_outline(self.view, shape, q, others)
            if len(contour) < MIN_OUTLINE_EDGES:
                return None
            profiles = self._sample_normals(contour, others, share * self.view.size[0])
            solved = _solve_displacement(shape, contour, find_far_edges(profiles, self._background))
            if solved is None:
                break
            q = q + limit_step(solved.step)
        return q

    def _sample_normals(self, contour: ImageContour, others: Array, reach: float) -> NormalProfiles:
        return sample_normal_profiles(contour, self._light, self._background, others, reach)

    def _fine_fit(
        self, shape: TargetShape, q: Array, others: Array, turn: bool, rounds: int
    ) -> Alignment | None:
        """The alignment, from an initial displacement that is a few pixels off."""
        start, result = q, None
        for _ in range(rounds):
            contour = visible_outline(self.view, shape, q, others)
            if len(contour) < MIN_OUTLINE_EDGES:
                return None
            profiles = self._sample_normals(contour, others, FINE_SEARCH_PX)
            edges = find_near_edges(profiles, self._background)
            solved = _solve_displacement(shape, contour, edges, turn)
            # Metres from the start; beyond, the alignment has failed.
            if solved is None or np.linalg.norm(q[:2] - start[:2]) > 0.03:
                return None
            q = q + limit_step(solved.step)
            result = _build_alignment(q, contour, edges, solved)
            # Pixels. Smaller motions of the outline end the rounds.
            if np.abs(contour.displacement_jacobian @ solved.step).max() < 0.04:
                break
        return result


def _solve_displacement(
    shape: TargetShape, contour: ImageContour, edges: PhotoEdges, turn: bool = True
) -> DisplacementFit | None:
    used = edges.found
    if used.sum() < MIN_OUTLINE_EDGES:
        return None
    # Standard deviations of nuisances that move edges: objects are darker at their edges by 15 %,
    # outlines look larger by 0.2 pixels, and by 0.6 where they meet the board and the object's
    # shadow, which ends 4 mm above the board.
    height = np.maximum(contour.p_SQ[used, 2], 0.0)
    growth = np.full(used.sum(), 0.2)
    nuisance = np.column_stack([-0.15 * edges.shading[used], growth, 0.6 * np.exp(-height / 4e-3)])
    return fit_displacement(
        contour.displacement_jacobian[used],
        edges.offset[used],
        edges.deviation[used],
        outline_sectors(contour)[used],
        shape.symmetric or not turn,
        step_units(shape),
        nuisance,
    )


def _build_alignment(
    q: Array, contour: ImageContour, edges: PhotoEdges, solved: DisplacementFit
) -> Alignment:
    agreement_limit = 1.5  # Pixels between an edge and the outline.
    used: Booleans = edges.found
    residuals = edges.offset[used] - contour.displacement_jacobian[used] @ solved.step
    agrees = (np.abs(residuals) < agreement_limit) & (solved.weights > 0.0)
    residual = _weighted_rms(residuals[agrees], edges.deviation[used][agrees])
    normals = contour.normals[used]
    typical_residual = max(residual, MIN_RESIDUAL_PX) if np.isfinite(residual) else agreement_limit
    ends, sides = _ends_and_sides(contour.pixels[used], normals)
    # Standard deviation of an unexplained shift of the outline, in residuals.
    shifted = 0.4 * typical_residual * solved.sensitivity @ normals
    # The same for a shift of the outline's two ends against each other.
    twisted = 0.35 * typical_residual * solved.sensitivity @ (normals * ends[:, None])
    # The same for a shift of the outline's sides against its ends.
    squeezed = 0.6 * typical_residual * solved.sensitivity @ sides[:, None]
    return Alignment(
        q,
        solved.covariance + sum(s @ s.T for s in (shifted, twisted, squeezed)),
        -solved.sensitivity @ contour.camera_jacobian[used],
        float(agrees.sum() / max(edges.expected.sum(), 1)),
        float(agrees.sum() / max(len(contour), 1)),
        residual,
    )


def _ends_and_sides(pixels: Array, normals: Array) -> tuple[Array, Array]:
    """(N,) 1 or -1, the end of the outline's long axis that each point belongs to; and (N,) from 1
    at a side of the outline to -1 at an end.
    """
    away = pixels - pixels.mean(axis=0)
    _, axes = np.linalg.eigh(away.T @ away)
    ends = np.where(away @ axes[:, 1] > 0.0, 1.0, -1.0)
    return ends, np.asarray(2.0 * (normals @ axes[:, 0]) ** 2 - 1.0)


def _weighted_rms(residuals: Array, deviation: Array) -> float:
    """Root mean square, weighted by inverse variance; NaN without values."""
    weight = deviation**-2.0
    return (
        float(np.sqrt((weight * residuals**2).sum() / weight.sum()))
        if len(residuals)
        else float("nan")
    )
