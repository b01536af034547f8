"""What the setup page can do, function by function, on a page that no browser draws."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from burg_drake.compose import AddObject, ComposeSession, MoveObjects, SetBoard, instance_bounds
from burg_drake.core import make_pose, quaternion_from_rotation, rot_z, rotation_from_quaternion
from burg_drake.scene import Board, load_scene, validate_scene
from burg_drake.station import load_station
from burg_drake.ui import (
    FRONT_FOV,
    STATUS_STYLES,
    ObjectPictures,
    ServedPage,
    SetupPage,
    direction_to_camera,
    serve_page,
    sheet_picture,
    viewpoint,
)
from tests.hang_guard import HANG_GUARD, until
from tests.ui.page_client import PageClient

FILL, BOARD, DISPLAY, GRASPS = "Random configuration", "Board", "Display", "Grasps"
REACH, BACKDROP = "Reach", "Real board"
UPRIGHT = "Keep upright"
ARROWS, RINGS = "/gizmo/arrows", "/gizmo/rings"


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[SetupPage, ServedPage]]:
    """A page for all tests, without the library's pictures, which take a process of their own."""
    folder = tmp_path_factory.mktemp("scenes")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ObjectPictures, "get", lambda self, name, stable_pose=None: None)
        session = ComposeSession.open("household", load_station("panda_tabletop"), folder=folder)
        with session, serve_page(port=0) as door:
            page = SetupPage(door.server, session)
            yield page, door
            page.close()


@pytest.fixture
def page(opened: tuple[SetupPage, ServedPage]) -> SetupPage:
    """The page on a new scene."""
    page, _ = opened
    page.actions.session.new("household", discard=True)
    page.actions.session.restrict_movement(True)
    assert page.actions.queue.idle(HANG_GUARD)
    return page


@pytest.fixture
def session(page: SetupPage) -> ComposeSession:
    return page.actions.session


@pytest.fixture
def client(page: SetupPage, opened: tuple[SetupPage, ServedPage]) -> Iterator[PageClient]:
    with PageClient(opened[1]) as client:
        yield client


def test_a_page_has_the_stated_view_whatever_it_shows_while_it_loads(
    page: SetupPage, session: ComposeSession, client: PageClient
) -> None:
    """A page puts the server's first view over the one that it was given as late as it likes."""

    def given(aspect: float) -> bool:
        position, target = viewpoint(
            session.view.document.board, direction_to_camera(above=False), FRONT_FOV, aspect
        )
        camera = client.camera
        return np.allclose([camera["position"], camera["look_at"]], [position, target], atol=1e-6)

    until(lambda: given(640 / 480), "the stated view")
    client.report_camera(position=client.first_view)  # before the page has applied it
    until(lambda: given(640 / 480), "the stated view again")
    client.report_camera()
    client.report_camera(position=client.first_view)  # after that
    until(lambda: given(640 / 480), "the stated view after it had arrived")
    client.report_camera(image_width=480, position=client.first_view)  # panels have come
    until(lambda: given(1.0), "the stated view of a narrower scene")
    client.report_camera()
    client.report_camera(image_width=400)
    until(lambda: given(400 / 480), "the stated view of an even narrower one")
    client.report_camera()
    views = page._views._assigned
    client.report_camera(position=[0.3, -0.5, 0.4])
    until(lambda: not views, "that somebody has moved the camera")
    client.press("F")
    until(lambda: given(400 / 480), "the view from the front, which was asked for")


@pytest.mark.thorough
def test_a_random_configuration_is_one_step(session: ComposeSession, client: PageClient) -> None:
    empty = session.do(SetBoard(Board()))
    client.give(FILL, "Objects", 4)
    client.give(FILL, "Layout", "close")
    client.click(FILL, "Shuffle")
    until(lambda: session.view.instances, "objects on the board")
    filled = session.view
    assert len(filled.instances) == 4 and set(filled.status.values()) == {"ok"}
    path = session.save("filled").path
    assert path is not None
    scene = load_scene(path)
    assert scene.document == session.view.document
    assert validate_scene(scene) == ()
    until(lambda: client.value(FILL, "Seed") == 2, "the seed of the next one")
    until(lambda: all(f"/objects/{n}" in client.nodes for n in filled.instances), "all are shown")

    client.give(FILL, "Objects", 0)
    client.give(FILL, "Layout", "random")
    client.click(FILL, "Shuffle")
    until(lambda: session.view.document != scene.document, "other places")
    assert set(session.view.instances) == set(scene.instances)
    client.press("Z", "cmd/ctrl")
    until(lambda: session.view.document == scene.document, "the places before")
    client.press("Z", "cmd/ctrl")
    until(lambda: not session.view.instances, "an empty board")
    assert session.view.document.instances == empty.document.instances
    assert session.view.undo_label == "change board"
    until(lambda: not any(n.startswith("/outlines/") for n in list(client.nodes)), "none is shown")

    client.give(FILL, "Objects", 60)
    client.click(FILL, "Shuffle")
    until(lambda: client.told, "a word")
    assert "That cannot be done: 60 different objects were asked for" in client.told[0]
    assert not session.view.instances


def test_the_board_has_the_size_that_was_chosen(
    page: SetupPage, session: ComposeSession, client: PageClient
) -> None:
    until(lambda: client.value(BOARD, "Size") == "A3", "the size of a new scene")

    def saved() -> tuple[float, float]:
        path = session.save("board", overwrite=True).path
        assert path is not None
        return load_scene(path).board.size

    client.give(BOARD, "Size", "A2")
    until(lambda: session.view.document.board.size == (0.594, 0.42), "A2")
    assert saved() == (0.594, 0.42)
    client.give(BOARD, "Lies", "upright")
    until(lambda: session.view.document.board.size == (0.42, 0.594), "A2 upright")
    assert page.actions.queue.idle(HANG_GUARD)
    busy = threading.Event()  # what is chosen meanwhile waits, and is not lost
    page.actions.submit(lambda: busy.wait(HANG_GUARD))
    page.actions.submit(page._refresh, wait_for_typing=True)
    client.give(BOARD, "Lies", "across")
    until(lambda: page._board_panel._orientation.value == "across", "the choice has arrived")
    busy.set()
    until(lambda: session.view.document.board.size == (0.594, 0.42), "A2 across")

    client.give(BOARD, "Size", "own size")
    until(lambda: client.shown(BOARD, "Width, depth [mm]"), "fields for one's own size")
    assert client.value(BOARD, "Width, depth [mm]") == [594.0, 420.0]
    client.give(BOARD, "Width, depth [mm]", [500.0, 312.5])
    client.press("enter", "alt+shift")
    until(lambda: session.view.document.board.size == (0.5, 0.3125), "one's own size")
    assert saved() == (0.5, 0.3125)
    client.press("Z", "cmd/ctrl")
    until(lambda: session.view.document.board.size == (0.594, 0.42), "undone")
    client.give(BOARD, "Size", "A4")
    until(lambda: session.view.document.board.size == (0.297, 0.21), "A4")
    until(lambda: not client.shown(BOARD, "Width, depth [mm]"), "no fields")


@pytest.mark.thorough
def test_objects_have_the_colours_that_were_chosen(
    session: ComposeSession, client: PageClient
) -> None:
    names = ("box", "can", "mug")
    session.do(SetBoard(Board()))
    for name in names:
        session.do(AddObject(name))
    onto = session.view.X_SO("can")
    onto[:2, 3] = session.view.X_SO("box")[:2, 3]
    session.do(MoveObjects({"can": onto}))
    assert session.view.status == {"box": "collision", "can": "collision", "mug": "ok"}

    def colors() -> list[tuple[int, ...] | None]:
        """Of what can be seen; None for objects as they look."""
        seen = []
        for name in names:
            look = client.nodes.get(f"/objects/{name}/look", {})
            tint = client.nodes.get(f"/objects/{name}/tint", {})
            if look.get("visible") is not (not tint.get("visible")):
                return []  # not drawn yet, or twice
            seen.append(None if look["visible"] else tuple(tint["color"]))
        return seen

    until(lambda: colors() == [None] * 3, "as they look")
    client.give(DISPLAY, "Objects", "by status")
    red, green = STATUS_STYLES["collision"].color, STATUS_STYLES["ok"].color
    until(lambda: colors() == [red, red, green], "by status")
    session.undo()
    until(lambda: colors() == [green] * 3, "apart")
    client.press("C")
    until(lambda: len(set(colors()) - {red, green, None}) == 3, "a colour each")
    assert client.value(DISPLAY, "Objects") == "random"
    client.press("C")
    until(lambda: colors() == [None] * 3, "as they look")


@pytest.mark.thorough
def test_grasps_are_counted_again_after_a_move(session: ComposeSession, client: PageClient) -> None:
    session.do(AddObject("can", stable_pose=0, position=(0.12, 0.15)))
    session.do(AddObject("mug", stable_pose=0, position=(0.3, 0.15)))

    def counted() -> bool:
        view = session.view
        return view.grasps_revision == view.revision and "Counting" not in client.text(GRASPS)

    client.give(GRASPS, "Count grasps", True)
    until(counted, "counts")
    apart = session.view.grasps
    assert set(apart) == {"can", "mug"} and "can" not in apart["mug"].in_the_way
    assert apart["mug"].reachable is not None and 0 < apart["mug"].reachable <= apart["mug"].clear
    session.do(MoveObjects({"can": session.view.X_SO("mug") @ make_pose(p_AB=(0.0, -0.09, 0.0))}))
    until(counted, "counts beside the mug")
    beside = session.view.grasps
    assert beside["mug"].in_the_way["can"] > 0 and beside["mug"].clear < apart["mug"].clear
    blocked = f"can {beside['mug'].in_the_way['can']}"
    until(lambda: blocked in client.text(GRASPS), "what is in the way of the mug")
    client.give(GRASPS, "Count grasps", False)
    until(lambda: client.text(GRASPS) == "", "no counts")


def test_reach_is_laid_on_the_board_and_taken_away(
    session: ComposeSession, client: PageClient
) -> None:
    layer = "/layers/reach"
    session.do(SetBoard(Board(size=(0.2, 0.15))))
    assert not client.shown(REACH, "Height [mm]")
    client.give(REACH, "Arm's reach", True)
    until(lambda: layer in client.nodes, "a layer")
    sheet = client.nodes[layer]
    assert (sheet["render_width"], sheet["render_height"]) == (0.2, 0.15)
    until(lambda: "reaches 100% of the board" in client.text(REACH), "how much is reached")
    client.give(REACH, "Height [mm]", 950.0)
    client.press("enter", "alt+shift")
    until(lambda: "reaches 0% of the board" in client.text(REACH), "nothing is reached up there")
    assert layer in client.nodes
    client.give(REACH, "Arm's reach", False)
    until(lambda: layer not in client.nodes, "no layer")
    until(lambda: client.text(REACH) == "", "no words")


@pytest.mark.thorough
def test_a_photo_of_the_board_is_laid_under_the_objects(
    session: ComposeSession, client: PageClient
) -> None:
    layer = "/layers/backdrop"
    board = session.view.document.board
    sheet = sheet_picture(board)
    height, width = sheet.shape[:2]
    edges = np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float32)
    corners = np.array([[300, 250], [1100, 180], [1200, 720], [180, 800]], dtype=np.float32)
    H = cv2.getPerspectiveTransform(edges, corners)
    photo = cv2.warpPerspective(sheet, H, (1400, 950), flags=cv2.INTER_AREA, borderValue=(90,) * 3)
    _, png = cv2.imencode(".png", photo)
    client.upload(BACKDROP, "Photo of the board", "photo.png", png.tobytes())
    until(lambda: layer in client.nodes, "the photo")
    laid = client.nodes[layer]
    assert laid["render_width"] >= board.size[0] and laid["render_height"] >= board.size[1]
    assert f"photo.png: {len(board.layout.ids)} markers, off by 0." in client.text(BACKDROP)

    def alpha() -> int:
        data = client.nodes.get(layer, {}).get("_data", b"")
        return int(np.array(Image.open(io.BytesIO(data)))[..., 3].max()) if data else -1

    assert alpha() == round(0.8 * 255)
    client.give(BACKDROP, "Opacity", 0.4)
    until(lambda: alpha() == round(0.4 * 255), "a fainter photo")
    client.upload(BACKDROP, "Photo of the board", "note.png", b"no picture")
    until(lambda: client.told, "a word")
    assert "note.png cannot be read as an image; give PNG or JPEG" in client.told[0]
    assert layer in client.nodes
    client.click(BACKDROP, "Remove the picture")
    until(lambda: layer not in client.nodes, "no photo")


def test_handles_move_and_tilt_what_is_free(
    page: SetupPage, session: ComposeSession, client: PageClient
) -> None:
    session.do(AddObject("box", position=(0.15, 0.15)))
    start = session.do(AddObject("can", position=(0.3, 0.15)))
    client.give("", UPRIGHT, False)

    def shown(node: str) -> bool:
        return bool(client.nodes.get(node, {}).get("visible"))

    until(lambda: shown(ARROWS) and shown(RINGS), "handles")
    session.select(["box", "can"])
    middle = np.mean([_middle(session, name) for name in ("box", "can")], axis=0)
    for node in (ARROWS, RINGS):
        until(lambda n=node: np.allclose(client.nodes[n]["position"], middle), "between the two")

    lifted = make_pose(p_AB=middle + np.array([0.02, 0.01, 0.2]))
    R = rot_z(0.5) @ np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    turned = make_pose(R, middle)

    def pose(X_SG: np.ndarray) -> dict[str, list[float]]:
        wxyz = quaternion_from_rotation(X_SG[:3, :3]).tolist()
        return {"wxyz": wxyz, "position": X_SG[:3, 3].tolist()}

    client.drag_handles(ARROWS, "Start")
    client.drag_handles(ARROWS, "Update", **pose(lifted))
    until(lambda: session.view.dragging == ("box", "can"), "both are held")
    until(lambda: session.view.X_SO("can")[2, 3] > 0.1, "lifted")
    until(lambda: np.allclose(client.nodes[RINGS]["position"], lifted[:3, 3]), "rings follow")
    client.press("escape")
    until(lambda: not session.view.dragging, "put back")
    assert session.view.document == start.document

    client.drag_handles(ARROWS, "End")
    handles = page._gizmo._arrows.node  # the page that dragged is told where they are only then
    assert handles is not None
    until(lambda: np.allclose(handles.position, middle), "handles are back")
    for node, X_SG in ((ARROWS, lifted), (RINGS, turned)):
        client.drag_handles(node, "Start")
        client.drag_handles(node, "Update", **pose(X_SG))
        client.drag_handles(node, "End")
        until(lambda: session.view.undo_label == "move box and can", "one step")
        for name in ("box", "can"):
            expected = X_SG @ make_pose(p_AB=-middle) @ start.X_SO(name)
            np.testing.assert_allclose(session.view.X_SO(name), expected, atol=2e-5)
        assert session.undo().document == start.document
        assert page.actions.queue.idle(HANG_GUARD)


def test_arrows_are_the_boards_and_rings_the_objects_until_a_key_switches(
    session: ComposeSession, client: PageClient
) -> None:
    """A marble that has rolled by 110 degrees, as the library's stable pose has it."""
    session.do(AddObject("marble", position=(0.2, 0.15)))
    session.restrict_movement(False)
    R_SO = session.view.X_SO("marble")[:3, :3]
    assert R_SO[2, 2] < 0.0

    def axes(node: str) -> np.ndarray:
        wxyz = client.nodes.get(node, {}).get("wxyz", (1.0, 0.0, 0.0, 0.0))
        return rotation_from_quaternion(wxyz)

    until(lambda: np.allclose(axes(RINGS), R_SO, atol=1e-6), "rings about the marble's axes")
    assert np.allclose(axes(ARROWS), np.eye(3))
    client.press("X")
    until(lambda: np.allclose(axes(ARROWS), R_SO, atol=1e-6), "arrows along the marble's axes")
    client.press("X")
    until(lambda: np.allclose(axes(ARROWS), np.eye(3)), "arrows along the board's axes")


def test_what_is_kept_upright_is_raised_by_its_arrow_by_keys_and_by_a_number(
    session: ComposeSession, client: PageClient
) -> None:
    start = session.do(AddObject("can", position=(0.2, 0.15))).X_SO("can")
    until(lambda: client.nodes.get(ARROWS, {}).get("visible"), "an arrow")
    assert client.nodes[ARROWS]["active_axes"] == [False, False, True]
    right = instance_bounds(session.view.state, "can")[1, 0]
    assert client.nodes[ARROWS]["position"][0] > right  # from above it must not cover the can
    up = {"position": np.add(client.nodes[ARROWS]["position"], (0.0, 0.0, 0.05)).tolist()}
    client.drag_handles(ARROWS, "Start")
    client.drag_handles(ARROWS, "Update", wxyz=[1.0, 0.0, 0.0, 0.0], **up)
    client.drag_handles(ARROWS, "End")
    raised = start.copy()
    raised[2, 3] += 0.05
    until(lambda: np.allclose(session.view.X_SO("can"), raised, atol=2e-6), "raised")
    label = "/heights/can/label"
    until(lambda: client.nodes.get(label, {}).get("text") == "50.0 mm", "how high it is")
    until(lambda: "/heights/can" in client.nodes, "a line")
    middle = instance_bounds(session.view.state, "can").mean(axis=0)
    np.testing.assert_allclose(client.nodes[label]["position"], (*middle[:2], 0.025), atol=1e-4)
    client.press("pagedown")
    until(lambda: client.nodes.get(label, {}).get("text") == "45.0 mm", "lower")
    client.give("", "x, y, z [mm]", (1e3 * start[:3, 3]).round(2).tolist())
    client.press("enter", "alt+shift")
    until(lambda: label not in client.nodes, "it stands")


def test_clearing_the_scene_is_asked_first(session: ComposeSession, client: PageClient) -> None:
    session.do(AddObject("can"))
    until(lambda: client.shown(FILL, "Clear scene"), "a button")
    client.click(FILL, "Clear scene")
    until(lambda: "Clear the scene?" in client.told, "a question")
    assert "1 object off" in client.text("") and list(session.view.instances) == ["can"]
    client.click("", "Clear it")
    until(lambda: not session.view.instances, "an empty board")
    assert list(session.undo().instances) == ["can"]


def test_messages_make_room_for_newer_ones(page: SetupPage, client: PageClient) -> None:
    for line in ("one", "two", "two", "three", "four"):
        page.actions.show_message(None, line)
    until(lambda: "Done: four" in client.told, "the last")
    assert sorted(client.notes.values()) == ["Done: four", "Done: three", "Done: two"]


def _middle(session: ComposeSession, name: str) -> np.ndarray:
    """(3,) of an instance's bounds in S [m]."""
    entry, X_SO = session.view.state.entry(name), session.view.X_SO(name)
    return X_SO[:3, :3] @ np.add(entry.lower, entry.upper) / 2.0 + X_SO[:3, 3]


def test_the_library_of_the_scene_is_the_one_that_is_chosen(client: PageClient) -> None:
    assert client.options("Load", "Library") == ["clutter", "household"]
    assert client.value("Load", "Library") == "household"


def test_a_scene_that_cannot_be_opened_leaves_the_open_one(
    session: ComposeSession, client: PageClient, tmp_path: Path
) -> None:
    session.do(AddObject("mug"))
    before = session.save("breakfast")
    assert before.path is not None
    text = before.path.read_text()
    before.path.with_name("strange.yaml").write_text(text.replace("object: mug", "object: mugg"))
    session.select(())
    until(lambda: "strange" in client.options("Load", "Scene"), "it is offered")
    client.give("Load", "Scene", "strange")
    client.click("Load", "Load scene")
    until(lambda: client.told, "a word")
    assert "strange.yaml: instances[0]: " in client.told[0] and "'mugg'" in client.told[0]
    assert session.view.document == before.document and session.view.path == before.path
    session.do(AddObject("can"))
    assert session.save().saved
