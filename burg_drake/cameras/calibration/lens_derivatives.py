"""How image points move with a camera's pose and with the parameters of its lens."""

from __future__ import annotations

import cv2
import numpy as np

from burg_drake.cameras.optics import Intrinsics, fisheye_lens
from burg_drake.core import Array


def lens_derivatives(intrinsics: Intrinsics, p_CQ: Array) -> tuple[Array, Array, Array]:
    """Image points and their derivatives.

    Args:
        intrinsics: of the camera.
        p_CQ: (N, 3) points in its frame [m].

    Returns:
        `(pixels, by_pose, by_camera)`: (N, 2); (N, 2, 6) by a small rotation [rad] of the points
        about the camera's axes and a translation [m]; (N, 2, P) by fx, fy, cx, cy and the
        coefficients, of which a perspective model has 5 at least.
    """
    if intrinsics.is_fisheye:
        return _of_fisheye(intrinsics, p_CQ)
    k = np.zeros(max(len(intrinsics.distortion), 5))
    k[: len(intrinsics.distortion)] = intrinsics.distortion
    flat = np.ascontiguousarray(p_CQ, dtype=float)
    pixels, J = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), intrinsics.K, k)
    J = np.asarray(J).reshape(len(flat), 2, -1)
    return np.asarray(pixels).reshape(-1, 2), J[..., :6], J[..., 6:]


def _of_fisheye(intrinsics: Intrinsics, p_CQ: Array) -> tuple[Array, Array, Array]:
    lens, focal = fisheye_lens(intrinsics.distortion), np.array(intrinsics.focal)
    aside = np.maximum(np.linalg.norm(p_CQ[:, :2], axis=1), 1e-12)
    angle = np.arctan2(aside, p_CQ[:, 2])
    toward = p_CQ[:, :2] / aside[:, None]
    square = aside**2 + p_CQ[:, 2] ** 2
    radius, slope = lens.radius(angle), lens.slope(angle)
    by_angle = np.column_stack([toward * (p_CQ[:, 2] / square)[:, None], -aside / square])
    across = np.eye(2) - toward[:, :, None] * toward[:, None]
    by_point = toward[:, :, None] * (slope[:, None] * by_angle)[:, None]
    by_point[:, :, :2] += across * (radius / aside)[:, None, None]
    by_point *= focal[:, None]
    bent = toward * radius[:, None]
    by_camera = np.zeros((len(p_CQ), 2, 8))
    by_camera[:, [0, 1], [0, 1]] = bent
    by_camera[:, [0, 1], [2, 3]] = 1.0
    within = np.minimum(angle, lens.turn)
    powers = within[:, None] ** (3 + 2 * np.arange(4))
    by_camera[:, :, 4:] = focal[:, None] * toward[:, :, None] * powers[:, None]
    # A rotation w moves a point p by w x p.
    by_turn = np.cross(p_CQ[:, None], by_point)
    return (
        bent * focal + intrinsics.center,
        np.concatenate([by_turn, by_point], axis=2),
        by_camera,
    )
