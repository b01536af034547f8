"""A station in Meshcat: tiles where they belong, and everything under the paths of the legend."""

from __future__ import annotations

import numpy as np
import pytest
from eye import VIEWS, in_view
from pydrake.geometry import Meshcat

from burg_drake.core import transform_points
from burg_drake.motion import ArmSpan, ReachabilityMap, empty_scene
from burg_drake.scene import load_scene
from burg_drake.station import load_station
from burg_drake.visualization import (
    MAP_PATH,
    REACHABILITY_BINS,
    ColorBar,
    LegendEntry,
    open_meshcat,
    show_station,
    tile_triangles,
)
from tests.thorough import thorough


@pytest.fixture(scope="module")
def meshcat() -> Meshcat:
    return open_meshcat()


def checkered() -> ReachabilityMap:
    """Two heights; one cell of six is reached with all four orientations, one with one."""
    reached = np.zeros((2, 2, 3, 4), dtype=bool)
    reached[1, 1, 2] = True
    reached[0, 0, 0, 3] = True
    return ReachabilityMap(
        x=np.array([0.1, 0.3, 0.5]),
        y=np.array([0.1, 0.3]),
        heights=np.array([0.05, 0.15]),
        tilt=np.zeros(4),
        R_WG=np.tile(np.eye(3), (4, 1, 1)),
        reached=reached,
        cell=(0.2, 0.2),
    )


def test_everything_in_the_legend_is_there(meshcat: Meshcat) -> None:
    station = load_station("panda_shelf")
    span = ArmSpan(np.array([0.0, 0.0, 0.333]), 0.95)
    legend = show_station(
        empty_scene(), station, meshcat, reachability=checkered(), span=span, camera="board"
    )
    bar = next(entry for entry in legend if isinstance(entry, ColorBar))
    assert sum(bar.counts) == 12 and (bar.counts[0], bar.counts[-1]) == (10, 1)
    entries = [entry for entry in legend if isinstance(entry, LegendEntry)]
    assert [entry.label for entry in entries] == [
        "tiles on the board: 5 cm above it, 17 % reached",
        "small tiles: 15 cm above it, 17 % reached",
        "longest reach on the table, 0.89 m",
        "cameras, upper edge bold",
        "obstacles",
    ]
    for entry in entries:
        assert any(meshcat.HasPath(path) for path in entry.paths), entry.label
    shown = {
        (b, k)
        for b in range(REACHABILITY_BINS)
        for k in (0, 1)
        if meshcat.HasPath(f"{MAP_PATH}/{b}/{k}")
    }
    assert shown == {(0, 0), (2, 0), (0, 1), (REACHABILITY_BINS - 1, 1)}
    for name in ("overview", "board"):
        assert meshcat.HasPath(f"/drake/cameras/{name}/image")


def test_a_station_without_an_arm_and_obstacles(meshcat: Meshcat) -> None:
    legend = show_station(empty_scene(), load_station("wsg_tabletop"), meshcat)
    assert [entry.label for entry in legend if isinstance(entry, LegendEntry)] == [
        "cameras, upper edge bold"
    ]


@pytest.mark.parametrize("name", [thorough("panda_bin"), "panda_tabletop", "wsg_tabletop"])
def test_cameras_and_board_are_in_view(name: str) -> None:
    station, meshcat = load_station(name), open_meshcat()
    show_station(empty_scene(), station, meshcat)
    page = meshcat.StaticHtml()
    (x, y), X_WS = empty_scene().board.size, station.document.X_WS.matrix()
    points = [transform_points(X_WS, [[0, 0, 0], [x, 0, 0], [x, y, 0], [0, y, 0]])]
    for camera in station.document.cameras.values():
        X_WC = camera.X_WC.matrix()
        ahead = 0.16 * X_WC[:3, 2]  # its image is drawn there
        points.append(X_WC[None, :3, 3] + np.outer([0.0, 1.0], ahead))
    for view in VIEWS:
        assert np.abs(in_view(page, np.vstack(points), view)).max() < 1.0, view


def test_the_share_says_what_stood_on_the_board(meshcat: Meshcat) -> None:
    station = load_station("panda_tabletop")
    for scene, text in ((empty_scene(), "board empty"), (load_scene("tabletop_six"), "6 objects")):
        legend = show_station(scene, station, meshcat, reachability=checkered())
        (bar,) = (entry for entry in legend if isinstance(entry, ColorBar))
        assert text in bar.title


def test_tiles_cover_their_cells_and_face_up() -> None:
    middle = np.array([[0.1, 0.2], [-0.3, 0.5]])
    vertices, faces = tile_triangles(middle, np.array([0.2, 0.1]), 0.03)
    assert vertices.shape == (3, 8) and faces.shape == (3, 4)
    a, b, c = (vertices[:, faces[k]].T for k in range(3))
    normal = np.cross(b - a, c - a) / 2.0
    np.testing.assert_allclose(normal, [[0.0, 0.0, 0.01]] * 4, atol=1e-12)
    np.testing.assert_allclose(vertices[2], 0.03)
    np.testing.assert_allclose(vertices[:2].reshape(2, 2, 4).mean(axis=2).T, middle)
