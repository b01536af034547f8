"""Camera intrinsics, the fisheye lens model and the field of view.

Pixel centres are at integers and distortion follows OpenCV.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.polynomial import Polynomial

from burg_drake.core import (
    Array,
    Booleans,
    FieldError,
    InvalidInputError,
    Ranges,
    require_ranges,
    suggest_names,
)
from burg_drake.station import FOCAL_RANGE, HALF_PIXEL as HALF_PIXEL, Camera, require_image_size

IMAGE_PARTS = (
    *("upper left corner", "upper edge", "upper right corner"),
    *("left edge", "middle", "right edge"),
    *("lower left corner", "lower edge", "lower right corner"),
)
"""Names of the nine parts of an image, row by row."""
MAX_REPORTED_ERROR_PX = 10.0
"""Larger error bounds are reported as "more than" this, in pixels."""


def describe_accuracy(
    known_to: float, except_at: Sequence[str], bounds: Mapping[str, str] = {}
) -> str:
    """Text on the accuracy of a camera, such as `to 0.21 pixels over the whole image`.

    Args:
        known_to: error bound outside the excepted parts [pixels].
        except_at: excepted `IMAGE_PARTS`; if they are most of the image, the text names the others.
        bounds: text on the bounds of some parts.
    """
    if not known_to < MAX_REPORTED_ERROR_PX:
        return f"no better than to {MAX_REPORTED_ERROR_PX:g} pixels"
    if not except_at:
        return f"to {known_to:.2f} pixels over the whole image"
    others = ", ".join(f"{name} ({bounds[name]})" if name in bounds else name for name in except_at)
    if not excludes_most_parts(except_at):
        return f"to {known_to:.2f} pixels, but for the {others}"
    named = ", ".join(name for name in IMAGE_PARTS if name not in except_at)
    return f"in the {named} only, to {known_to:.2f} pixels there, and not in the {others}"


def excludes_most_parts(except_at: Sequence[str]) -> bool:
    """Whether most parts of the image are excepted."""
    return 2 * len(except_at) > len(IMAGE_PARTS)


FISHEYE_COEFFICIENTS = 4  # Number of coefficients of the fisheye model.


@dataclass(frozen=True)
class FisheyeLens:
    """The fisheye lens model of OpenCV.

    Attributes:
        coefficients: k1, k2, k3, k4.
    """

    coefficients: tuple[float, ...]

    @cached_property
    def _radius(self) -> Polynomial:
        return Polynomial(np.insert(np.r_[1.0, self.coefficients], range(5), 0.0))

    @cached_property
    def _slope(self) -> Polynomial:
        return self._radius.deriv()

    @cached_property
    def max_angle(self) -> float:
        """Angle at which the polynomial stops growing, or pi [rad]. Beyond it the radius continues
        with one focal length per radian, so that no point from there appears in the image.
        """
        roots = self._slope.roots()
        real = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)]
        return float(min(real.min(initial=np.pi), np.pi))

    def radius(self, angle: Array) -> Array:
        """Image radius in focal lengths for angles from the axis [rad]."""
        within = np.minimum(angle, self.max_angle)
        return np.asarray(self._radius(within) + (angle - within))

    def angle(self, radius: Array) -> Array:
        """Angles from the axis [rad] for image radii; pi beyond the lens's range."""
        # Start values of the inversion, which Newton's method refines.
        table = np.linspace(0.0, self.max_angle, 512)
        end = float(self._radius(self.max_angle))
        inner = np.minimum(radius, end)
        angle = np.interp(inner, self._radius(table), table)
        for _ in range(4):  # Enough for rounding accuracy.
            slope = np.maximum(self._slope(angle), 1e-6)
            angle = np.clip(angle - (self._radius(angle) - inner) / slope, 0.0, self.max_angle)
        return np.minimum(angle + (radius - inner), np.pi)

    def project(self, p_CQ: Array) -> Array:
        """(..., 2) image points of points (..., 3) in the camera's frame, in focal lengths."""
        aside = np.linalg.norm(p_CQ[..., :2], axis=-1)
        radius = self.radius(np.arctan2(aside, p_CQ[..., 2]))
        # No direction is defined on the axis: ahead the radius is 0, behind is outside anyway.
        toward = p_CQ[..., :2] / np.maximum(aside, 1e-300)[..., None]
        toward = np.where((aside == 0.0)[..., None], [1.0, 0.0], toward)
        return np.asarray(toward * radius[..., None])

    def rays(self, bent: Array) -> Array:
        """(..., 3) unit vectors of the rays through image points (..., 2), in focal lengths."""
        radius = np.linalg.norm(bent, axis=-1)
        angle = self.angle(radius)
        aside = np.sin(angle) / np.maximum(radius, 1e-300)
        return np.concatenate([bent * aside[..., None], np.cos(angle)[..., None]], axis=-1)

    def undistort(self, bent: Array) -> Array:
        """(..., 2) image points without distortion; clipped to 87 degrees from the axis."""
        radius = np.linalg.norm(bent, axis=-1)
        # Radians. An undistorted image ends there, at 19 focal lengths.
        straight = np.tan(np.minimum(self.angle(radius), np.radians(87.0)))
        scale = np.where(radius > 0.0, straight / np.maximum(radius, 1e-300), 1.0)
        return np.asarray(bent * scale[..., None])


@lru_cache(maxsize=16)
def fisheye_lens(coefficients: tuple[float, ...]) -> FisheyeLens:
    """The lens with four coefficients."""
    return FisheyeLens(coefficients)


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
        # Numbers of coefficients that OpenCV's lens model may have.
        distortion_sizes = (0, 4, 5, 8, 12, 14)
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
            known = suggest_names(str(self.model), get_args(LensModel))
            raise FieldError(f"model {self.model!r} does not exist; {known}", "model")
        self._check_accuracy()
        if self.is_fisheye and len(self.distortion) != FISHEYE_COEFFICIENTS:
            raise FieldError(
                f"distortion has {len(self.distortion)} coefficients; a fisheye model has"
                f" {FISHEYE_COEFFICIENTS}: k1, k2, k3, k4",
                "distortion",
            )
        if len(self.distortion) not in distortion_sizes:
            raise FieldError(
                f"distortion has {len(self.distortion)} coefficients; OpenCV's model has"
                f" {', '.join(map(str, distortion_sizes))}",
                "distortion",
            )

    def _check_accuracy(self) -> None:
        if self.known_to is not None and not 0.0 < self.known_to < np.inf:
            raise FieldError(
                f"known_to is {self.known_to:g} pixels; it must be above 0", "known_to"
            )
        for k, name in enumerate(self.except_at):
            if name not in IMAGE_PARTS:
                raise FieldError(
                    f"except_at has {name!r}, which is not a part of the image;"
                    f" {suggest_names(name, IMAGE_PARTS, ordered=True)}",
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
        """Whether there is no distortion."""
        return not self.is_fisheye and not any(self.distortion)

    @property
    def is_fisheye(self) -> bool:
        """Whether the lens has the fisheye model, whose rays may come from beside the camera."""
        return self.model == "fisheye"

    def require_size(self, width: int, height: int, source: str) -> None:
        """Rejects images of another size than the calibrated one.

        Args:
            width, height: of the image [pixels].
            source: name in the message, such as `photo.png` or `camera 0`.

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
            p_CQ: (..., 3) points in front of the camera (z > 0) [m]; anywhere for a fisheye, which
                projects invisible points outside the image.

        Returns:
            (..., 2) pixels.
        """
        import cv2

        p = np.asarray(p_CQ, dtype=float)
        if self.is_fisheye:
            bent: Array = fisheye_lens(self.distortion).project(p) * self.focal + self.center
            return bent
        if self.is_pinhole or not p.size:
            straight: Array = p[..., :2] / p[..., 2:] * self.focal + self.center
            return straight
        flat = np.ascontiguousarray(p.reshape(-1, 1, 3))
        pixels, _ = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), self.K, self.coefficients)
        return np.asarray(pixels).reshape(*p.shape[:-1], 2)

    def undistort(self, pixels: Array) -> Array:
        """(..., 2) pixels of the same camera without distortion, from distorted pixels.

        That camera sees less than 180 degrees: rays of a fisheye are clipped to 87 degrees from the
        axis.
        """
        import cv2

        q = np.asarray(pixels, dtype=float)
        if self.is_pinhole:
            return q.copy()
        if self.is_fisheye:
            flat: Array = fisheye_lens(self.distortion).undistort((q - self.center) / self.focal)
            return flat * self.focal + self.center
        # 40 rounds: OpenCV's 5 leave some hundredths of a pixel in the corners of a wide lens.
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 1e-10)
        flat = np.ascontiguousarray(q.reshape(-1, 1, 2))
        undistort = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)  # OpenCV 4, OpenCV 5
        straight = undistort(flat, self.K, self.coefficients, R=None, P=self.K, criteria=criteria)
        return np.asarray(straight).reshape(q.shape)

    def rays(self, pixels: Array) -> Array:
        """(..., 3) unit vectors of the rays through pixels (..., 2), in the camera's frame."""
        if self.is_fisheye:
            bent = (np.asarray(pixels, dtype=float) - self.center) / self.focal
            return fisheye_lens(self.distortion).rays(bent)
        flat = (self.undistort(pixels) - self.center) / self.focal
        rays = np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1)
        unit: Array = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
        return unit


def camera_intrinsics(camera: Camera) -> Intrinsics:
    """Intrinsics of a station's camera."""
    return Intrinsics(
        width=camera.width,
        height=camera.height,
        focal=camera.focal,
        center=camera.principal_point,
    )


def of_camera_info(info: Any) -> Intrinsics:
    """Converts Drake's `CameraInfo` to intrinsics."""
    return Intrinsics(
        width=info.width(),
        height=info.height(),
        focal=(info.focal_x(), info.focal_y()),
        center=(info.center_x() - HALF_PIXEL, info.center_y() - HALF_PIXEL),
    )


def camera_info(intrinsics: Intrinsics) -> Any:
    """Drake's `CameraInfo`.

    Raises:
        InvalidInputError: the camera has distortion or is a fisheye, which Drake does not support;
            or its principal point is outside the image.
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


NEAR_DISTANCE = 0.01
"""Metres from the camera within which nothing is drawn."""


class FieldOfView:
    """A camera's field of view.

    Attributes:
        intrinsics: of the camera.
    """

    def __init__(self, intrinsics: Intrinsics) -> None:
        self.intrinsics = intrinsics

    @cached_property
    def directions(self) -> Array:
        """(H, W, 3) points at z = 1 on the rays of the pixels' centres, in the camera's frame; up
        to 87 degrees from the axis of a fisheye.
        """
        width, height = self.intrinsics.width, self.intrinsics.height
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).astype(float)
        flat = (self.intrinsics.undistort(grid) - self.intrinsics.center) / self.intrinsics.focal
        return np.concatenate([flat, np.ones((height, width, 1))], axis=-1)

    @cached_property
    def _field(self) -> tuple[Array, Array]:
        """Least and largest x / z and y / z in view, with a margin."""
        # Fraction of the image beyond its edge; lens models fold farther points back.
        margin = 0.05
        edges = self.directions[[0, -1]], self.directions[:, [0, -1]]
        border = np.concatenate([edge.reshape(-1, 3) for edge in edges])[:, :2]
        lower, upper = border.min(axis=0), border.max(axis=0)
        return lower - margin * (upper - lower), upper + margin * (upper - lower)

    def sees(self, p_CQ: Array) -> Booleans:
        """(...) whether points (..., 3) are in front of the camera and in, or barely outside, its
        field of view; only these may be projected.
        """
        lower, upper = self._field
        depth = p_CQ[..., 2:]
        outside = (p_CQ[..., :2] < lower * depth) | (p_CQ[..., :2] > upper * depth)
        return np.asarray((depth[..., 0] >= NEAR_DISTANCE) & ~outside.any(axis=-1))
