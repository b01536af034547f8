"""How far a fitted camera model may be off, over the image."""

from __future__ import annotations

from typing import Protocol

import cv2
import numpy as np

from burg_drake.cameras.optics import Intrinsics
from burg_drake.core import Array


class FittedCamera(Protocol):
    """A camera model with the covariance of its parameters."""

    @property
    def intrinsics(self) -> Intrinsics:
        """The camera."""

    @property
    def covariance(self) -> Array:
        """(P, P) of fx, fy, cx, cy and the coefficients."""


def image_grid(intrinsics: Intrinsics, columns: int = 13, rows: int = 9) -> Array:
    """(rows * columns, 2) places spread over the image from edge to edge [pixels]."""
    u = np.linspace(0.0, intrinsics.width - 1.0, columns)
    v = np.linspace(0.0, intrinsics.height - 1.0, rows)
    return np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)


def uncertainty(fitted: FittedCamera, pixels: Array) -> Array:
    """How far the camera model may be off at places of the image.

    From the covariance of the parameters, as the residuals tell it. What a turn of the camera would
    explain over the whole image does not count: the camera's pose takes it up.

    Args:
        fitted: a `LensFit` or `Calibration`.
        pixels: (N, 2) places [pixels].

    Returns:
        (N,) root mean square distance [pixels].
    """
    intrinsics, covariance = fitted.intrinsics, fitted.covariance
    over_image = _derivatives(intrinsics, image_grid(intrinsics), len(covariance))
    here = _derivatives(intrinsics, pixels, len(covariance))
    flat = [J.reshape(-1, J.shape[-1]) for J in over_image]
    turn = np.linalg.lstsq(flat[0], flat[1], rcond=None)[0]
    J = here[1] - here[0] @ turn
    return np.asarray(np.sqrt(np.einsum("nip,pq,niq->n", J, covariance, J)))


def _derivatives(intrinsics: Intrinsics, pixels: Array, count: int) -> tuple[Array, Array]:
    """(N, 2, 3) and (N, 2, count): of pixels by a turn of the camera, and by its parameters."""
    straight = (intrinsics.undistort(pixels) - intrinsics.center) / intrinsics.focal
    rays = np.column_stack([straight, np.ones(len(straight))])
    k = np.zeros(max(len(intrinsics.distortion), 5))
    k[: len(intrinsics.distortion)] = intrinsics.distortion
    _, J = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), intrinsics.K, k)
    J = np.asarray(J).reshape(len(rays), 2, -1)
    return J[..., :3], J[..., 6 : 6 + count]
