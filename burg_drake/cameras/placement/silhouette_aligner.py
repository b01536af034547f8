"""Align an object with a photo by its outline, from several pixels to hundredths of one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment import (
    Alignment,
    DisplacementFit,
    fit_displacement,
    outline_sectors,
)
from burg_drake.cameras.placement.board_background import EmptyBoard
from burg_drake.cameras.placement.object_shape import TargetShape
from burg_drake.cameras.placement.photo_edges import (
    FINE_SEARCH_PX,
    PhotoEdges,
    find_far_edges,
    find_near_edges,
    sample_normal_profiles,
)
from burg_drake.cameras.placement.pinhole_view import (
    ImageContour,
    PinholeView,
    Window,
    sample_nearest,
    visible_outline,
)
from burg_drake.core import Array, srgb_to_linear

MIN_RESIDUAL_PX = 0.1
"""Smaller residuals of an outline are treated as this one, in pixels."""
MIN_OUTLINE_EDGES = 12  # Edges of an outline that an alignment needs.


class SilhouetteAligner:
    """Aligns objects with one photo.

    Args:
        view: its camera.
        image: (H, W, 3) without lens distortion, sRGB.
        picture: the board without objects.
    """

    def __init__(self, view: PinholeView, image: NDArray[np.uint8], picture: EmptyBoard) -> None:
        max_residual = 0.8  # Pixels per pixel of blur. Fits of the right object leave less.
        self.view = view
        self.convincing_rating, self.required_gain, self.clearly, self.strict = (
            3.4,
            0.15,
            0.08,
            False,
        )
        self.sees_colors, self.smear = True, picture.smear
        self.evidence = picture.evidence
        self.rough = max_residual * max(1.0, picture.blur)
        self.residual_floor = MIN_RESIDUAL_PX
        self._light = srgb_to_linear(image)
        self._balanced = self._light / picture.paper
        self._picture = picture

    def align(
        self, shape: TargetShape, q: Array, others: Array, *, far: bool = True, turn: bool = True
    ) -> Alignment | None:
        """Aligns an object.

        Args:
            shape: the object.
            q: (3,) displacement to start from.
            others: (H, W) depth of other objects, infinity where there is none.
            far: it may be many pixels off.
            turn: its angle may change.

        Returns:
            None if the photo does not determine where it is.
        """
        full_rounds = 6  # Rounds of edge measurement for an exact alignment.
        few_rounds = 3  # Rounds for a place that is only compared.
        near = self._coarse_fit(shape, q, others) if far else q
        if near is None:
            return None
        rounds = few_rounds if far or not turn else full_rounds
        return self._fine_fit(shape, near, others, turn, rounds)

    def likeness(self, shape: TargetShape, q: Array, others: Array) -> float:
        """How alike the tones of a displaced object and of its mesh are; see `appearance`."""
        return color_likeness(self.view, shape, q, others, self._balanced)

    def misfit(
        self, shape: TargetShape, q: Array, others: Array, window: Window
    ) -> tuple[float, float]:
        """What of a raster disagrees with a displaced object, but for where others are.

        Returns:
            That, and the object's silhouette [raster pixels].
        """
        at = window.pixels()
        own = np.isfinite(self.view.cast(shape, q, at))
        free = np.isinf(sample_nearest(others, at, 0.0))
        evidence = np.where(free, sample_nearest(self.evidence, at, 0.0), 0.0)
        return float(np.maximum(np.where(own, -evidence, evidence), 0.0).sum()), float(own.sum())

    def _coarse_fit(self, shape: TargetShape, q: Array, others: Array) -> Array | None:
        """The displacement to a pixel or so, from many away; None without an outline."""
        # Search distance of each round, as a fraction of the image's width.
        search_shares = (1 / 45, 1 / 45, 1 / 80, 1 / 110)
        for share in search_shares:
            contour = visible_outline(self.view, shape, q, others)
            if len(contour) < MIN_OUTLINE_EDGES:
                return None
            on = sample_normal_profiles(
                contour, self._light, self._picture, others, share * self.view.size[0]
            )
            solved = _solve_displacement(shape, contour, find_far_edges(on, self._picture))
            if solved is None:
                break
            q = q + _limit_step(solved.step)
        return q

    def _fine_fit(
        self, shape: TargetShape, q: Array, others: Array, turn: bool, rounds: int
    ) -> Alignment | None:
        """The alignment, from a displacement that is a few pixels off."""
        min_step = 0.04  # Pixels. Smaller motions of the outline end the rounds.
        max_drift = 0.03  # Metres from the start; beyond, the alignment has failed.
        start, result = q, None
        for _ in range(rounds):
            contour = visible_outline(self.view, shape, q, others)
            if len(contour) < MIN_OUTLINE_EDGES:
                return None
            edges = find_near_edges(
                sample_normal_profiles(contour, self._light, self._picture, others, FINE_SEARCH_PX),
                self._picture,
            )
            solved = _solve_displacement(shape, contour, edges, turn)
            if solved is None or np.linalg.norm(q[:2] - start[:2]) > max_drift:
                return None
            q = q + _limit_step(solved.step)
            result = _build_alignment(q, contour, edges, solved)
            if np.abs(contour.along @ solved.step).max() < min_step:
                break
        return result


def _solve_displacement(
    shape: TargetShape, contour: ImageContour, edges: PhotoEdges, turn: bool = True
) -> DisplacementFit | None:
    shading_sd = 0.15  # Relative darkening of an object at its edge, standard deviation.
    growth_sd = 0.2  # Pixels by which the outline may look larger, standard deviation.
    ground_growth_sd = 0.6  # Pixels, where the outline meets the board and its shadow.
    clear_height = 4e-3  # Metres above the board at which the shadow ends.
    used = edges.found
    if used.sum() < MIN_OUTLINE_EDGES:
        return None
    reach = float(np.linalg.norm(np.ptp(shape.p_SV[:, :2], axis=0))) / 2
    unit = np.array([1e-3, 1e-3, 1e-3 / reach])
    return fit_displacement(
        contour.along[used],
        edges.offset[used],
        edges.deviation[used],
        outline_sectors(contour)[used],
        shape.symmetric or not turn,
        unit,
        np.column_stack(
            [
                -shading_sd * edges.shading[used],
                np.full(used.sum(), growth_sd),
                ground_growth_sd * np.exp(-np.maximum(contour.p_SQ[used, 2], 0.0) / clear_height),
            ]
        ),
    )


def _limit_step(step: Array) -> Array:
    """No round moves an object farther than edges were looked for, or turns it out of sight."""
    return np.clip(step, [-0.02, -0.02, -0.3], [0.02, 0.02, 0.3])


def _build_alignment(
    q: Array, contour: ImageContour, edges: PhotoEdges, solved: DisplacementFit
) -> Alignment:
    agreement_limit = 1.5  # Pixels between an edge and the outline.
    shift_sd = 0.4  # Unexplained shift of the outline, in residuals, standard deviation.
    twist_sd = 0.35  # The same of its two ends against each other.
    squeeze_sd = 0.6  # The same of its sides against its ends.
    used: NDArray[np.bool_] = edges.found
    left = edges.offset[used] - contour.along[used] @ solved.step
    agrees = (np.abs(left) < agreement_limit) & (solved.weights > 0.0)
    residual = _weighted_rms(left[agrees], edges.deviation[used][agrees])
    normals = contour.normals[used]
    rough = max(residual, MIN_RESIDUAL_PX) if np.isfinite(residual) else agreement_limit
    shifted = shift_sd * rough * solved.sensitivity @ normals
    twisted = (
        twist_sd
        * rough
        * solved.sensitivity
        @ (normals * _end_signs(contour.pixels[used])[:, None])
    )
    squeezed = (
        squeeze_sd
        * rough
        * solved.sensitivity
        @ _side_weights(contour.pixels[used], normals)[:, None]
    )
    return Alignment(
        q,
        solved.covariance + sum(s @ s.T for s in (shifted, twisted, squeezed)),
        -solved.sensitivity @ contour.camera[used],
        float(agrees.sum() / max(edges.expected.sum(), 1)),
        float(agrees.sum() / max(len(contour), 1)),
        residual,
        int(agrees.sum()),
    )


def _end_signs(pixels: Array) -> Array:
    """(N,) 1 or -1, to which end of its longest extent each point of an outline belongs."""
    away = pixels - pixels.mean(axis=0)
    _, axes = np.linalg.eigh(away.T @ away)
    return np.where(away @ axes[:, 1] > 0.0, 1.0, -1.0)


def _side_weights(pixels: Array, normals: Array) -> Array:
    """(N,) from 1 to -1, whether each point of an outline is at its side or its end."""
    away = pixels - pixels.mean(axis=0)
    _, axes = np.linalg.eigh(away.T @ away)
    return np.asarray(2.0 * (normals @ axes[:, 0]) ** 2 - 1.0)


def _weighted_rms(left: Array, deviation: Array) -> float:
    """Root mean square, in which clear edges count more; NaN of nothing."""
    weight = deviation**-2.0
    return float(np.sqrt((weight * left**2).sum() / weight.sum())) if len(left) else float("nan")


def color_likeness(
    view: PinholeView, shape: TargetShape, q: Array, others: Array, light: NDArray[np.float32]
) -> float:
    """How alike the tones of a displaced object and of its mesh are, from 0 to 1.

    Args:
        view: the camera.
        shape: the object.
        q: (3,) its displacement.
        others: (H, W) depth of other objects.
        light: (H, W, 3) of the photo over that of paper.

    Returns:
        A mean over what is seen of it; 0.5 if its mesh has no colors, or nothing is seen.
    """
    pixel_count = 1200  # Pixels of an object that are compared, about.
    half_tone = 0.08  # Difference of chromaticity at which two colours are half alike.
    dark_light = 0.03  # Fraction of paper's light below which a tone says little.
    if shape.colors is None:
        return 0.5
    window = view.window(shape, q, 0.0)
    pitch = max(1.0, float(np.sqrt(window.width * window.height / pixel_count)))
    at = window.scaled(1.0 / pitch).pixels()
    face, depth = view.hits(shape, q, at)
    seen = np.isfinite(depth) & (depth < sample_nearest(others, at, np.inf))
    if seen.sum() < 10:
        return 0.5
    column, row = np.round(at[seen]).astype(int).T
    height, width = light.shape[:2]
    r = light[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)].astype(float)
    known = shape.colors[face[seen]]
    total, expected = r.sum(axis=1, keepdims=True), known.sum(axis=1, keepdims=True)
    off = np.linalg.norm(r / np.maximum(total, 1e-3) - known / np.maximum(expected, 1e-3), axis=1)
    weight = np.clip(np.minimum(total, expected)[:, 0] / (3 * dark_light), 0.05, 1.0)
    return float((weight / (1.0 + (off / half_tone) ** 2)).sum() / weight.sum())
