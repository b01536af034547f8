"""Aligns an object with a photo by its outline: from pixels away down to hundredths of one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.placement.alignment.aligner import Alignment, sectors
from burg_drake.cameras.placement.alignment.appearance import likeness
from burg_drake.cameras.placement.alignment.background import EmptyBoard
from burg_drake.cameras.placement.alignment.contour import ImageContour, outline
from burg_drake.cameras.placement.alignment.least_squares import DisplacementFit, fit_displacement
from burg_drake.cameras.placement.alignment.photo_edges import (
    REACH,
    PhotoEdges,
    far_edges,
    near_edges,
    normal_profiles,
)
from burg_drake.cameras.placement.alignment.pinhole import PinholeView, sample_nearest
from burg_drake.cameras.placement.alignment.shape import TargetShape
from burg_drake.cameras.placement.alignment.window import Window
from burg_drake.core import Array, photo_light

FAR = (1 / 45, 1 / 45, 1 / 80, 1 / 110)
"""How far `far_edges` looks, round by round, as a share of the image's width."""
NEAR_ROUNDS, FEW_ROUNDS = 6, 3
"""How often edges are measured anew, from where they are to a part of a pixel; and for a place that
is only compared, or aligned once more when its neighbours are."""
SETTLED = 0.04
"""Steps that move no point of the outline farther than this end the rounds [pixels]."""
AGREES = 1.5
"""An edge that is within this of the outline agrees with it [pixels]."""
LOST = 0.03
"""Farther away than this from where it began an alignment has gone astray [m]."""
FINE = 0.1
"""Residuals below this are as good as none [pixels]."""
MIN_EDGES = 12
SHADED = 0.15
"""Standard deviation of the share by which an object is darker at its very edge than beside it."""
GROWN = 0.2
"""Standard deviation of how much too large all of an outline may look: bright paper outshines dark
edges, ink spreads, the mesh is coarse [pixels]."""
GROUNDED, CLEAR_HEIGHT = 0.6, 4e-3
"""Standard deviation of how much too large an outline may look where it meets the board, as a thin
shadow hides where that is [pixels], and height above the board at which that is over [m]."""
SHIFTED, TWISTED, SQUEEZED = 0.4, 0.35, 0.6
"""Standard deviation of a shift of the whole outline that nothing explains, of one of its two ends
against each other, and of its sides against its ends, as shares of the residual, which is `FINE` at
least."""


ROUGH = 0.8
"""What the fit of the right object does not leave in a sharp photo [pixels]; in a blurred one it is
as many times as much as the blur's standard deviation has pixels."""


class SilhouetteAligner:
    """Aligns objects with one photo.

    Args:
        view: its camera.
        image: (H, W, 3) without lens distortion, sRGB.
        picture: the board without objects.
    """

    def __init__(self, view: PinholeView, image: NDArray[np.uint8], picture: EmptyBoard) -> None:
        self.view = view
        self.convincing_rating, self.required_gain, self.clearly, self.strict = (
            3.4,
            0.15,
            0.08,
            False,
        )
        self.sees_colors, self.smear = True, picture.smear
        self.evidence = picture.evidence
        self.rough = ROUGH * max(1.0, picture.blur)
        self.residual_floor = FINE
        self._light = photo_light(image)
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
        near = self._coarse_fit(shape, q, others) if far else q
        if near is None:
            return None
        rounds = FEW_ROUNDS if far or not turn else NEAR_ROUNDS
        return self._fine_fit(shape, near, others, turn, rounds)

    def likeness(self, shape: TargetShape, q: Array, others: Array) -> float:
        """How alike the tones of a displaced object and of its mesh are; see `appearance`."""
        return likeness(self.view, shape, q, others, self._balanced)

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
        for share in FAR:
            contour = outline(self.view, shape, q, others)
            if len(contour) < MIN_EDGES:
                return None
            on = normal_profiles(
                contour, self._light, self._picture, others, share * self.view.size[0]
            )
            solved = _solve(shape, contour, far_edges(on, self._picture))
            if solved is None:
                break
            q = q + _limit_step(solved.step)
        return q

    def _fine_fit(
        self, shape: TargetShape, q: Array, others: Array, turn: bool, rounds: int
    ) -> Alignment | None:
        """The alignment, from a displacement that is a few pixels off."""
        start, result = q, None
        for _ in range(rounds):
            contour = outline(self.view, shape, q, others)
            if len(contour) < MIN_EDGES:
                return None
            edges = near_edges(
                normal_profiles(contour, self._light, self._picture, others, REACH), self._picture
            )
            solved = _solve(shape, contour, edges, turn)
            if solved is None or np.linalg.norm(q[:2] - start[:2]) > LOST:
                return None
            q = q + _limit_step(solved.step)
            result = _result(q, contour, edges, solved)
            if np.abs(contour.along @ solved.step).max() < SETTLED:
                break
        return result


def _solve(
    shape: TargetShape, contour: ImageContour, edges: PhotoEdges, turn: bool = True
) -> DisplacementFit | None:
    used = edges.found
    if used.sum() < MIN_EDGES:
        return None
    reach = float(np.linalg.norm(np.ptp(shape.p_SV[:, :2], axis=0))) / 2
    unit = np.array([1e-3, 1e-3, 1e-3 / reach])
    return fit_displacement(
        contour.along[used],
        edges.offset[used],
        edges.deviation[used],
        sectors(contour)[used],
        shape.symmetric or not turn,
        unit,
        np.column_stack(
            [
                -SHADED * edges.shading[used],
                np.full(used.sum(), GROWN),
                GROUNDED * np.exp(-np.maximum(contour.p_SQ[used, 2], 0.0) / CLEAR_HEIGHT),
            ]
        ),
    )


def _limit_step(step: Array) -> Array:
    """No round moves an object farther than edges were looked for, or turns it out of sight."""
    return np.clip(step, [-0.02, -0.02, -0.3], [0.02, 0.02, 0.3])


def _result(
    q: Array, contour: ImageContour, edges: PhotoEdges, solved: DisplacementFit
) -> Alignment:
    used: NDArray[np.bool_] = edges.found
    left = edges.offset[used] - contour.along[used] @ solved.step
    agrees = (np.abs(left) < AGREES) & (solved.weights > 0.0)
    residual = _rms(left[agrees], edges.deviation[used][agrees])
    normals = contour.normals[used]
    rough = max(residual, FINE) if np.isfinite(residual) else AGREES
    shifted = SHIFTED * rough * solved.sensitivity @ normals
    twisted = (
        TWISTED * rough * solved.sensitivity @ (normals * _ends(contour.pixels[used])[:, None])
    )
    squeezed = (
        SQUEEZED * rough * solved.sensitivity @ _sides(contour.pixels[used], normals)[:, None]
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


def _ends(pixels: Array) -> Array:
    """(N,) 1 or -1, to which end of its longest extent each point of an outline belongs."""
    away = pixels - pixels.mean(axis=0)
    _, axes = np.linalg.eigh(away.T @ away)
    return np.where(away @ axes[:, 1] > 0.0, 1.0, -1.0)


def _sides(pixels: Array, normals: Array) -> Array:
    """(N,) from 1 to -1, whether each point of an outline is at its side or its end."""
    away = pixels - pixels.mean(axis=0)
    _, axes = np.linalg.eigh(away.T @ away)
    return np.asarray(2.0 * (normals @ axes[:, 0]) ** 2 - 1.0)


def _rms(left: Array, deviation: Array) -> float:
    """Root mean square, in which clear edges count more; NaN of nothing."""
    weight = deviation**-2.0
    return float(np.sqrt((weight * left**2).sum() / weight.sum())) if len(left) else float("nan")
