"""Pictures of the setup page for the docs, taken in a Chromium without a display."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

from burg_drake.compose import AddObject, ComposeSession, MoveObjects, SetBoard, SetPose
from burg_drake.core import make_pose, rot_z
from burg_drake.scene import load_scene
from burg_drake.station import build_station_diagram, load_station
from burg_drake.ui import SetupPage, serve_page

SIZE = {"width": 1360, "height": 850}
ARGUMENTS = (
    *("--no-sandbox", "--disable-background-networking", "--hide-scrollbars"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)
PATIENCE = 120.0
"""For anything that the page has to do [s]."""
COLORS = 256


@dataclasses.dataclass
class Open:
    """A page that is open in a browser."""

    session: ComposeSession
    page: SetupPage
    tab: Any

    def show(self, name: str) -> None:
        """Brings a tab of the panel to the front."""
        self.tab.get_by_text(name, exact=True).first.click()

    def check(self, label: str) -> None:
        """Ticks a box."""
        row = f'xpath=//label[normalize-space()="{label}"]/ancestor::div[.//input][1]//input'
        self.tab.locator(row).locator("visible=true").check()

    def press(self, name: str) -> None:
        """Presses a button."""
        self.tab.get_by_role("button", name=name, exact=True).click()

    def until(self, true: Callable[[], Any]) -> None:
        """Waits for something."""
        end = time.monotonic() + PATIENCE
        while not true():
            if time.monotonic() > end:
                raise SystemExit("the page does not come to what is to be seen")
            time.sleep(0.1)

    def photograph(self, path: Path) -> None:
        """Takes a picture once nothing changes any more."""
        self.tab.evaluate(
            "document.querySelectorAll('.mantine-Notification-closeButton')"
            ".forEach(button => button.click())"
        )
        self.tab.mouse.move(SIZE["width"] / 2, SIZE["height"] - 5)
        self.tab.wait_for_timeout(3000)
        last = b""
        while last != (last := self.tab.screenshot()):
            self.tab.wait_for_timeout(2500)
        image = Image.open(io.BytesIO(last)).convert("RGB")
        few = image.quantize(COLORS, kmeans=16, dither=Image.Dither.NONE)
        path.parent.mkdir(parents=True, exist_ok=True)
        few.save(path, optimize=True)


@contextlib.contextmanager
def opened(reference: str, station: str) -> Iterator[Open]:
    """The page of a scene or library in a browser."""
    browser_path = shutil.which("chromium") or shutil.which("google-chrome")
    with (
        tempfile.TemporaryDirectory() as folder,
        ComposeSession.open(reference, load_station(station), folder=folder) as session,
        serve_page(port=0) as door,
        sync_playwright() as playwright,
    ):
        page = SetupPage(door.server, session)
        arguments = {"executable_path": browser_path, "args": list(ARGUMENTS)}
        with playwright.chromium.launch(**arguments) as browser:
            tab = browser.new_page(viewport=SIZE)
            tab.set_default_timeout(1e3 * PATIENCE)
            tab.goto(door.url)
            tab.get_by_text("click one to add it").wait_for()
            yield Open(session, page, tab)
        page.close()


def place(open: Open, places: dict[str, tuple[float, float, float]]) -> None:
    """Moves objects by x, y [m] and turns them [degrees]."""
    X_SO = {}
    for name, (x, y, turn) in places.items():
        X = open.session.view.X_SO(name)
        R = rot_z(np.deg2rad(turn)) @ X[:3, :3]
        X_SO[name] = make_pose(R, X[:3, 3] + np.array([x, y, 0.0]))
    open.session.do(MoveObjects(X_SO))


def whole_page(path: Path) -> None:
    """A scene with one object selected."""
    with opened("tabletop_six", "panda_tabletop") as open:
        place(open, {"box": (0.02, 0.0, -15.0)})
        open.session.select(["mug"])
        open.session.save("breakfast")
        open.photograph(path)


def status(path: Path) -> None:
    """Objects in the colours of their status, from above."""
    with opened("tabletop_six", "panda_tabletop") as open:
        place(open, {"bottle": (-0.12, 0.02, 0.0), "box": (0.07, 0.03, 20.0)})
        open.session.select([])
        open.tab.keyboard.press("c")
        open.show("Check")
        open.tab.keyboard.press("t")
        open.photograph(path)


def settling(path: Path) -> None:
    """What would move."""
    with opened("tabletop_six", "panda_tabletop") as open:
        open.session.restrict_movement(False)
        X_SO = open.session.view.X_SO("mug")
        p_SO = open.session.view.X_SO("bowl")[:3, 3]
        X_SO[:3, 3] = p_SO + np.array([0.02, -0.01, 0.11])
        open.session.do(MoveObjects({"mug": X_SO}))
        open.session.do(SetPose(("bottle",), 1))
        open.session.select([])
        open.show("Check")
        open.session.settle().wait(PATIENCE)
        open.photograph(path)


def backdrop(path: Path) -> None:
    """A photo of the real board under the objects that are already composed."""
    scene, station = load_scene("tabletop_six"), load_station("panda_tabletop")
    camera = dataclasses.replace(
        station.document.cameras["board"], width=1280, height=960, focal=(1200.0, 1200.0), samples=2
    )
    document = dataclasses.replace(station.document, cameras={"board": camera})
    station = dataclasses.replace(station, document=document)
    built = build_station_diagram(scene, station, robot="none", cameras=True)
    context = built.diagram.CreateDefaultContext()
    pixels = built.diagram.GetOutputPort("camera.board.color_image").Eval(context).data[..., :3]
    photo = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(photo, format="PNG")
    with opened("household", "panda_tabletop") as open:
        open.session.do(SetBoard(scene.board))
        for name in ("bowl", "banana", "screwdriver"):
            open.session.do(AddObject(name))
        open.session.restrict_movement(False)
        open.session.do(MoveObjects({n: scene.X_SO(n) for n in ("bowl", "banana", "screwdriver")}))
        open.session.restrict_movement(True)
        open.session.select([])
        open.show("View")
        with open.tab.expect_file_chooser() as chooser:
            open.press("Photo of the board")
        chooser.value.set_files(
            {"name": "photo.png", "mimeType": "image/png", "buffer": photo.getvalue()}
        )
        open.tab.get_by_text("markers, off by").wait_for()
        open.tab.keyboard.press("t")
        open.photograph(path)


def setup(folder: Path, names: tuple[str, ...] = ()) -> None:
    """Writes all pictures of the setup page, or some."""
    pictures = {
        "setup": whole_page,
        "setup_status": status,
        "setup_settle": settling,
        "setup_backdrop": backdrop,
    }
    for name in names or pictures:
        pictures[name](folder / f"{name}.png")
