"""How far a calibration can be trusted: where corners were seen, and what would be better."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from burg_drake.cameras.calibration.estimation import Calibration
from burg_drake.cameras.calibration.lens_uncertainty import image_grid, uncertainty
from burg_drake.cameras.calibration.target import CharucoView

CELLS = (6, 8)
"""Rows and columns of the grid on which coverage is counted."""
FEW_VIEWS = 10
TILTED = math.radians(15.0)
"""Views that are tilted less hardly tell the focal length from the distance."""
TILTED_VIEWS = 4
LARGE_RMS = 1.0
"""Sharp images of a flat target give 0.05 to 0.3 [pixels]."""
UNCERTAIN, UNKNOWN = 0.5, 3.0
"""Uncertainty at the worst place of the image that deserves a word, and that is too much
[pixels]."""
SIDES = ("left", "right", "upper", "lower")


def coverage(views: list[CharucoView], size: tuple[int, int]) -> NDArray[np.int_]:
    """How many corners were seen in each part of the image.

    Args:
        views: of the target.
        size: width and height of the image [pixels].

    Returns:
        `CELLS` counts, rows from the top.
    """
    corners = np.concatenate([view.corners for view in views] or [np.empty((0, 2))])
    edges = [np.linspace(-0.5, n - 0.5, k + 1) for n, k in zip(size[::-1], CELLS, strict=True)]
    counts, *_ = np.histogram2d(corners[:, 1], corners[:, 0], bins=edges)
    whole: NDArray[np.int_] = counts.astype(int)
    return whole


def advice(calibration: Calibration) -> list[str]:
    """What would make a calibration better, a sentence each; empty if it is good."""
    views = [used.view for used in calibration.views]
    lines = []
    if len(views) < FEW_VIEWS:
        lines.append(f"{len(views)} views are few: take 15 to 30")
    tilted = sum(used.tilt > TILTED for used in calibration.views)
    if tilted < TILTED_VIEWS:
        lines.append(
            f"{tilted} views are tilted by more than {math.degrees(TILTED):.0f} degrees: tilt"
            " the target by 20 to 45 degrees to all sides, which separates focal length from"
            " distance"
        )
    size = (calibration.intrinsics.width, calibration.intrinsics.height)
    empty = uncovered(coverage(views, size))
    if empty:
        lines.append(
            f"no corners were seen at the {' and the '.join(empty)} of the image: bring the target"
            " there, it may reach beyond the edge; the lens is a guess there"
        )
    if calibration.rms > LARGE_RMS:
        lines.append(
            f"residuals of {calibration.rms:.2f} pixels are large: is the target flat, are its"
            " squares and markers as given, was the focus fixed?"
        )
    worst = float(uncertainty(calibration, image_grid(calibration.intrinsics)).max())
    if worst > UNCERTAIN:
        lines.append(f"the model may be off by {worst:.1f} pixels where it is known worst")
    return lines


def is_useless(calibration: Calibration) -> bool:
    """Images that this camera model is used for would be misread by pixels."""
    worst = float(uncertainty(calibration, image_grid(calibration.intrinsics)).max())
    return not worst <= UNKNOWN or calibration.rms > UNKNOWN


def uncovered(counts: NDArray[np.int_]) -> list[str]:
    """Which edges of the image show no corners along half of their length or more."""
    sides = (counts[:, 0], counts[:, -1], counts[0], counts[-1])
    return [
        f"{name} edge"
        for name, cells in zip(SIDES, sides, strict=True)
        if (cells == 0).mean() >= 0.5
    ]
