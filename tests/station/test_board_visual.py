"""The drawn sheet against OpenCV: what a simulated camera sees of the markers, and where."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from pydrake.geometry import Meshcat, Role

from burg_drake.core import Pose, inverse
from burg_drake.scene import Board, Markers, Scene, SceneDocument, load_scene, marker_dictionary
from burg_drake.station import (
    Camera,
    Station,
    StationDiagram,
    board_meshes,
    build_station_diagram,
    load_station,
)
from burg_drake.system_libraries import missing_render_libraries

needs_renderer = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)

BURG_BOARD = Board(
    size=(0.420, 0.297), markers=Markers(dictionary="4X4_250", side=0.057, spacing=0.019)
)
BOARDS = {"default": Board(), "4x4": BURG_BOARD}
TINY = Board(size=(0.03, 0.03))


def empty(board: Board) -> Scene:
    document = SceneDocument(name="empty", library="household", board=board)
    return Scene(document, load_scene("tabletop_six").library, Path("empty.yaml"))


def station_with(X_WS: Pose = Pose(), **cameras: Camera) -> Station:
    station = load_station("panda_tabletop")
    return replace(station, document=replace(station.document, X_WS=X_WS, cameras=cameras))


def triangles(board: Board, part: str) -> np.ndarray:
    """(N, 4, 2) corners of the squares, read from the OBJ."""
    text = board_meshes(board)[part].source().in_memory().mesh_file.contents().decode()
    words = [line.split() for line in text.splitlines()]
    vertices = np.array([[float(x) for x in w[1:]] for w in words if w[0] == "v"])
    faces = [[int(x.split("/")[0]) - 1 for x in w[1:]] for w in words if w[0] == "f"]
    assert not vertices[:, 2].any()
    return vertices[np.array(faces)][..., :2]


def image(built: StationDiagram, camera: str, kind: str) -> np.ndarray:
    port = built.diagram.GetOutputPort(f"camera.{camera}.{kind}_image")
    return np.array(port.Eval(built.diagram.CreateDefaultContext()).data).squeeze()


@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)
def test_paper_and_ink_cover_the_sheet_once(board: Board) -> None:
    area = {}
    for part in ("paper", "markers"):
        x, y = np.moveaxis(triangles(board, part), -1, 0)
        doubled = (x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1)  # shoelace formula
        assert (doubled > 0).all()  # all face up
        area[part] = doubled.sum() / 2
    assert sum(area.values()) == pytest.approx(np.prod(board.size), rel=1e-6)
    cell = (board.layout.side / board.layout.cells) ** 2
    assert area["markers"] == pytest.approx(board.layout.black.sum() * cell, rel=1e-6)


@needs_renderer
@pytest.mark.parametrize("board", BOARDS.values(), ids=BOARDS)
def test_opencv_finds_every_marker_where_the_layout_has_it(board: Board) -> None:
    """From above, tilted, over a board that is turned and raised."""
    X_WS = Pose((0.3, -0.1, 0.07), rpy_deg=(3.0, -4.0, 25.0))
    X_SC = Pose((*(np.array(board.size) / 2), 0.8), rpy_deg=(175.0, 6.0, 20.0)).matrix()
    camera = Camera(
        X_WC=Pose.from_matrix(X_WS.matrix() @ X_SC), width=1280, height=960, focal=(1150.0, 1150.0)
    )
    built = build_station_diagram(
        empty(board), station_with(X_WS, above=camera), robot="none", cameras=True
    )
    grey = cv2.cvtColor(image(built, "above", "color"), cv2.COLOR_RGBA2GRAY)
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    dictionary = marker_dictionary(board.markers.dictionary)
    found, ids, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(grey)
    layout = board.layout
    assert sorted(ids.ravel()) == sorted(layout.ids)
    p_CS = inverse(X_SC)
    for i, corners in zip(ids.ravel(), found, strict=True):
        p_CQ = layout.p_SQ[list(layout.ids).index(i)] @ p_CS[:3, :3].T + p_CS[:3, 3]
        expected = p_CQ[:, :2] / p_CQ[:, 2:] * camera.focal + camera.principal_point
        # this refinement puts pixel edges at integers
        np.testing.assert_allclose(corners[0] - 0.5, expected, atol=0.35)
    # depth: the sheet is the plane z = 0 of S
    rays = np.array([0.0, 0.0, 1.0])
    height = float(X_SC[2, 3] / -(X_SC[:3, :3] @ rays)[2])
    row, column = (round(c) for c in camera.principal_point[::-1])
    assert image(built, "above", "depth")[row, column] == pytest.approx(height, abs=2e-4)


def visuals(built: StationDiagram) -> list[str]:
    inspector = built.scene_graph.model_inspector()
    names = [inspector.GetName(id) for id in inspector.GetAllGeometryIds(Role.kIllustration)]
    return [name for name in names if name.startswith("board::")]


def test_markers_are_drawn_where_somebody_looks() -> None:
    scene, station = empty(Board()), station_with()
    assert visuals(build_station_diagram(scene, station, robot="none")) == ["board::paper"]
    if not missing_render_libraries():
        built = build_station_diagram(scene, station, robot="none", cameras=True)
        assert visuals(built) == ["board::paper", "board::markers"]


def test_people_see_pale_markers() -> None:
    """Grasps, labels and objects stand out in Meshcat; black is for cameras (tested above)."""
    built = build_station_diagram(empty(Board()), station_with(), robot="none", meshcat=Meshcat())
    inspector = built.scene_graph.model_inspector()
    brightness = [
        inspector.GetIllustrationProperties(id).GetProperty("phong", "diffuse").rgba[:3].mean()
        for id in inspector.GetAllGeometryIds(Role.kIllustration)
        if inspector.GetName(id) in ("board::paper", "board::markers")
    ]
    assert sorted(brightness)[0] > 0.75 and np.ptp(brightness) > 0.1


@needs_renderer
def test_markers_that_do_not_fit_leave_the_board_white() -> None:
    camera = Camera(X_WC=Pose((0.015, 0.015, 0.1), rpy_deg=(180.0, 0.0, 0.0)), width=64, height=64)
    station = station_with(top=camera)
    built = build_station_diagram(empty(TINY), station, robot="none", cameras=True)
    assert visuals(built) == ["board::paper"]
    middle = image(built, "top", "color")[20:44, 20:44, :3]
    assert middle.min() > 230


def test_meshes_of_a_board_are_made_once() -> None:
    assert board_meshes(Board()) is board_meshes(Board())
