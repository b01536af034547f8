"""The scene in Meshcat: what is there, and that the camera sees it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from eye import VIEWS, in_view

from burg_drake.core import InvalidInputError, transform_points
from burg_drake.scene import Scene, load_scene
from burg_drake.station import Robot, Station, load_station
from burg_drake.visualization import draw_board, open_meshcat, show_scene


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


def test_everything_is_shown(scene: Scene, station: Station) -> None:
    meshcat = open_meshcat()
    show_scene(scene, station, meshcat)
    for name in scene.instances:
        assert meshcat.HasPath(f"/drake/visualizer/{name}/body"), name
        assert meshcat.HasPath(f"/drake/labels/{name}"), name
    for path in ("arm/panda_link7", "hand/panda_leftfinger", "table/table", "board"):
        assert meshcat.HasPath(f"/drake/visualizer/{path}"), path
    assert meshcat.HasPath("/drake/board")


def test_without_robot_and_labels(scene: Scene, station: Station) -> None:
    meshcat = open_meshcat()
    show_scene(scene, station, meshcat, robot="none", labels=False)
    assert meshcat.HasPath("/drake/visualizer/mug")
    assert not meshcat.HasPath("/drake/visualizer/arm")
    assert not meshcat.HasPath("/drake/labels/mug")


def test_labels_are_drawn_anew(scene: Scene, station: Station) -> None:
    meshcat = open_meshcat()
    draw_board(scene, station, meshcat)
    (first, *_) = scene.document.instances
    fewer = dataclasses.replace(scene.document, instances=(first,))
    draw_board(Scene(fewer, scene.library, scene.path), station, meshcat)
    assert meshcat.HasPath("/drake/labels/mug")
    assert not meshcat.HasPath("/drake/labels/bowl")


def test_a_taken_port_is_named() -> None:
    meshcat = open_meshcat()
    with pytest.raises(InvalidInputError, match=f"cannot listen on port {meshcat.port()}"):
        open_meshcat(meshcat.port())


ARM = np.array([[-0.13, 0.0, 0.0], [0.0, 0.0, 0.649], [0.50, 0.0, 0.60]])
"""Base, elbow (333 + 316 mm high) and hand of the Panda at home, from its base [m]."""


def board_corners(scene: Scene, station: Station) -> np.ndarray:
    x, y = scene.board.size
    return transform_points(
        station.document.X_WS.matrix(), [[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]]
    )


@pytest.mark.parametrize("robot", ["arm", "none"])
@pytest.mark.parametrize("scale", [0.5, 3.0])
def test_the_whole_board_and_the_arm_are_in_view(
    scene: Scene, station: Station, robot: Robot, scale: float
) -> None:
    board = dataclasses.replace(scene.board, size=tuple(scale * np.array(scene.board.size)))
    document = dataclasses.replace(scene.document, board=board, instances=())
    empty = Scene(document, scene.library, scene.path)
    meshcat = open_meshcat()
    show_scene(empty, station, meshcat, robot=robot)
    page, corners = meshcat.StaticHtml(), board_corners(empty, station)
    for view in VIEWS:
        assert np.abs(in_view(page, corners, view)).max() < 1.0, view
        if robot == "arm":
            assert station.document.arm is not None
            p_WA = station.document.arm.X_WA.matrix()[:3, 3]
            assert np.abs(in_view(page, p_WA + ARM, view)).max() < 1.0, view
    if robot == "none":
        assert np.ptp(in_view(page, corners, VIEWS[0]), axis=0).max() > 1.6, "the board is small"
