"""Coarse pose of a camera over a board from the corners of the detected markers."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from burg_drake.cameras.intrinsics import Intrinsics
from burg_drake.cameras.pose.edge_measurement import cross_product, project_with_derivatives
from burg_drake.cameras.pose.marker_detection import side_lengths
from burg_drake.core import Array, Booleans, inverse

CORNER_TOLERANCE = 3.0, 0.1
"""Largest offset of a corner from its place: pixels, or fraction of a marker's side if larger."""


@dataclass(frozen=True, eq=False)
class CoarsePose:
    """Poses from the markers' corners.

    Attributes:
        X_SC: up to two poses (4, 4) above the sheet, the better one first.
        inliers: (N,) True for markers in their places on the board.
        marker_scale: size of the markers relative to their distances; 1 as in the document.
    """

    X_SC: list[Array]
    inliers: Booleans
    marker_scale: float


def estimate_coarse_pose(p_SQ: Array, corners: Array, intrinsics: Intrinsics) -> CoarsePose:
    """Estimates the pose from corners.

    Args:
        p_SQ: (N, 4, 3) corners on the board [m].
        corners: (N, 4, 2) corners in the image [pixels].
        intrinsics: of the camera.
    """
    straight = intrinsics.undistort(corners)
    inliers = np.ones(len(p_SQ), dtype=bool)
    poses, errors = _planar_poses(p_SQ, straight, intrinsics.K)
    misplaced = max(
        CORNER_TOLERANCE[0], CORNER_TOLERANCE[1] * float(np.median(side_lengths(corners)))
    )
    if len(p_SQ) > 1 and (not errors or errors[0] > 0.5 * misplaced):
        inliers = consistent_markers(p_SQ, straight, misplaced)
        if inliers.any():
            poses, errors = _planar_poses(p_SQ[inliers], straight[inliers], intrinsics.K)
    # The second pose is kept up to this reprojection error [pixels].
    rivals = [X for X, e in zip(poses, errors, strict=True) if e <= 3.0 * errors[0] + 0.5]
    marker_scale = 1.0
    if not rivals or 2 * inliers.sum() < len(p_SQ):
        marker_scale = _marker_scale_by_centers(p_SQ, straight)
    elif inliers.sum() > 3:
        marker_scale = _marker_scale(p_SQ[inliers], straight[inliers], intrinsics, rivals[0])
    return CoarsePose(rivals, inliers, marker_scale)


def _planar_poses(p_SQ: Array, straight: Array, K: Array) -> tuple[list[Array], list[float]]:
    """Poses (4, 4) and their root mean square errors [pixels], the best first."""

    p, q = p_SQ.reshape(-1, 3), np.ascontiguousarray(straight.reshape(-1, 2))
    _, rotations, translations, errors = cv2.solvePnPGeneric(p, q, K, None, flags=cv2.SOLVEPNP_IPPE)
    found: list[tuple[float, Array]] = []
    for rotation, translation, rough in zip(rotations, translations, errors.ravel(), strict=True):
        if found and rough > 10.0 * found[0][0] + 5.0:
            continue  # too bad to become the better pose by refinement
        rotation, translation = cv2.solvePnPRefineLM(p, q, K, None, rotation, translation)
        X_CS = np.eye(4)
        X_CS[:3, :3], X_CS[:3, 3] = cv2.Rodrigues(rotation)[0], translation.ravel()
        p_C = p @ X_CS[:3, :3].T + X_CS[:3, 3]
        ahead, above = (p_C[:, 2] > 0.0).all(), inverse(X_CS)[2, 3] > 0.0
        if ahead and above:
            seen = p_C[:, :2] / p_C[:, 2:] @ K[:2, :2].T + K[:2, 2]
            error = float(np.sqrt(((seen - q) ** 2).sum(axis=1).mean()))
            found.append((error, inverse(X_CS)))
    found.sort(key=lambda one: one[0])
    # Poses with smaller differences are the same.
    if len(found) == 2 and np.allclose(found[0][1], found[1][1], atol=1e-3):
        found.pop()
    return [X for _, X in found], [error for error, _ in found]


def consistent_markers(p_SQ: Array, straight: Array, misplaced: float) -> Booleans:
    """Finds markers whose corners fit a homography, by RANSAC, within a distance [pixels]."""

    cv2.setRNGSeed(0)
    _, fits = cv2.findHomography(
        p_SQ[..., :2].reshape(-1, 2), straight.reshape(-1, 2), cv2.RANSAC, misplaced
    )
    if fits is None:
        return np.zeros(len(p_SQ), dtype=bool)
    return np.asarray(fits.reshape(-1, 4).all(axis=1))


def _marker_scale_by_centers(p_SQ: Array, straight: Array) -> float:
    """Size of the markers relative to their distances, by a homography of their centres; 1 if none
    fits.
    """

    if len(p_SQ) <= 4:
        return 1.0
    centers = p_SQ.mean(axis=1)[:, :2]
    H, _ = cv2.findHomography(straight.mean(axis=1), centers)
    if H is None:
        return 1.0
    on_board = cv2.perspectiveTransform(straight.reshape(-1, 1, 2), H).reshape(-1, 4, 2)
    sides, side = side_lengths(on_board), float(side_lengths(p_SQ).mean())
    distance = np.linalg.norm(on_board.mean(axis=1) - centers, axis=1)
    return float(np.median(sides)) / side if distance.max() < 0.1 * side else 1.0


def _marker_scale(p_SQ: Array, straight: Array, intrinsics: Intrinsics, X_SC: Array) -> float:
    """Size of the markers relative to their distances, fitted together with small changes of the
    pose.
    """
    pinhole = replace(intrinsics, model="perspective", distortion=())
    q_S = p_SQ.reshape(-1, 3) - X_SC[:3, 3]
    at, by_C = project_with_derivatives(pinhole, q_S @ X_SC[:3, :3])
    by_S = by_C @ X_SC[:3, :3].T
    outward = (p_SQ - p_SQ.mean(axis=1, keepdims=True)).reshape(-1, 3)
    grow = np.einsum("nij,nj->ni", by_S, outward)[..., None]
    J = np.concatenate([cross_product(by_S, q_S[:, None]), -by_S, grow], axis=2).reshape(-1, 7)
    x = np.linalg.lstsq(J, (straight.reshape(-1, 2) - at).ravel(), rcond=None)[0]
    return 1.0 + float(x[6])
