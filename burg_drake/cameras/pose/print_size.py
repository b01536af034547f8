"""Whether a board was printed at the size that its document says.

One image shows if a sheet is longer along one axis than it should be. That all of it is larger or
smaller looks like another distance; a depth image, or a camera whose place is known, tells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.optics import Intrinsics
from burg_drake.cameras.pose.edge_projection import NEAREST
from burg_drake.cameras.pose.refinement import RefinedPose, variance_factor_of_blur
from burg_drake.core import Array

SIGNIFICANT = 6.0
"""Standard deviations from which on a deviation is told."""
LEAST_ASPECT_ERROR = 0.003
"""Unequal scale that is not worth telling; printers feed paper within about that [-]."""
LEAST_MARKER_SCALE_ERROR = 0.01
"""Size of markers against their distances that is not worth telling: ink spreads, and in blurred
images, for which it rises with the blur's width, light does [-]."""
LEAST_DEVIATION = 0.01
"""Uniform scale that is not worth telling; depth cameras err by as much [-]."""
FEWEST_DEPTHS = 12
"""Corners with depth that a scale is measured by, at least."""


@dataclass(frozen=True)
class Deformation:
    """How a print differs from its document in ways that one image shows; 0 where that is not
    significant.

    Attributes:
        aspect_error: how much longer it is along y than along x, as a share.
        marker_scale_error: how much larger its markers are for their distances, as a share.
    """

    aspect_error: float = 0.0
    marker_scale_error: float = 0.0


def deformation(refined: RefinedPose) -> Deformation:
    """Fits a deformation together with the pose, to the edges of the last round."""
    views = refined.views
    weight = np.sqrt(refined.weight) / refined.sd
    J = np.column_stack([views.motion, views.print, views.bloom]) * weight[:, None]
    e = refined.fits.offset * weight
    try:
        inverse = np.linalg.inv(J.T @ J)
    except np.linalg.LinAlgError:
        return Deformation()
    x = inverse @ (J.T @ e)
    variance = ((e - J @ x) ** 2).sum() / max(refined.weight.sum() - 9.0, 1.0)
    variance *= variance_factor_of_blur(refined.spread.blur)
    value = x[6:8] * [2.0, 1.0]  # a stretch makes y longer and x shorter by the same share
    spread = np.diag(inverse)[6:8] * variance
    if not (spread > 0.0).all():  # singular but for rounding
        return Deformation()
    sd = np.sqrt(spread) * [2.0, 1.0]
    least = [
        LEAST_ASPECT_ERROR,
        LEAST_MARKER_SCALE_ERROR * np.sqrt(variance_factor_of_blur(refined.spread.blur)),
    ]
    significant = np.abs(value) > np.maximum(SIGNIFICANT * sd, least)
    return Deformation(*(float(v) for v in np.where(significant, value, 0.0)))


def scale_by_depth(
    p_SQ: Array, intrinsics: Intrinsics, X_SC: Array, depth: NDArray[np.floating[Any]]
) -> float:
    """Size of the printed board against the document, by a depth image; NaN if it shows too little.

    Args:
        p_SQ: (..., 3) points of the board that are in sight [m].
        intrinsics: of the depth image too.
        X_SC: (4, 4) pose that the image gives with the document's size.
        depth: (H, W) distance along the optical axis [m]; 0, NaN or infinite where unknown.
    """
    p_C = (p_SQ.reshape(-1, 3) - X_SC[:3, 3]) @ X_SC[:3, :3]
    p_C = p_C[p_C[:, 2] > NEAREST]
    columns, rows = np.rint(intrinsics.project(p_C)).astype(np.intp).reshape(-1, 2).T
    inside = (columns >= 0) & (columns < depth.shape[1]) & (rows >= 0) & (rows < depth.shape[0])
    measured = np.asarray(depth, dtype=float)[rows[inside], columns[inside]]
    ratio = measured / p_C[inside, 2]
    ratio = ratio[np.isfinite(ratio) & (measured > 0.0)]
    return float(np.median(ratio)) if len(ratio) >= FEWEST_DEPTHS else float("nan")


def scale_by_height(X_SC: Array, X_SC_known: Array) -> float:
    """Size of the printed board against the document, by the known height of the camera over it."""
    return float(X_SC_known[2, 3] / X_SC[2, 3])
