"""The scene in Meshcat: what is there, and that the camera sees it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from burg_drake.core.errors import InvalidInputError
from burg_drake.scene.scene import Scene, load_scene
from burg_drake.station.station import Station, load_station
from burg_drake.visualization.scene_view import (
    FIELD_OF_VIEW_DEG,
    camera_placement,
    draw_board,
    open_meshcat,
    show_scene,
)

BOARD = np.array([0.594, 0.420])
ASPECT = 1.5


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


def image_points(p_SC: np.ndarray, p_ST: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(N, 2) image coordinates; inside the picture they are between -1 and 1."""
    forward = (p_ST - p_SC) / np.linalg.norm(p_ST - p_SC)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, forward), forward])
    x, y, z = axes @ (points - p_SC).T
    assert (z > 0.0).all()
    half = np.tan(np.deg2rad(FIELD_OF_VIEW_DEG) / 2)
    return np.stack([x / z / half / ASPECT, y / z / half], axis=1)


@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_the_board_is_in_the_picture(across: bool, scale: float) -> None:
    size = scale * BOARD
    p_ST, p_SC = camera_placement(size, across)
    corners = np.array([[x, y, 0.0] for x in (0, size[0]) for y in (0, size[1])])
    seen = image_points(p_SC, p_ST, corners)
    assert np.abs(seen).max() < 1.0
    assert np.ptp(seen[:, 0]) > 0.6, "the board is too small in the picture"


def test_the_arm_at_home_is_in_the_picture(station: Station) -> None:
    p_ST, p_SC = camera_placement(BOARD, True)
    X_WS = station.document.X_WS.matrix()
    arm = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.85], [0.55, 0.0, 0.75]])
    p_S = (arm - X_WS[:3, 3]) @ X_WS[:3, :3]
    assert np.abs(image_points(p_SC, p_ST, p_S)).max() < 1.0
