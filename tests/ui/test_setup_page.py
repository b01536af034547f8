"""The setup page in a real browser, by real mouse and keys; what counts is the session, and the
file that it writes."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml

from burg_drake.compose import AddObject, ComposeSession, MoveObjects, SessionView, SetBoard
from burg_drake.core import rotation_from_quaternion
from burg_drake.scene import Board
from burg_drake.station import load_station
from burg_drake.ui import PageCamera, ServedPage, SetupPage, serve_page
from tests.hang_guard import until
from tests.ui.conftest import open_page

ONE_TRY = 0.7
UNDER_POINTER = """([x, y]) => {
  const element = document.elementFromPoint(x, y);
  return element?.closest(".mantine-Notifications-root") ? "MESSAGE" : element?.tagName;
}"""


@dataclass
class Setup:
    """A session, the page on it, and a browser's tab that has it open."""

    session: ComposeSession
    page: SetupPage
    door: ServedPage
    tab: Any

    @property
    def view(self) -> SessionView:
        return self.session.view

    def open(self) -> None:
        """Opens the page, and waits until it shows the view that it was given."""
        self.tab.goto(self.door.url)
        self.tab.locator("[data-dock-region-collapse=right]").wait_for()
        until(self.has_view, "the stated view on a page that is complete")

    def has_view(self) -> bool:
        """Whether the newest page has reported the view that was given for its canvas of now."""
        clients = self.door.server.get_clients()
        given = self.page._views._assigned.get(max(clients, default=0))
        if given is None or not given.arrived:
            return False
        box = self.tab.locator("canvas").first.bounding_box()
        return abs(given.aspect - box["width"] / box["height"]) < 0.01

    def on_screen(self, p_SQ: Any) -> tuple[float, float]:
        """Where a point of the scene is on the tab [pixel]."""
        client = list(self.door.server.get_clients().values())[-1]
        box = self.tab.locator("canvas").first.bounding_box()
        x, y = PageCamera.from_viser(client.camera).project(p_SQ)[0]
        return float(box["x"] + x * box["width"]), float(box["y"] + y * box["height"])

    def middle(self, name: str) -> Any:
        """(3,) middle of an instance's bounds in S [m]."""
        entry = self.view.state.entry(name)
        X_SO = self.view.X_SO(name)
        return X_SO[:3, :3] @ (np.add(entry.lower, entry.upper) / 2.0) + X_SO[:3, 3]

    def drag(self, name: str, offset: Any, key: str | None = None) -> None:
        """Drags an instance by an offset (3,) in S with the mouse, and holds it there.

        A press that comes before the browser has drawn the object takes hold of nothing: then it
        is tried again.
        """
        mouse, start = self.tab.mouse, self.middle(name)
        x, y = self.on_screen(start)
        if key:
            self.tab.keyboard.down(key)
        for _ in range(20):
            mouse.move(x, y)
            mouse.down()
            mouse.move(x + 6, y)
            mouse.move(x + 8, y)
            try:
                until(lambda: self.view.dragging, f"hold of {name}", seconds=ONE_TRY)
                break
            except AssertionError:
                mouse.up()
        mouse.move(*self.on_screen(start + offset), steps=3)

    def let_go(self, key: str | None = None) -> None:
        self.tab.mouse.up()
        if key:
            self.tab.keyboard.up(key)
        until(lambda: not self.view.dragging, "let go")

    def click(self, name: str) -> None:
        """Presses a button, of which there is one of that name."""
        self.tab.get_by_role("button", name=name, exact=True).click()

    def field(self, label: str, which: int = -1) -> Any:
        """An input of a label, of those that can be seen; the last if nothing is said."""
        row = f"//label[normalize-space()='{label}']/ancestor::div[.//input][1]//input"
        return self.tab.locator(f"xpath={row}").locator("visible=true").nth(which)

    def fill(self, label: str, text: str, which: int = -1) -> None:
        """Types into a field."""
        self.field(label, which).fill(text)

    def value(self, label: str) -> str:
        """What stands in a field."""
        return str(self.field(label).input_value())

    def tab_of(self, name: str) -> None:
        """Brings a tab of the panel to the front."""
        self.tab.get_by_text(name, exact=True).first.click()


@contextlib.contextmanager
def open_setup(tab: Any, folder: Path) -> Iterator[Setup]:
    session = ComposeSession.open("household", load_station("panda_tabletop"), folder=folder)
    with serve_page(port=0) as door:
        page = SetupPage(door.server, session)
        yield Setup(session, page, door, tab)
        page.close()


@pytest.fixture(scope="module")
def opened(browser: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Setup]:
    """A page in a tab, both for all tests that need none of their own: loading it takes longer than
    most of what they do."""
    with (
        open_page(browser, {"width": 1120, "height": 640}) as tab,
        open_setup(tab, tmp_path_factory.mktemp("scenes")) as setup,
    ):
        setup.open()
        yield setup


@pytest.fixture
def setup(opened: Setup) -> Setup:
    """The page on a new scene, seen from the front."""
    opened.session.new("household", discard=True)
    opened.session.restrict_movement(True)
    opened.tab_of("Object")
    until(lambda: len(opened.door.server.get_clients()) == 1, "no other page")
    (client,) = opened.door.server.get_clients().values()
    opened.page._views.set_view(client, above=False)
    until(lambda: opened.page.actions.queue.idle(0.1), "nothing left to do")
    until(opened.has_view, "the view from the front")
    return opened


@pytest.fixture
def setup_alone(page: Any, tmp_path: Path) -> Iterator[Setup]:
    """A page of one's own, that is not opened yet."""
    page.set_viewport_size({"width": 1120, "height": 640})
    with open_setup(page, tmp_path) as setup:
        yield setup


@pytest.mark.thorough
def test_a_scene_is_composed_checked_and_saved(setup: Setup) -> None:
    setup.click("box")
    until(lambda: "box" in setup.view.instances, "a box")
    before = setup.view.X_SO("box")

    setup.drag("box", np.array([-0.15, 0.03, 0.0]))
    until(lambda: setup.view.X_SO("box")[0, 3] < before[0, 3] - 0.11, "the box has moved")
    setup.let_go()
    moved = setup.view.X_SO("box")
    # the pointer takes hold of the standing box's top, nearer to the camera than its middle
    np.testing.assert_allclose(moved[:3, 3] - before[:3, 3], [-0.15, 0.03, 0.0], atol=0.025)
    np.testing.assert_allclose(moved[:3, :3], before[:3, :3], atol=1e-6)

    setup.tab.keyboard.press("Control+z")
    until(lambda: np.array_equal(setup.view.X_SO("box"), before), "undone")
    setup.tab.keyboard.press("Control+Shift+z")
    until(lambda: np.array_equal(setup.view.X_SO("box"), moved), "done again")

    setup.click("can")
    until(lambda: "can" in setup.view.instances, "a can")
    setup.drag("can", setup.middle("box") - setup.middle("can"))
    until(lambda: setup.view.status["can"] == "collision", "a collision is seen while dragging")
    assert setup.view.dragging == ("can",)
    setup.tab.get_by_text("in collision").first.wait_for()
    setup.let_go()
    setup.tab.keyboard.press("Control+z")
    until(lambda: setup.view.status["can"] == "ok", "apart again")

    assert setup.view.selection == ("can",)
    setup.tab.get_by_role("button", name="%").nth(1).click()
    up_O = setup.view.state.entry("can").stable_poses[1].X_SO.matrix()[2, :3]
    until(lambda: np.allclose(setup.view.X_SO("can")[2, :3], up_O, atol=1e-4), "another pose")

    setup.tab_of("Scene")
    setup.fill("Name", "breakfast")
    setup.click("Save scene")
    until(lambda: setup.view.saved, "saved")
    document = yaml.safe_load((Path(setup.session.folder) / "breakfast.yaml").read_text())
    assert document["name"] == "breakfast"
    assert [i["object"] for i in document["instances"]] == ["box", "can"]
    np.testing.assert_allclose(
        document["instances"][0]["X_SO"]["translation"], moved[:3, 3], atol=1e-6
    )
    with setup.tab.expect_download() as download:
        setup.click("Save printout")
    assert Path(download.value.path()).read_bytes().startswith(b"%PDF")

    setup.click("Clear scene")
    setup.click("Clear it")
    until(lambda: not setup.view.instances, "an empty board")
    setup.click("Load scene")
    setup.click("Discard them")
    until(lambda: setup.view.saved, "loaded")
    assert list(setup.view.instances) == ["box", "can"]


@pytest.mark.thorough
def test_two_pages_show_the_same_and_come_back_after_a_kill(
    setup_alone: Setup, tmp_path: Path
) -> None:
    setup = setup_alone
    setup.open()
    with setup.tab.context.new_page() as other:
        other.goto(setup.door.url)
        setup.click("box")
        other.get_by_text("1 ok").wait_for()

    setup.fill("Name", "box/2")  # refused, and the field says again what is so
    setup.tab.get_by_text("That cannot be done").wait_for()
    until(lambda: setup.value("Name") == "box", "the name is set back")
    setup.fill("x, y, z [mm]", "180", 1)
    until(lambda: setup.view.X_SO("box")[1, 3] == 0.18, "moved by a number")
    setup.session.restrict_movement(False)
    X_SO = setup.view.X_SO("box")
    X_SO[2, 3] += 0.05
    setup.session.do(MoveObjects({"box": X_SO}))
    setup.tab_of("Check")
    setup.tab.get_by_text("hovers").wait_for()
    setup.click("Settle in physics")
    setup.click("Accept")
    until(lambda: abs(setup.view.X_SO("box")[2, 3] - X_SO[2, 3] + 0.05) < 1e-3, "settled")

    before = setup.view.document
    port = setup.door.port
    setup.page.close()
    setup.door.close()
    setup.session.close()  # nothing was saved
    with (
        ComposeSession.open("household", setup.session.station, folder=tmp_path) as session,
        serve_page(port=port) as door,
    ):
        page = SetupPage(door.server, session)
        assert session.view.document == before
        until(door.server.get_clients, "the tab that is still open has come back")
        setup.tab.get_by_text("recovered the unsaved changes").wait_for()
        setup.tab.get_by_text("1 ok").wait_for()
        page.close()


def test_the_mouse_selects_and_keys_change_what_is_selected(setup: Setup) -> None:
    setup.session.do(AddObject("box", stable_pose=0, position=(0.1, 0.1)))
    setup.session.do(AddObject("can", position=(0.3, 0.2)))
    setup.session.select(())
    keys, mouse = setup.tab.keyboard, setup.tab.mouse

    def select(name: str, selection: tuple[str, ...]) -> None:
        """Clicks an object until it is drawn, and takes the click."""
        before = setup.view.selection
        for _ in range(20):
            mouse.click(*setup.on_screen(setup.middle(name)))
            try:
                until(lambda: setup.view.selection != before, f"click on {name}", seconds=ONE_TRY)
                break
            except AssertionError:
                continue
        assert setup.view.selection == selection

    select("box", ("box",))
    keys.down("Control")
    select("can", ("box", "can"))
    select("box", ("can",))
    keys.up("Control")
    mouse.click(*setup.on_screen((0.05, 0.25, 0.0)))
    until(lambda: not setup.view.selection, "nothing is selected beside objects")
    keys.down("Shift")
    mouse.move(*setup.on_screen((0.02, 0.28, 0.0)))
    mouse.down()
    mouse.move(*setup.on_screen((0.4, 0.02, 0.0)), steps=4)
    mouse.up()
    keys.up("Shift")
    until(lambda: setup.view.selection == ("box", "can"), "all in a rectangle")

    keys.press("Control+d")
    until(lambda: setup.view.selection == ("box_2", "can_2"), "copies")
    keys.press("Delete")
    until(lambda: list(setup.view.instances) == ["box", "can"], "no copies")
    keys.press("Control+a")
    until(lambda: setup.view.selection == ("box", "can"), "all")
    keys.press("Escape")
    until(lambda: not setup.view.selection, "none")

    setup.session.select(("can",))
    setup.session.restrict_movement(False)
    start = setup.view.X_SO("can")
    keys.press("ArrowRight")
    keys.press("Shift+ArrowUp")
    offset = np.array([0.005, 0.001, 0.0])
    until(
        lambda: np.allclose(setup.view.X_SO("can")[:3, 3], start[:3, 3] + offset, atol=2e-6),
        "moved by keys",
    )
    keys.press("h")
    dialog = setup.tab.get_by_role("dialog")
    dialog.get_by_text("Ctrl+click").wait_for()
    keys.press("Escape")
    dialog.wait_for(state="hidden")


def press_until_held(setup: Setup, x: float, y: float, direction: tuple[float, float]) -> None:
    """Presses at a place of the tab and moves a little, until something is held there."""
    mouse = setup.tab.mouse
    for _ in range(20):
        mouse.move(x, y)
        mouse.down()
        for step in (6, 9, 12):
            mouse.move(x + step * direction[0], y + step * direction[1])
        try:
            until(lambda: setup.view.dragging, "hold", seconds=ONE_TRY)
            return
        except AssertionError:
            mouse.up()


def test_an_arrow_over_another_object_moves_what_is_selected(setup: Setup) -> None:
    """The can stands behind the box, so that the can's arrow along x is drawn over the box; what
    counts is who moves and along which axis, whatever the browser takes hold of."""
    setup.session.do(SetBoard(Board(size=(0.594, 0.42))))
    setup.session.do(AddObject("can", position=(0.25, 0.3)))
    setup.session.do(AddObject("box", stable_pose=0, position=(0.3, 0.22)))
    setup.session.select(("can",))
    setup.session.restrict_movement(False)
    until(lambda: setup.page.actions.queue.idle(0.1), "the larger board")
    until(setup.has_view, "all of the larger board")
    start, box = setup.view.X_SO("can"), setup.view.X_SO("box")
    middle = setup.middle("can")
    over = middle + np.array([0.095, 0.0, 0.0])  # beyond the rings
    until(lambda: nearest_object(setup, over) == "box", "the camera sees the box before the arrow")
    (x, y), (x1, y1) = setup.on_screen(over), setup.on_screen(over + np.array([0.1, 0.0, 0.0]))
    length = np.hypot(x1 - x, y1 - y)
    press_until_held(setup, x, y, ((x1 - x) / length, (y1 - y) / length))
    assert setup.view.dragging == ("can",)
    setup.tab.mouse.move(x1, y1, steps=3)
    until(lambda: setup.view.X_SO("can")[0, 3] > start[0, 3] + 0.09, "the can has moved")
    setup.let_go()
    moved = setup.view.X_SO("can")
    np.testing.assert_allclose(moved[1:3, 3], start[1:3, 3], atol=2e-6)
    assert abs(moved[0, 3] - start[0, 3] - 0.1) < 5e-3
    assert np.array_equal(setup.view.X_SO("box"), box) and setup.view.selection == ("can",)


def nearest_object(setup: Setup, p_SQ: Any) -> str | None:
    """The instance that a ray from the camera through a point meets first, by trimesh; None if it
    meets none, as while the camera still moves."""
    camera = next(iter(setup.door.server.get_clients().values())).camera
    ray = np.subtract(p_SQ, camera.position)
    first = {}
    for name, instance in setup.view.instances.items():
        mesh = setup.view.library.surface(instance.object)
        mesh.apply_transform(setup.view.X_SO(name))
        hits, _, _ = mesh.ray.intersects_location([camera.position], [ray])
        if len(hits):
            first[name] = float(np.linalg.norm(hits - camera.position, axis=1).min())
    return min(first, key=lambda name: first[name], default=None)


def test_turning_with_shift_keeps_the_selection(setup: Setup) -> None:
    setup.session.do(AddObject("box", stable_pose=0, position=(0.1, 0.15)))
    setup.session.do(AddObject("can", position=(0.3, 0.15)))
    setup.session.select(("box", "can"))
    setup.drag("can", np.zeros(3))  # until it is drawn: what is not there, Shift takes no hold of
    setup.let_go()
    before = setup.view.X_SO("can")
    setup.drag("can", np.array([0.02, -0.06, 0.0]), key="Shift")
    until(lambda: not np.allclose(setup.view.X_SO("can"), before), "turned")
    setup.let_go(key="Shift")
    setup.tab.keyboard.press("PageUp")  # it comes after whatever the page says of the rectangle
    until(lambda: setup.view.X_SO("can")[2, 3] > before[2, 3], "a later action")
    assert setup.view.selection == ("box", "can")


@pytest.mark.parametrize(
    ("width", "height"),
    [
        pytest.param(1280, 800, marks=pytest.mark.thorough),
        (1024, 600),
        pytest.param(390, 844, marks=pytest.mark.thorough),
    ],
)
def test_all_of_the_board_is_in_view_beside_the_panels(
    setup_alone: Setup, width: int, height: int
) -> None:
    """From the beginning, and again when the board has got another size: what the browser finds at
    the board's corners is the scene and no panel."""
    setup = setup_alone
    setup.tab.set_viewport_size({"width": width, "height": height})
    setup.tab.goto(setup.door.url)
    setup.tab.locator("canvas").first.wait_for()

    def covered() -> list[str]:
        if not setup.page._views._assigned:
            return ["no page yet"]
        found = []
        for x in (0.0, setup.view.document.board.size[0]):
            for y in (0.0, setup.view.document.board.size[1]):
                place = setup.on_screen((x, y, 0.0))
                found.append(setup.tab.evaluate(UNDER_POINTER, list(place)))
        return [tag for tag in found if tag not in ("CANVAS", "MESSAGE")]

    until(lambda: covered() == [], "all four corners of the first board")
    setup.session.do(SetBoard(Board(size=(0.841, 1.189))))
    until(lambda: covered() == [], "all four corners of a board that is larger")


@pytest.mark.thorough
def test_a_page_begins_with_the_stated_view_on_a_busy_machine(setup_alone: Setup) -> None:
    """Of the whole board, at the size that is left beside the panels, by OpenCV's camera."""
    setup = setup_alone
    loop = [sys.executable, "-c", "while True: pass"]
    busy = [subprocess.Popen(loop) for _ in range(2)]
    try:
        setup.open()
    finally:
        for process in busy:
            process.kill()
            process.wait()
    (client,) = setup.door.server.get_clients().values()
    camera = client.camera
    R_CS = rotation_from_quaternion(camera.wxyz).T
    rotation, _ = cv2.Rodrigues(R_CS)
    width, height = camera.image_width, camera.image_height
    focal = height / 2.0 / np.tan(camera.fov / 2.0)
    K = np.array([[focal, 0.0, width / 2.0], [0.0, focal, height / 2.0], [0.0, 0.0, 1.0]])
    depth, length = setup.view.document.board.size[::-1]
    corners = np.array([[x, y, 0.0] for x in (0.0, length) for y in (0.0, depth)])
    pixels, _ = cv2.projectPoints(corners, rotation, -R_CS @ camera.position, K, None)
    seen = pixels[:, 0] / (width, height)
    assert (seen > 0.0).all() and (seen < 1.0).all()
    assert max(np.ptp(seen, axis=0)) > 0.6  # and not from far away
    np.testing.assert_allclose(seen[[0, 2], 0].sum(), 1.0, atol=0.01)  # from straight in front


@pytest.mark.thorough
def test_a_finger_selects_moves_and_raises(setup_alone: Setup, browser: Any) -> None:
    setup = setup_alone
    setup.session.do(AddObject("can", position=(0.2, 0.15)))
    setup.session.select(())
    with browser.new_context(viewport={"width": 1024, "height": 768}, has_touch=True) as context:
        setup = replace(setup, tab=context.new_page())
        setup.open()
        finger = context.new_cdp_session(setup.tab)

        def touch(kind: str, *place: float) -> None:
            points = [{"x": place[0], "y": place[1]}] if place else []
            finger.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        def swipe(start: Any, end: Any) -> None:
            """Moves a finger from a point of the scene to another, until that takes hold."""
            for _ in range(20):
                a, b = np.array(setup.on_screen(start)), np.array(setup.on_screen(end))
                touch("touchStart", *a)
                for share in np.linspace(0.1, 1.0, 8):
                    touch("touchMove", *(a + share * (b - a)))
                try:
                    until(lambda: setup.view.dragging, "hold", seconds=ONE_TRY)
                    break
                except AssertionError:
                    touch("touchEnd")
            touch("touchEnd")
            until(lambda: not setup.view.dragging, "let go")

        start = setup.view.X_SO("can")
        middle = setup.middle("can")
        swipe(middle, middle + np.array([0.08, 0.05, 0.0]))
        moved = setup.view.X_SO("can")
        assert setup.view.selection == ("can",)
        np.testing.assert_allclose(moved[:3, 3] - start[:3, 3], [0.08, 0.05, 0.0], atol=0.02)
        arrow = setup.page._gizmo._arrows.X_SG
        assert arrow is not None
        swipe(arrow[:3, 3] + [0.0, 0.0, 0.08], arrow[:3, 3] + [0.0, 0.0, 0.16])
        raised = setup.view.X_SO("can")
        np.testing.assert_allclose(raised[:3, 3] - moved[:3, 3], [0.0, 0.0, 0.08], atol=0.01)
