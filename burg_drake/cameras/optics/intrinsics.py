"""A camera's intrinsics, as OpenCV has them: pixel centres at integers.

Drake's `CameraInfo` puts pixel edges at integers, so that its principal point is half a pixel
further; `of_camera_info` and `camera_info` convert. `intrinsics_file` reads files of others.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, get_args

import numpy as np

from burg_drake.cameras.optics.fisheye import COEFFICIENTS, fisheye_lens
from burg_drake.cameras.optics.known_parts import PARTS
from burg_drake.core import Array, FieldError, InvalidInputError, nearest
from burg_drake.core.documents import Ranges, require_ranges
from burg_drake.station.document import (
    FOCAL_RANGE,
    HALF_PIXEL as HALF_PIXEL,
    Camera,
    require_image_size,
)

DISTORTION_SIZES = (0, 4, 5, 8, 12, 14)
"""Numbers of coefficients that OpenCV's model of a lens may have."""
LensModel = Literal["perspective", "fisheye"]


@dataclass(frozen=True, kw_only=True)
class Intrinsics:
    """Intrinsics of a camera, as in OpenCV (pixel centres at integers).

    Attributes:
        camera: name of the camera, for people.
        width: width of the image [pixels].
        height: height of the image [pixels].
        focal: focal lengths fx and fy [pixels].
        center: principal point cx and cy [pixels].
        model: model of the lens. `perspective`: a pinhole with distortion, for angles of view of up
            to about 120 degrees. `fisheye`: for up to about 170 degrees.
        distortion: distortion coefficients in OpenCV's order: k1, k2, p1, p2[, k3[, k4, k5, k6[,
            s1, s2, s3, s4[, tx, ty]]]] of a perspective lens, k1, k2, k3, k4 of a fisheye; none for
            a pinhole.
        residual: root mean square reprojection error of the calibration [pixels].
        known_to: largest error of these intrinsics anywhere in the image, in 19 of 20 cases
            [pixels].
        except_at: parts of the image where the error may be larger than `known_to`: `upper left
            corner`, `upper edge`, `upper right corner`, `left edge`, `middle`, `right edge`, `lower
            left corner`, `lower edge` or `lower right corner`.
    """

    RANGES: ClassVar[Ranges] = {
        "focal": FOCAL_RANGE,
        "center": (-1e6, 1e6),
        "distortion": (-1e12, 1e12),
    }
    """Far beyond any camera; projections overflow with larger values."""

    version: int = 1
    camera: str = ""
    width: int
    height: int
    focal: tuple[float, float]
    center: tuple[float, float]
    model: LensModel = "perspective"
    distortion: tuple[float, ...] = ()
    residual: float | None = None
    known_to: float | None = None
    except_at: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        numbers = [self.width, self.height, *self.focal, *self.center, *self.distortion]
        if not np.isfinite(numbers).all():
            raise InvalidInputError(
                "width, height, focal, center and distortion of a camera must be finite"
            )
        if not float(self.width).is_integer() or not float(self.height).is_integer():
            raise InvalidInputError(
                f"width {self.width} and height {self.height} of a camera must be whole pixels"
            )
        if min(self.width, self.height, *self.focal) <= 0:
            raise InvalidInputError("width, height and focal of a camera must be positive")
        require_image_size(self.width, self.height)
        require_ranges(self)
        if self.model not in get_args(LensModel):
            known = nearest(str(self.model), get_args(LensModel))
            raise FieldError(f"model {self.model!r} does not exist; {known}", "model")
        self._check_promise()
        if self.is_fisheye and len(self.distortion) != COEFFICIENTS:
            raise FieldError(
                f"distortion has {len(self.distortion)} coefficients; a fisheye model has"
                f" {COEFFICIENTS}: k1, k2, k3, k4",
                "distortion",
            )
        if len(self.distortion) not in DISTORTION_SIZES:
            raise FieldError(
                f"distortion has {len(self.distortion)} coefficients; OpenCV's model has"
                f" {', '.join(map(str, DISTORTION_SIZES))}",
                "distortion",
            )

    def _check_promise(self) -> None:
        if self.known_to is not None and not 0.0 < self.known_to < np.inf:
            raise FieldError(
                f"known_to is {self.known_to:g} pixels; it must be above 0", "known_to"
            )
        for k, name in enumerate(self.except_at):
            if name not in PARTS:
                raise FieldError(
                    f"except_at has {name!r}, which is not a part of the image;"
                    f" {nearest(name, PARTS, ordered=True)}",
                    *("except_at", k),
                )

    @cached_property
    def K(self) -> Array:
        """(3, 3) camera matrix."""
        (fx, fy), (cx, cy) = self.focal, self.center
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @cached_property
    def coefficients(self) -> Array:
        """Distortion as OpenCV's functions take it; zeros for a pinhole camera."""
        return np.array(self.distortion or (0.0, 0.0, 0.0, 0.0), dtype=float)

    @property
    def is_pinhole(self) -> bool:
        """Straight lines are straight in the image."""
        return not self.is_fisheye and not any(self.distortion)

    @property
    def is_fisheye(self) -> bool:
        """The lens is of the fisheye model, whose rays may come from beside the camera."""
        return self.model == "fisheye"

    def require_size(self, width: int, height: int, source: str) -> None:
        """Refuses images of another size than the one that was calibrated.

        Args:
            width, height: of the image [pixels].
            source: what the message calls it, such as `photo.png` or `camera 0`.

        Raises:
            InvalidInputError: the sizes differ.
        """
        if (width, height) != (self.width, self.height):
            raise InvalidInputError(
                f"{source} has {width} x {height} pixels, but the intrinsics are for {self.width}"
                f" x {self.height}; calibrate at the resolution of the images, because cameras"
                " scale, bin or crop to get another one"
            )

    def project(self, p_CQ: Array) -> Array:
        """Image points of points in the camera's frame, lens distortion included.

        Args:
            p_CQ: (..., 3) points before the camera (z > 0) [m]; of a fisheye anywhere, as it puts
                those outside of the image that it does not see.

        Returns:
            (..., 2) pixels.
        """
        import cv2

        p = np.asarray(p_CQ, dtype=float)
        if self.is_fisheye:
            bent: Array = fisheye_lens(self.distortion).bent(p) * self.focal + self.center
            return bent
        if self.is_pinhole or not p.size:
            straight: Array = p[..., :2] / p[..., 2:] * self.focal + self.center
            return straight
        flat = np.ascontiguousarray(p.reshape(-1, 1, 3))
        pixels, _ = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), self.K, self.coefficients)
        return np.asarray(pixels).reshape(*p.shape[:-1], 2)

    def undistort(self, pixels: Array) -> Array:
        """(..., 2) pixels of the same camera without distortion, from those of the real one.

        That camera sees less than 180 degrees: what a fisheye sees more than 87 degrees off its
        axis is put there.
        """
        import cv2

        q = np.asarray(pixels, dtype=float)
        if self.is_pinhole:
            return q.copy()
        if self.is_fisheye:
            flat: Array = fisheye_lens(self.distortion).straightened((q - self.center) / self.focal)
            return flat * self.focal + self.center
        # 40 rounds: OpenCV's 5 leave some hundredths of a pixel in the corners of a wide lens.
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-10)
        flat = np.ascontiguousarray(q.reshape(-1, 1, 2))
        undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # OpenCV 4, OpenCV 5
        straight = undistort(flat, self.K, self.coefficients, R=None, P=self.K, criteria=criteria)
        return np.asarray(straight).reshape(q.shape)

    def rays(self, pixels: Array) -> Array:
        """(..., 3) unit vectors in the camera's frame along which pixels (..., 2) look."""
        if self.is_fisheye:
            return fisheye_lens(self.distortion).rays(
                (np.asarray(pixels, dtype=float) - self.center) / self.focal
            )
        flat = (self.undistort(pixels) - self.center) / self.focal
        rays = np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1)
        unit: Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return unit


def of_camera(camera: Camera) -> Intrinsics:
    """Intrinsics of a station's camera."""
    return Intrinsics(
        width=camera.width,
        height=camera.height,
        focal=camera.focal,
        center=camera.principal_point,
    )


def of_camera_info(info: Any) -> Intrinsics:
    """From Drake's `CameraInfo`."""
    return Intrinsics(
        width=info.width(),
        height=info.height(),
        focal=(info.focal_x(), info.focal_y()),
        center=(info.center_x() - HALF_PIXEL, info.center_y() - HALF_PIXEL),
    )


def camera_info(intrinsics: Intrinsics) -> Any:
    """Drake's `CameraInfo`.

    Raises:
        InvalidInputError: the camera has distortion, or is a fisheye, which Drake's is not; or its
            principal point is outside of the image.
    """
    from pydrake.systems.sensors import CameraInfo

    if not intrinsics.is_pinhole:
        raise InvalidInputError(
            "Drake's cameras are pinholes without lens distortion; undistort the images"
        )
    (fx, fy), (cx, cy) = intrinsics.focal, intrinsics.center
    width, height = intrinsics.width, intrinsics.height
    if not 0 < cx + HALF_PIXEL < width or not 0 < cy + HALF_PIXEL < height:
        raise InvalidInputError(
            f"the principal point {cx:g}, {cy:g} is outside of the image, which has {width} x"
            f" {height} pixels; give intrinsics of images of this size"
        )
    return CameraInfo(intrinsics.width, intrinsics.height, fx, fy, cx + HALF_PIXEL, cy + HALF_PIXEL)
