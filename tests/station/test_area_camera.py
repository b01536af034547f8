"""Means over pixels, against the fine image averaged by numpy and the pinhole model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform

from burg_drake.cameras import camera_intrinsics
from burg_drake.core import FieldError, Pose
from burg_drake.scene import Scene, SceneDocument, load_scene
from burg_drake.station import (
    Camera,
    Station,
    build_station_diagram,
    load_station,
    supersampled_camera,
)
from burg_drake.system_libraries import missing_render_libraries
from tests.cameras.synthetic import levels, light_of

needs_renderer = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)

CAMERA = Camera(
    X_WC=Pose((0.45, 0.1, 0.6), rpy_deg=(170.0, 8.0, 20.0)),
    width=160,
    height=120,
    focal=(150.0, 152.0),
    center=(78.3, 61.0),
)


def station_with(**cameras: Camera) -> Station:
    station = load_station("panda_tabletop")
    return replace(station, document=replace(station.document, cameras=cameras))


def test_a_finer_pixel_lies_within_its_pixel() -> None:
    """Along each side n fine pixels fill a pixel: their centres have the pixel's as their mean."""
    n, p_CQ = 3, np.array([[0.02, -0.07, 0.6], [0.1, 0.03, 1.1]])
    coarse = camera_intrinsics(CAMERA).project(p_CQ)
    fine = camera_intrinsics(supersampled_camera(replace(CAMERA, samples=n))).project(p_CQ)
    np.testing.assert_allclose(fine, n * coarse + (n - 1) / 2, atol=1e-9)
    first = camera_intrinsics(supersampled_camera(replace(CAMERA, center=None, samples=n)))
    assert (first.width, first.height) == (480, 360)
    assert first.center == (239.5, 179.5)  # the middle stays the middle


@needs_renderer
@pytest.mark.parametrize("n", [2, 3])
def test_mean_of_the_fine_image(n: int) -> None:
    document = SceneDocument(name="empty", library="household")
    scene = Scene(document, load_scene("tabletop_six").library, Path("empty.yaml"))
    area = replace(CAMERA, samples=n)
    station = station_with(area=area, fine=supersampled_camera(area), plain=CAMERA)
    diagram = build_station_diagram(scene, station, robot="none", cameras=True).diagram
    context = diagram.CreateDefaultContext()

    def image(camera: str, kind: str = "color") -> np.ndarray:
        port = diagram.GetOutputPort(f"camera.{camera}.{kind}_image")
        return np.array(port.Eval(context).data)

    for X_WC in (CAMERA.X_WC, Pose((0.4, 0.0, 0.5), rpy_deg=(180.0, 0.0, 50.0))):
        for name in ("area", "fine", "plain"):
            sensor = diagram.GetSubsystemByName(f"camera.{name}")
            mine = sensor.GetMyMutableContextFromRoot(context)
            sensor.SetX_PB(mine, RigidTransform(X_WC.matrix()))
        light = light_of(image("fine")).reshape(120, n, 160, n, 4)
        means = levels(light.mean(axis=(1, 3)))
        assert np.abs(image("area") - means).max() <= 0.51
        assert means.std() > 50
        for kind in ("depth", "label"):  # these stay one ray a pixel
            np.testing.assert_array_equal(image("area", kind), image("plain", kind))


@pytest.mark.parametrize("samples", [0, 9])
def test_samples_out_of_range(samples: int) -> None:
    with pytest.raises(FieldError, match=rf"samples of a camera is {samples}.* 1 to 8"):
        replace(CAMERA, samples=samples)
