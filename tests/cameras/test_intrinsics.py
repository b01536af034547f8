"""Intrinsics against OpenCV's and Drake's own arithmetic."""

from __future__ import annotations

import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from pydrake.systems.sensors import CameraInfo

from burg_drake.cameras import (
    Intrinsics,
    camera_info,
    camera_intrinsics,
    fisheye_lens,
    of_camera_info,
)
from burg_drake.core import FieldError, InvalidInputError, Pose
from burg_drake.station import Camera

PINHOLE = Intrinsics(width=640, height=480, focal=(600.0, 610.0), center=(315.0, 241.0))
RADIAL = replace(PINHOLE, distortion=(-0.3, 0.1, 0.001, -0.002, -0.01))
RATIONAL = replace(PINHOLE, distortion=(0.35, 0.02, 0.0002, -0.0003, 0.004, 0.75, 0.12, 0.01))
FISHEYE = replace(
    PINHOLE, focal=(220.0, 222.0), model="fisheye", distortion=(0.03, -0.02, 0.006, -0.001)
)


def wide_points(most: float = 85.0) -> np.ndarray:
    """Up to so many degrees off the axis."""
    rng = np.random.default_rng(0)
    angle, turn = np.radians(rng.uniform(0, most, 200)), rng.uniform(0, 2 * np.pi, 200)
    aside = np.sin(angle)
    rays = np.column_stack([aside * np.cos(turn), aside * np.sin(turn), np.cos(angle)])
    return rays * rng.uniform(0.3, 2.0, (200, 1))


def some_points() -> np.ndarray:
    rng = np.random.default_rng(0)
    z = rng.uniform(0.3, 2.0, 50)
    return np.column_stack([rng.uniform(-0.4, 0.4, 50) * z, rng.uniform(-0.3, 0.3, 50) * z, z])


def by_hand(intrinsics: Intrinsics, p_C: np.ndarray) -> np.ndarray:
    """The formula of OpenCV's documentation (calib3d, "detailed description")."""
    k1, k2, p1, p2, k3, k4, k5, k6 = (*intrinsics.distortion, *[0.0] * 8)[:8]
    x, y = p_C[:, 0] / p_C[:, 2], p_C[:, 1] / p_C[:, 2]
    r2 = x * x + y * y
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.column_stack([u, v]) * intrinsics.focal + intrinsics.center


@pytest.mark.parametrize("intrinsics", [PINHOLE, RADIAL, RATIONAL])
def test_projection_is_the_formula(intrinsics: Intrinsics) -> None:
    p_C = some_points()
    assert np.allclose(intrinsics.project(p_C), by_hand(intrinsics, p_C), atol=1e-9)
    assert intrinsics.project(p_C[None, :, None]).shape == (1, 50, 1, 2)


@pytest.mark.parametrize("intrinsics", [PINHOLE, RADIAL, RATIONAL])
def test_undistorted_pixels_are_those_of_a_pinhole_camera(intrinsics: Intrinsics) -> None:
    p_C = some_points()
    straight = intrinsics.undistort(by_hand(intrinsics, p_C))
    assert np.abs(straight - by_hand(PINHOLE, p_C)).max() < 1e-3


def test_a_fisheye_is_that_of_opencv() -> None:
    p_C = wide_points()
    k = np.array(FISHEYE.distortion)
    theirs, _ = cv2.fisheye.projectPoints(p_C[:, None], np.zeros(3), np.zeros(3), FISHEYE.K, k)
    pixels = FISHEYE.project(p_C)
    assert np.allclose(pixels, theirs[:, 0], atol=1e-9)
    assert FISHEYE.project(p_C[None, :, None]).shape == (1, 200, 1, 2)
    unit = p_C / np.linalg.norm(p_C, axis=1, keepdims=True)
    assert np.allclose(FISHEYE.rays(pixels), unit, atol=1e-9)
    straight = p_C[:, :2] / p_C[:, 2:] * FISHEYE.focal + FISHEYE.center
    assert np.allclose(FISHEYE.undistort(pixels), straight, atol=1e-6)
    middle = np.array([FISHEYE.center])
    assert np.allclose(FISHEYE.undistort(middle), middle)
    assert np.allclose(FISHEYE.rays(middle), [[0.0, 0.0, 1.0]])
    assert not FISHEYE.is_pinhole and not replace(FISHEYE, distortion=(0.0,) * 4).is_pinhole


def test_a_fisheye_puts_nothing_into_its_image_that_it_does_not_see() -> None:
    """Points beside and behind, of a lens whose polynomial has its highest value on the way."""
    lens = replace(FISHEYE, distortion=(-0.1, -0.03, 0.0, 0.0))
    # Its derivative is 1 - 0.3 a^2 - 0.15 a^4.
    assert fisheye_lens(lens.distortion).max_angle ** 2 == pytest.approx(
        (np.sqrt(0.69) - 0.3) / 0.3
    )
    angle = np.radians(np.linspace(0.0, 180.0, 181))
    rays = np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle)])
    u = lens.project(rays)[:, 0]
    assert (np.diff(u) > 0.0).all()
    behind = lens.project(np.array([[0.0, 0.0, -1.0], [1e-9, 0.0, -1.0], [0.0, 0.0, 1.0]]))
    assert np.allclose(behind[0], behind[1]) and behind[0, 0] > lens.width
    assert behind[2] == pytest.approx(lens.center)
    assert np.allclose(lens.rays(lens.project(rays[:72])), rays[:72], atol=1e-6)


def test_what_a_fisheye_sees_beside_itself_is_put_at_the_edge_of_a_straight_image() -> None:
    """Of 170 degrees across, whose corners look behind the camera."""
    seen = FISHEYE.rays(np.array([[0.0, 0.0], [0.0, 241.0]]))
    assert seen[0, 2] < 0.0 < seen[1, 2]
    straight = (FISHEYE.undistort(np.array([[0.0, 0.0]])) - FISHEYE.center) / FISHEYE.focal
    assert np.linalg.norm(straight) == pytest.approx(np.tan(np.radians(87.0)))


def test_drake_has_the_principal_point_half_a_pixel_further() -> None:
    info = camera_info(PINHOLE)
    assert (info.center_x(), info.center_y()) == (315.5, 241.5)
    assert of_camera_info(info) == PINHOLE
    # A centred camera: Drake's principal point is half of the size, ours the middle pixel's centre.
    centred = of_camera_info(CameraInfo(640, 480, 600.0, 600.0, 320.0, 240.0))
    assert centred.center == (319.5, 239.5) == camera_intrinsics(Camera(X_WC=Pose())).center
    with pytest.raises(InvalidInputError, match="pinholes without lens distortion"):
        camera_info(RADIAL)
    with pytest.raises(InvalidInputError, match="pinholes without lens distortion"):
        camera_info(replace(FISHEYE, distortion=(0.0,) * 4))


def test_images_of_another_size_are_refused() -> None:
    PINHOLE.require_size(640, 480, "photo.png")
    with pytest.raises(InvalidInputError, match=r"photo\.png has 1280 x 960"):
        PINHOLE.require_size(1280, 960, "photo.png")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"focal": (0.0, 600.0)}, "must be positive"),
        ({"width": 0}, "must be positive"),
        ({"focal": (np.nan, 600.0)}, "must be finite"),
        ({"center": (320.0, np.inf)}, "must be finite"),
        ({"distortion": (0.1, np.nan, 0.0, 0.0)}, "must be finite"),
        ({"width": 640.5}, "width 640.5 and height 480 of a camera must be whole pixels"),
        (
            {"model": "fisheye"},
            "distortion has 0 coefficients; a fisheye model has 4: k1, k2, k3, k4",
        ),
        ({"model": "fisheyes"}, "model 'fisheyes' does not exist; did you mean 'fisheye'?"),
        ({"known_to": -3.0}, "known_to is -3 pixels; it must be above 0"),
        ({"known_to": 0.0}, "known_to is 0 pixels; it must be above 0"),
        ({"known_to": np.inf}, "known_to is inf pixels; it must be above 0"),
        ({"known_to": np.nan}, "known_to is nan pixels; it must be above 0"),
        (
            {"except_at": ("middle", "nowhere")},
            "except_at has 'nowhere', which is not a part of the image; known: upper left corner",
        ),
        ({"distortion": (0.1,)}, "distortion has 1 coefficients; OpenCV's model has 0, 4, 5, 8"),
    ],
)
def test_what_no_camera_has(change: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=re.escape(message)):
        replace(PINHOLE, **change)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"model": "fisheyes"}, ("model",)),
        ({"known_to": -3.0}, ("known_to",)),
        ({"except_at": ("middle", "nowhere")}, ("except_at", 1)),
    ],
)
def test_errors_of_fields_say_which(change: dict[str, object], place: tuple[str | int]) -> None:
    with pytest.raises(FieldError) as raised:
        replace(PINHOLE, **change)  # type: ignore[arg-type]
    assert raised.value.place == place


def test_k_is_what_opencv_takes() -> None:
    p_C = some_points()
    pixels, _ = cv2.projectPoints(p_C, np.zeros(3), np.zeros(3), RADIAL.K, RADIAL.coefficients)
    assert np.allclose(pixels[:, 0], by_hand(RADIAL, p_C))
