"""Cameras against the pinhole model: pixel centres at integers, as in OpenCV."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import MissingDependencyError, Pose, inverse
from burg_drake.scene import Scene, SceneDocument, load_scene
from burg_drake.station import (
    Camera,
    Obstacle,
    Station,
    StationDiagram,
    SurroundingsProperties,
    build_station_diagram,
    load_station,
    render_cameras,
)
from burg_drake.system_libraries import missing_render_libraries

needs_renderer = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)

TARGET = Obstacle(X_WB=Pose((0.4, 0.1, 0.05)), size=(0.2, 0.2, 0.1))
"""A box whose top face is a square of 0.2 m at z = 0.1 m."""
LOOKING_DOWN = (180.0, 0.0, 0.0)


def station_with(**cameras: Camera) -> Station:
    station = load_station("panda_tabletop")
    document = replace(station.document, cameras=cameras, background={"target": TARGET})
    return replace(station, document=document)


@pytest.fixture(scope="module")
def empty() -> Scene:
    library = load_scene("tabletop_six").library
    return Scene(SceneDocument(name="empty", library="household"), library, Path("empty.yaml"))


def image(built: StationDiagram, camera: str, kind: str) -> np.ndarray:
    port = built.diagram.GetOutputPort(f"camera.{camera}.{kind}_image")
    return np.array(port.Eval(built.diagram.CreateDefaultContext()).data).squeeze()


def test_intrinsics_are_shifted_by_half_a_pixel() -> None:
    camera = Camera(X_WC=Pose(), width=320, height=200, focal=(300.0, 310.0), center=(150.0, 90.0))
    for rendered in render_cameras(camera):
        info = rendered.core().intrinsics()
        assert (info.width(), info.height()) == (320, 200)
        assert (info.focal_x(), info.focal_y()) == (300.0, 310.0)
        assert (info.center_x(), info.center_y()) == (150.5, 90.5)
    color, depth = render_cameras(camera)
    clipping = color.core().clipping()
    near, far = depth.depth_range().min_depth(), depth.depth_range().max_depth()
    assert (near, far) == camera.depth_range
    assert clipping.near() < near and clipping.far() > far


@needs_renderer
@pytest.mark.parametrize("center", [None, (140.0, 130.0)])
def test_label_and_depth_by_the_pinhole_model(
    empty: Scene, center: tuple[float, float] | None
) -> None:
    """The top face of the target, seen from straight above, is a square in the image."""
    camera = Camera(
        X_WC=Pose((0.43, 0.08, 0.9), rpy_deg=LOOKING_DOWN),
        width=320,
        height=240,
        focal=(302.0, 302.0),
        center=center,
    )
    built = build_station_diagram(empty, station_with(top=camera), robot="none", cameras=True)
    label = int(built.fixed["target"])
    rows, columns = np.nonzero(image(built, "top", "label") == label)
    p_CQ = (inverse(camera.X_WC.matrix()) @ [0.4, 0.1, 0.1, 1.0])[:3]
    middle = p_CQ[:2] / p_CQ[2] * camera.focal + camera.principal_point
    # The square is 75.5 pixels wide, and its sides are not at pixel centres: an offset of half a
    # pixel would change the first or the last pixel in it.
    half = 0.1 / p_CQ[2] * 302.0
    for pixels, c in zip((columns, rows), middle, strict=True):
        assert (pixels.min(), pixels.max()) == (np.ceil(c - half), np.floor(c + half))
    depth = image(built, "top", "depth")
    assert depth[rows, columns] == pytest.approx(
        np.full(len(rows), 0.8 + SurroundingsProperties.paper_thickness), abs=1e-5
    )
    table = image(built, "top", "label") == int(built.table)
    assert depth[table] == pytest.approx(
        np.full(table.sum(), 0.9 + SurroundingsProperties.paper_thickness), abs=1e-5
    )


@needs_renderer
def test_every_camera_of_the_built_in_station(empty: Scene) -> None:
    station = load_station("panda_tabletop")
    built = build_station_diagram(empty, station, cameras=True)
    ports = built.diagram.num_output_ports()
    names = [built.diagram.get_output_port(i).get_name() for i in range(ports)]
    assert [name for name in names if name.startswith("camera.")] == [
        f"camera.{camera}.{kind}"
        for camera in ("overview", "board")
        for kind in ("color_image", "depth_image", "label_image", "pose", "point_cloud")
    ]
    for name in station.document.cameras:
        color = image(built, name, "color")
        assert color.shape == (480, 640, 4)
        assert color[..., :3].std() > 10
        labels = set(np.unique(image(built, name, "label")))
        assert int(built.table) in labels
        assert labels & {int(i) for i in built.robot_bodies}


def test_missing_libraries_are_named(empty: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "burg_drake.station.camera_sensors.missing_render_libraries", lambda: ["libEGL.so.1"]
    )
    with pytest.raises(
        MissingDependencyError, match=r"cameras need the system libraries libEGL\.so\.1; run: "
    ):
        build_station_diagram(empty, station_with(), robot="none", cameras=True)
