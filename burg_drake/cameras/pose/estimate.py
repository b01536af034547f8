"""What an image says about where the board is."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from burg_drake.core import Array


def _unknown_pose() -> Array:
    return np.full((4, 4), np.nan)


@dataclass(frozen=True, eq=False, kw_only=True)
class BoardEstimate:
    """The pose of a camera over the board, from one image.

    Attributes:
        X_SC: (4, 4) camera's optical frame in the scene frame; NaN unless `valid`.
        valid: the pose can be used.
        reason: one line that says why not, or what is doubtful; empty if all is well.
        reprojection_error: root mean square distance between where the markers' corners were seen
            and where the pose puts them [pixels].
        covariance: (6, 6) of a small rotation [rad], then translation [m], both in S, that lead
            from the true to the estimated pose: `R_SC = exp(rotation) R_true`,
            `p_SC = p_true + translation`.
        ids: markers that were used.
        corners: (N, 4, 2) where their corners were seen [pixels].
        scale: size of the printed board against the document's, where it could be measured (from
            depth, or a camera whose place is known); NaN otherwise.
    """

    X_SC: Array = field(default_factory=_unknown_pose)
    valid: bool = False
    reason: str = ""
    reprojection_error: float = float("nan")
    covariance: Array = field(default_factory=lambda: np.full((6, 6), np.nan))
    ids: tuple[int, ...] = ()
    corners: Array = field(default_factory=lambda: np.empty((0, 4, 2)))
    scale: float = float("nan")
