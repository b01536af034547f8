"""Point clouds of simulated cameras: surfaces lie where the documents say."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from burg_drake.core import Pose
from burg_drake.scene import Scene, SceneDocument, load_scene
from burg_drake.station import (
    Camera,
    Obstacle,
    SurroundingsProperties,
    build_station_diagram,
    load_station,
)
from burg_drake.system_libraries import missing_render_libraries

CENTRE, SIZE = np.array([0.4, 0.0, 0.05]), np.array([0.2, 0.16, 0.1])
"""Of a box on the board [m]."""
CAMERA = Camera(
    X_WC=Pose((1.1, -0.5, 0.9), rpy_deg=(-135.0, 25.0, 50.0)),
    width=320,
    height=240,
    focal=(300.0, 310.0),
    center=(150.0, 125.0),
    depth_range=(0.3, 1.6),
)
"""Looks at the box from the side and above, tilted."""


@pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)
def test_points_lie_on_the_surfaces_that_the_camera_sees() -> None:
    """Half a pixel would be 0.6 mm and more here, across surfaces that are seen aslant."""
    station = load_station("panda_tabletop")
    box = Obstacle(X_WB=Pose(tuple(CENTRE)), size=tuple(SIZE))
    document = replace(station.document, cameras={"one": CAMERA}, background={"box": box})
    library = load_scene("tabletop_six").library
    empty = Scene(SceneDocument(name="empty", library="household"), library, Path("empty.yaml"))
    built = build_station_diagram(
        empty, replace(station, document=document), robot="none", cameras=["one"]
    )
    context = built.diagram.CreateDefaultContext()

    def read(port: str):
        return built.diagram.GetOutputPort(f"camera.one.{port}").Eval(context)

    X_WC = read("pose").GetAsMatrix4()
    assert pytest.approx(CAMERA.X_WC.matrix(), abs=1e-12) == X_WC
    cloud = read("point_cloud")
    p_W, colors = cloud.xyzs().T.astype(float), cloud.rgbs().T
    assert len(p_W) == 320 * 240
    image = np.asarray(read("color_image").data)[..., :3].reshape(-1, 3)
    assert (colors == image).all()

    labels = np.asarray(read("label_image").data).reshape(-1)
    depth = np.asarray(read("depth_image").data).reshape(-1)
    seen = np.isfinite(p_W).all(axis=1)
    assert (seen == (np.isfinite(depth) & (depth > 0.0))).all()
    assert 0.5 < seen.mean() < 1.0
    at = {name: seen & (labels == int(index)) for index, name in built.body_names.items()}
    over_board = seen & (labels == int(built.plant.GetBodyByName("board").index()))
    assert over_board.sum() > 5000 and at["box"].sum() > 2500
    assert np.abs(p_W[over_board, 2]).max() < 1e-4
    # All points of the box are on one of its faces, less the paper under it.
    beyond = np.abs(p_W[at["box"]] - CENTRE) - SIZE / 2.0
    assert beyond.max(axis=1) == pytest.approx(-SurroundingsProperties.paper_thickness, abs=2e-6)
    faces = np.bincount(beyond.argmax(axis=1), minlength=3)
    assert faces.min() > 300

    # A pixel's point is in its direction, as OpenCV has it: z forward, x right, y down.
    v, u = np.divmod(np.flatnonzero(at["box"]), 320)
    p_C = (p_W[at["box"]] - X_WC[:3, 3]) @ X_WC[:3, :3]
    assert 300.0 * p_C[:, 0] / p_C[:, 2] + 150.0 == pytest.approx(u, abs=1e-2)
    assert 310.0 * p_C[:, 1] / p_C[:, 2] + 125.0 == pytest.approx(v, abs=1e-2)
