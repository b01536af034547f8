"""A camera and poses to begin a fit with, from nothing but the corners."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from burg_drake.cameras.calibration.target import CharucoTarget, CharucoView
from burg_drake.cameras.optics import Intrinsics, LensModel
from burg_drake.core import Array

FOCAL_LENGTHS = np.geomspace(0.25, 3.0, 11)
"""That are tried, as shares of the image's diagonal: fields of view from 19 to 127 degrees of a
perspective lens, to 230 of a fisheye. The fit goes on from the nearest."""


def first_guess(
    views: Sequence[CharucoView], target: CharucoTarget, model: LensModel
) -> tuple[Intrinsics, Array]:
    """A camera without coefficients, and (V, 4, 4) the target in its frame, of the focal length
    that explains the median view best."""
    width, height = views[0].size
    found = []
    for share in FOCAL_LENGTHS:
        focal = float(share * np.hypot(width, height))
        camera = Intrinsics(
            width=width,
            height=height,
            focal=(focal, focal),
            center=(0.5 * (width - 1), 0.5 * (height - 1)),
            model=model,
            distortion=(0.0,) * 4,
        )
        posed = [_pose(view, target, camera) for view in views]
        found.append(
            (np.median([error for error, _ in posed]), camera, np.array([X for _, X in posed]))
        )
    _, camera, X_CT = min(found, key=lambda one: one[0])
    return camera, X_CT


def _pose(view: CharucoView, target: CharucoTarget, camera: Intrinsics) -> tuple[float, Array]:
    """Mean distance of a view's corners from where its best pose puts them [pixels], and (4, 4)."""
    p_TQ = target.p_TQ[view.ids]
    straight = np.ascontiguousarray((camera.undistort(view.corners) - camera.center) / camera.focal)
    _, rotations, translations, _ = cv2.solvePnPGeneric(
        p_TQ, straight, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    best = (np.inf, _facing(p_TQ, straight))
    for rotation, translation in zip(rotations, translations, strict=True):
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = cv2.Rodrigues(rotation)[0], np.ravel(translation)
        p_CQ = p_TQ @ X[:3, :3].T + X[:3, 3]
        if not (p_CQ[:, 2] > 0.0).all():
            continue
        off = camera.project(p_CQ) - view.corners
        error = float(np.linalg.norm(off, axis=1).mean())
        if error < best[0]:
            best = error, X
    return best


def _facing(p_TQ: Array, straight: Array) -> Array:
    """(4, 4) the target upright before the camera, as large as it is seen: for views that no pose
    explains, which turn out not to fit to the others."""
    size = float(np.std(p_TQ[:, :2]) / max(float(np.std(straight)), 1e-9))
    X = np.eye(4)
    X[:3, 3] = size * np.r_[straight.mean(axis=0), 1.0] - p_TQ.mean(axis=0)
    return X
