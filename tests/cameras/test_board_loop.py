"""Simulated camera, board pose and overlay in a loop, against where Drake knows all to be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context
from scipy.ndimage import binary_dilation, binary_erosion
from scipy.spatial import KDTree

from burg_drake.cameras import (
    OUTLINE_KIND,
    BoardLoop,
    FieldOfView,
    LoopCamera,
    OverlayStyle,
    PoseFilter,
    build_board_loop,
    build_scene_mesh,
    visible_lines,
)
from burg_drake.core import (
    Array,
    InvalidInputError,
    Pose,
    UnknownNameError,
    inverse,
    make_pose,
    rotation_angle,
    rotation_from_rpy,
)
from burg_drake.scene import Board, Scene, SceneDocument, load_scene
from burg_drake.station import Camera, Station, build_station_diagram, load_station
from burg_drake.system_libraries import missing_render_libraries

pytestmark = pytest.mark.skipif(
    bool(missing_render_libraries()), reason="the renderer's system libraries are missing"
)

PLAIN = OverlayStyle(names=False, footprints=False, errors=False)
MIDDLE = np.array([0.297, 0.21, 0.0])
"""Of the board, in S [m]."""


def looking(distance: float, elevation: float, azimuth: float, roll: float) -> Array:
    """`X_SC` (4, 4) of a camera that looks at the board's middle; angles in degrees."""
    e, a, r = np.deg2rad([elevation, azimuth, roll])
    back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.array([-np.sin(a), np.cos(a), 0.0])
    R_SD = np.stack([right, np.cross(-back, right), -back], axis=1)
    return make_pose(R_SD @ rotation_from_rpy([0.0, 0.0, r]), MIDDLE + distance * back)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene("tabletop_six")


@pytest.fixture(scope="module")
def station() -> Station:
    return load_station("panda_tabletop")


@pytest.fixture(scope="module")
def loop(scene: Scene, station: Station) -> BoardLoop:
    return build_board_loop(scene, station, style=PLAIN)


@pytest.fixture
def context(loop: BoardLoop) -> Context:
    return loop.diagram.CreateDefaultContext()


def output(loop: BoardLoop, context: Context, name: str) -> np.ndarray:
    """Value of a port: (4, 4) for poses, pixels for images."""
    value = loop.diagram.GetOutputPort(name).Eval(context)
    if isinstance(value, RigidTransform):
        return value.GetAsMatrix4()
    return np.array(getattr(value, "data", value))


def errors(loop: BoardLoop, context: Context) -> tuple[float, float]:
    """Of the estimate: millimetres, degrees."""
    assert output(loop, context, "board.valid") == [1.0]
    X = inverse(loop.X_SC(context)) @ output(loop, context, "board.X_SC")
    return 1e3 * float(np.linalg.norm(X[:3, 3])), float(np.rad2deg(rotation_angle(X[:3, :3])))


def test_the_pose_is_the_station_s_own(loop: BoardLoop, context: Context) -> None:
    """Six objects hide markers; the camera's true place comes from the station document alone."""
    X_WC = loop.built.station.camera("board").X_WC.matrix()
    X_SC = inverse(loop.built.station.document.X_WS.matrix()) @ X_WC
    np.testing.assert_allclose(loop.X_SC(context), X_SC, atol=1e-12)
    seen = [errors(loop, context)]
    for view in ((0.8, 60, 200, 30), (0.7, 50, 300, -20), (1.0, 70, 120, 90)):
        loop.place_camera(context, looking(*view))
        seen.append(errors(loop, context))
    millimetres, degrees = np.transpose(seen)
    assert np.median(millimetres) < 0.5 and millimetres.max() < 1.0
    assert np.median(degrees) < 0.04 and degrees.max() < 0.1


def test_nothing_lags(loop: BoardLoop, context: Context) -> None:
    """The estimate is of this moment's image, and depends on nothing before it."""
    first = output(loop, context, "board.X_SC")
    overlay = output(loop, context, "overlay_image")
    before = loop.X_SC(context)
    loop.place_camera(context, looking(0.6, 75, 30, 15))
    assert np.linalg.norm(loop.X_SC(context)[:3, 3] - before[:3, 3]) > 0.2
    assert errors(loop, context)[0] < 1.0
    loop.place_camera(context, before)
    np.testing.assert_allclose(output(loop, context, "board.X_SC"), first, rtol=0, atol=1e-12)
    assert (output(loop, context, "overlay_image") == overlay).all()


def labels(loop: BoardLoop, context: Context) -> np.ndarray:
    """(H, W) which pixels show an instance, by Drake."""
    image = output(loop, context, "camera.board.label_image").squeeze()
    return np.isin(image, [int(i) for i in loop.built.free.values()])


def test_overlay_marks_the_places_not_the_objects(loop: BoardLoop, context: Context) -> None:
    """With everything carried off the board, what the overlay changes is where it should be."""
    targets = labels(loop, context)
    for name in loop.built.free:
        away = make_pose(p_AB=(0.0, 3.0, 0.0)) @ loop.built.scene.X_SO(name)
        loop.place_object(context, name, away)
    assert not labels(loop, context).any()
    plain = output(loop, context, "camera.board.color_image").astype(int)
    drawn = output(loop, context, "overlay_image").astype(int)
    assert drawn.shape == plain.shape
    changed = (np.abs(drawn - plain)[..., :3] > 8).any(axis=-1)
    near = binary_dilation(targets, iterations=5)  # lines are 2 pixels wide, and have a rim
    assert not (changed & ~near).any()
    inner = binary_erosion(targets, iterations=2)
    assert changed[inner].mean() > 0.99
    assert inner.sum() > 20_000


def test_outlines_are_on_the_edges_that_drake_renders(
    scene: Scene, station: Station, loop: BoardLoop, context: Context
) -> None:
    """Lines at the estimated pose against labels rendered four times as fine."""
    fine, of = 4, station.camera("board")
    center = tuple(fine * (c + 0.5) - 0.5 for c in of.principal_point)
    focal = (fine * of.focal[0], fine * of.focal[1])
    width, height = fine * of.width, fine * of.height
    camera = replace(of, width=width, height=height, focal=focal, center=center)
    document = replace(station.document, cameras={"fine": camera})
    built = build_station_diagram(
        scene, replace(station, document=document), robot="none", cameras=True
    )
    port = built.diagram.GetOutputPort("camera.fine.label_image")
    label = np.array(port.Eval(built.diagram.CreateDefaultContext()).data).squeeze()
    ids = [int(i) for i in built.free.values()]
    label = np.where(np.isin(label, ids), label, 0)
    # edges lie between pixels: middles and ends of their sides
    right = np.argwhere(label[:, 1:] != label[:, :-1]) + np.array([0.0, 0.5])
    below = np.argwhere(label[1:] != label[:-1]) + np.array([0.5, 0.0])
    along = np.array([-0.5, 0.0, 0.5])[:, None, None]
    edges = np.concatenate([*(right + along * (1.0, 0.0)), *(below + along * (0.0, 1.0))])

    X_SC = output(loop, context, "board.X_SC")
    lines = visible_lines(build_scene_mesh(scene), FieldOfView(loop.intrinsics), X_SC)
    middle = lines.ends[lines.kind == OUTLINE_KIND].mean(axis=1)
    column, row = (fine * (middle + 0.5) - 0.5).T
    inside = (column >= 0) & (row >= 0) & (column < width - 1) & (row < height - 1)
    at = np.stack([row[inside], column[inside]], axis=1)
    distance = KDTree(edges).query(at)[0] / fine  # in pixels of the camera
    assert len(distance) > 500
    assert np.median(distance) < 0.1
    assert np.quantile(distance, 0.95) < 0.25


def test_the_arm_hides_markers(scene: Scene, station: Station) -> None:
    """The arm reaches over the board: what Drake says it hides is not used, the pose is right."""
    loop = build_board_loop(scene, station, robot="arm", style=PLAIN)
    context = loop.diagram.CreateDefaultContext()
    plant = loop.built.plant
    loop.place_camera(context, looking(0.9, 60, 60, 0))
    mine = plant.GetMyMutableContextFromRoot(context)
    arm = plant.GetModelInstanceByName("arm")
    plant.SetPositions(mine, arm, [0.0, 0.3, 0.0, -2.0, 0.0, 2.3, 0.8])

    layout = scene.board.layout
    X_CS = inverse(loop.X_SC(context))
    pixels = loop.intrinsics.project(layout.p_SQ @ X_CS[:3, :3].T + X_CS[:3, 3])
    columns, rows = np.moveaxis(np.round(pixels).astype(int), -1, 0)
    label = output(loop, context, "camera.board.label_image").squeeze()[rows, columns]
    behind_arm = np.isin(label, [int(i) for i in loop.built.robot_bodies]).all(axis=1)
    hidden = set(layout.ids[behind_arm])
    assert 5 <= len(hidden) <= len(layout.ids) - 5

    estimate = loop.diagram.GetOutputPort("board.estimate").Eval(context)
    assert estimate.ids and not hidden & set(estimate.ids)
    millimetres, degrees = errors(loop, context)
    assert millimetres < 1.0 and degrees < 0.1


def test_without_a_pose_the_image_stays(loop: BoardLoop, context: Context) -> None:
    """A camera that looks at the sky: no error, and a line that says why."""
    loop.place_camera(context, make_pose(np.eye(3), (0.3, 0.2, 1.0)))
    assert output(loop, context, "board.valid") == [0.0]
    assert loop.diagram.GetOutputPort("board.estimate").Eval(context).reason
    drawn = output(loop, context, "overlay_image")
    plain = output(loop, context, "camera.board.color_image")
    assert drawn.shape == plain.shape
    same = (drawn == plain).all(axis=-1)
    assert 0.8 < same.mean() < 1.0


def test_images_at_a_rate(station: Station) -> None:
    """With a period the estimate stays until the next image, and then is of that one."""
    empty = SceneDocument(name="empty", library="household")
    scene = Scene(empty, load_scene("tabletop_six").library, Path("empty.yaml"))
    loop = build_board_loop(
        scene, station, LoopCamera(period=0.1, samples=1, depth=True), style=PLAIN
    )
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    first, second = looking(0.8, 70, 0, 0), looking(0.7, 60, 50, 10)
    loop.place_camera(context, first)
    simulator.AdvanceTo(0.15)
    assert errors(loop, context)[0] < 1.0
    held = output(loop, context, "board.X_SC")
    loop.place_camera(context, second)
    simulator.AdvanceTo(0.19)
    assert (output(loop, context, "board.X_SC") == held).all()
    simulator.AdvanceTo(0.25)
    assert errors(loop, context)[0] < 1.0


@pytest.mark.thorough
def test_with_a_filter(scene: Scene, station: Station, loop: BoardLoop, context: Context) -> None:
    """The overlay gets the filtered pose, which follows a moved camera at the second image."""
    filtered = build_board_loop(
        scene, station, style=PLAIN, filter=PoseFilter(period=0.02, patience=2)
    )
    simulator = Simulator(filtered.diagram)
    mine = simulator.get_mutable_context()
    before, after = loop.X_SC(context), looking(0.7, 60, 50, 10)
    simulator.AdvanceTo(0.01)
    filtered.place_camera(mine, after)
    assert errors(filtered, mine)[0] < 1.0
    for time, expected in ((0.03, before), (0.05, after)):
        simulator.AdvanceTo(time)
        X_SC = output(filtered, mine, "board.X_SC_filtered")
        assert np.linalg.norm(X_SC[:3, 3] - expected[:3, 3]) < 1e-3
    loop.place_camera(context, after)
    drawn = output(filtered, mine, "overlay_image").astype(int)
    assert np.abs(drawn - output(loop, context, "overlay_image")).mean() < 1.0


def test_a_filter_is_not_an_image_late(station: Station) -> None:
    """Images at a rate, and a filter of the same: it has the pose of the image that is held."""
    empty = SceneDocument(name="empty", library="household")
    scene = Scene(empty, load_scene("tabletop_six").library, Path("empty.yaml"))
    pose_filter = PoseFilter(period=0.1, patience=1)
    camera = LoopCamera(period=0.1, samples=1)
    loop = build_board_loop(scene, station, camera, style=PLAIN, filter=pose_filter)
    simulator = Simulator(loop.diagram)
    context = simulator.get_mutable_context()
    for k, roll in enumerate((0.0, 40.0, 80.0)):
        loop.place_camera(context, looking(0.8, 70, roll, 0))
        simulator.AdvanceTo(0.1 * k + 0.05)
        held, filtered = (output(loop, context, f"board.X_SC{end}") for end in ("", "_filtered"))
        assert errors(loop, context)[0] < 1.0
        assert np.abs(filtered - held).max() < 1e-9


def test_ports_of_the_station_are_there(loop: BoardLoop) -> None:
    inputs = {loop.diagram.get_input_port(i).get_name() for i in range(2)}
    assert inputs == {"applied_forces", "placement"}
    names = {
        loop.diagram.get_output_port(i).get_name() for i in range(loop.diagram.num_output_ports())
    }
    assert {"state", "body_poses", "geometry_query", "camera.overview.color_image"} <= names
    assert {"board.covariance", "board.reprojection_error", "overlay_image"} <= names


def test_bad_input(scene: Scene, station: Station, loop: BoardLoop, context: Context) -> None:
    with pytest.raises(UnknownNameError, match=r"'mgu'.*'mug'"):
        loop.place_object(context, "mgu", np.eye(4))
    with pytest.raises(UnknownNameError, match="has no camera 'bord'; did you mean 'board'"):
        build_board_loop(scene, station, "bord")
    with pytest.raises(InvalidInputError, match="samples of a camera is 0; it must be 1 to 8"):
        build_board_loop(scene, station, LoopCamera(samples=0))
    with pytest.raises(InvalidInputError, match=r"period.*0 s"):
        LoopCamera(period=0.0)
    tiny = replace(scene, document=replace(scene.document, board=Board(size=(0.03, 0.03))))
    with pytest.raises(InvalidInputError, match="do not fit on a board of 30 x 30 mm"):
        build_board_loop(tiny, station)


@pytest.mark.thorough
def test_camera_of_another_resolution(scene: Scene, station: Station) -> None:
    camera = Camera(
        X_WC=Pose.from_matrix(station.document.X_WS.matrix() @ looking(0.8, 65, 40, 0)),
        width=640,
        height=360,
        focal=(500.0, 505.0),
        center=(315.0, 182.5),
    )
    document = replace(station.document, cameras={"wide": camera})
    loop = build_board_loop(scene, replace(station, document=document), "wide", style=PLAIN)
    context = loop.diagram.CreateDefaultContext()
    millimetres, degrees = errors(loop, context)
    assert millimetres < 0.6 and degrees < 0.04
    assert output(loop, context, "overlay_image").shape == (360, 640, 4)
