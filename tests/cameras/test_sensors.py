"""Presets of depth cameras: figures against data sheets, sizes against calibrations of devices."""

from __future__ import annotations

import numpy as np
import pytest

from burg_drake.cameras import SENSOR_PRESETS, Intrinsics, scaled, sensor
from burg_drake.core import InvalidInputError, UnknownNameError


def test_sizes_agree_with_what_devices_say() -> None:
    """Calibrations that librealsense tells of a D435 and a D455 at 640 x 480, and k4a at 1080p."""
    for camera, focal, center in (
        (sensor("d435").depth_camera((640, 480)), (382.6, 382.6), (319.0, 246.3)),
        (sensor("d435").color_camera((640, 480)), (613.8, 613.9), (317.1, 248.8)),
        (sensor("d455").depth_camera((640, 480)), (384.9, 384.9), (320.2, 242.3)),
        (sensor("d455").color_camera((640, 480)), (379.5, 379.2), (319.9, 242.0)),
        (sensor("d435").depth_camera((1280, 720)), (637.6, 637.6), (638.3, 370.5)),
        (sensor("azure_kinect").color_camera((1920, 1080)), (904.14, 903.52), (953.28, 555.14)),
    ):
        np.testing.assert_allclose(camera.focal, focal, atol=0.1)
        np.testing.assert_allclose(camera.center, center, atol=0.5)


@pytest.mark.parametrize(
    ("name", "horizontal", "vertical"),
    [
        ("d435", 87, 58),
        ("d455", 87, 58),
        ("azure_kinect", 75, 65),
        ("zivid_two", 56.6, 35.6),
        ("kinect", 57, 43),
    ],
)
def test_fields_of_view_are_those_of_data_sheets(
    name: str, horizontal: float, vertical: float
) -> None:
    """Devices differ; Intel gives 3 degrees, for 16:9, and calls the D435's 90 elsewhere."""
    camera = sensor(name).depth[-1]
    (cx, cy), right, bottom = camera.center, camera.width - 0.5, camera.height - 0.5
    borders = np.array([[-0.5, cy], [right, cy], [cx, -0.5], [cx, bottom]])
    flat = (camera.undistort(borders) - camera.center) / camera.focal
    left, right, top, bottom = np.rad2deg(np.arctan(np.abs(flat).max(axis=1)))
    assert left + right == pytest.approx(horizontal, abs=3.5)
    assert top + bottom == pytest.approx(vertical, abs=3.5)


def test_presets_are_whole() -> None:
    for name, preset in SENSOR_PRESETS.items():
        near, far = preset.depth_range
        assert preset.name == name and preset.source and 0.0 < near < far
        assert preset.depth_camera() is preset.depth[0]
        for camera in (*preset.depth, *preset.color):
            middle = np.array([camera.width - 1, camera.height - 1]) / 2
            assert np.abs(camera.center - middle).max() < 0.08 * camera.width
            assert camera.camera.startswith(name)


def test_a_scaled_image_shows_the_same_at_its_edges() -> None:
    """The image's left edge is half a pixel before the first centre, whatever the size."""
    camera = Intrinsics(width=640, height=480, focal=(600.0, 610.0), center=(310.0, 250.0))
    half = scaled(camera, 320, 240)
    for size, pixel in ((640, -0.5), (320, -0.5), (640, 639.5), (320, 319.5)):
        one = camera if size == 640 else half
        whole = -0.5 if pixel < 0 else 639.5
        expected = (whole - camera.center[0]) / camera.focal[0]
        assert (pixel - one.center[0]) / one.focal[0] == pytest.approx(expected, abs=1e-12)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(UnknownNameError, match=r"'d453'.*did you mean"):
        sensor("d453")
    with pytest.raises(InvalidInputError, match=r"d435.*500 x 500"):
        sensor("d435").depth_camera((500, 500))
    with pytest.raises(InvalidInputError, match=r"640 x 480.*640 x 576"):
        scaled(sensor("azure_kinect").depth_camera(), 640, 480)
    with pytest.raises(InvalidInputError, match="no colour images of 0 x 0"):
        sensor("d455").color_camera((0, 0))
