"""Intrinsics of camera_info messages, of both versions of ROS."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from burg_drake.cameras import Intrinsics
from burg_drake.core import InvalidInputError
from burg_drake.ros import intrinsics_from_camera_info


def test_fields_of_ros_2(intrinsics: Intrinsics, info_message: Callable[..., Any]) -> None:
    expected = replace(intrinsics, camera="camera_optical")
    assert intrinsics_from_camera_info(info_message(intrinsics)) == expected


def test_fields_of_ros_1(intrinsics: Intrinsics, info_message: Callable[..., Any]) -> None:
    message = info_message(intrinsics)
    for name in "dkp":
        setattr(message, name.upper(), tuple(getattr(message, name)))
        delattr(message, name)
    assert intrinsics_from_camera_info(message) == replace(intrinsics, camera="camera_optical")


def test_eight_coefficients(intrinsics: Intrinsics, info_message: Callable[..., Any]) -> None:
    """OpenCV's own projection with all eight is the oracle."""
    coefficients = [0.4, -0.3, 0.001, -0.002, 0.05, 0.35, -0.25, 0.03]
    message = info_message(intrinsics, distortion_model="rational_polynomial", d=coefficients)
    p_CQ = np.array([[0.2, -0.1, 0.7], [-0.3, 0.2, 0.9]])
    K = np.array(message.k).reshape(3, 3)
    expected, _ = cv2.projectPoints(p_CQ, np.zeros(3), np.zeros(3), K, np.array(coefficients))
    assert intrinsics_from_camera_info(message).project(p_CQ) == pytest.approx(
        expected[:, 0], abs=1e-9
    )


@pytest.mark.parametrize("model", ["", "plumb_bob", "equidistant"])
def test_no_distortion_whatever_the_model(
    model: str, intrinsics: Intrinsics, info_message: Callable[..., Any]
) -> None:
    for d in ([], [0.0] * 5):
        message = info_message(intrinsics, distortion_model=model, d=d)
        assert intrinsics_from_camera_info(message).is_pinhole


def test_a_fisheye(intrinsics: Intrinsics, info_message: Callable[..., Any]) -> None:
    """OpenCV's own projection is the oracle."""
    coefficients = [0.03, -0.02, 0.006, -0.001]
    message = info_message(intrinsics, distortion_model="equidistant", d=coefficients)
    p_CQ = np.array([[1.2, -0.1, 0.3], [-0.3, 0.2, 0.9]])
    K, k = np.array(message.k).reshape(3, 3), np.array(coefficients)
    expected, _ = cv2.fisheye.projectPoints(p_CQ[:, None], np.zeros(3), np.zeros(3), K, k)
    assert intrinsics_from_camera_info(message).project(p_CQ) == pytest.approx(
        expected[:, 0], abs=1e-9
    )
    straight = intrinsics_from_camera_info(message, rectified=True)
    assert straight.is_pinhole


def test_rectified_images_have_the_projection_matrix(
    intrinsics: Intrinsics, info_message: Callable[..., Any]
) -> None:
    """A stereo camera's baseline, -30, is not of the image."""
    p = [500.0, 0.0, 310.0, -30.0, 0.0, 505.0, 236.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    found = intrinsics_from_camera_info(info_message(intrinsics, p=p), rectified=True)
    assert (found.focal, found.center, found.distortion) == ((500.0, 505.0), (310.0, 236.0), ())


def test_binning_and_region(intrinsics: Intrinsics, info_message: Callable[..., Any]) -> None:
    """A blob is drawn where a point of the full sensor is seen; the image that the camera would
    send is cut out of it and its pixels are merged by their mean."""
    pinhole = replace(intrinsics, distortion=())
    region = SimpleNamespace(x_offset=80, y_offset=60, width=480, height=360, do_rectify=False)
    message = info_message(pinhole, binning_x=4, binning_y=2, roi=region, d=[])
    found = intrinsics_from_camera_info(message)
    p_CQ = np.array([0.05, -0.06, 0.8])
    x, y = pinhole.project(p_CQ)
    columns, rows = np.meshgrid(np.arange(640), np.arange(480))
    blob = np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * 8.0**2))
    sent = blob[60:420, 80:560].reshape(180, 2, 120, 4).mean(axis=(1, 3))
    assert (found.width, found.height) == (120, 180)
    centroid = [(sent * axis).sum() / sent.sum() for axis in np.meshgrid(range(120), range(180))]
    assert found.project(p_CQ) == pytest.approx(centroid, abs=1e-6)


@pytest.mark.parametrize(
    ("fields", "rectified", "text"),
    [
        ({"k": [0.0] * 9}, False, "K = 0, so the camera is not calibrated"),
        ({"p": [0.0] * 12}, True, "P = 0, so the camera is not calibrated"),
        (
            {"distortion_model": "thin_prism_fisheye"},
            False,
            "'thin_prism_fisheye'; supported are plumb_bob, rational_polynomial and equidistant",
        ),
        ({"distortion_model": "equidistant"}, False, "5 coefficients; a fisheye model has 4"),
        ({"d": [np.nan, 0.2, 0.0, 0.0, 0.0]}, False, "not finite"),
        ({"k": [np.inf] * 9}, False, "not finite"),
        ({"d": [0.1, 0.2, 0.3]}, False, "3 coefficients"),
        ({"k": [600.0, 0.5, 320.0, 0.0, 600.0, 240.0, 0.0, 0.0, 1.0]}, False, "skew 0.5"),
    ],
)
def test_what_cannot_be_used(
    fields: dict[str, Any],
    rectified: bool,
    text: str,
    intrinsics: Intrinsics,
    info_message: Callable[..., Any],
) -> None:
    with pytest.raises(InvalidInputError, match=text):
        intrinsics_from_camera_info(info_message(intrinsics, **fields), rectified=rectified)
