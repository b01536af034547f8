"""Panels of the board and the display: size, picture of the real board, colours, viewpoint."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import viser

from burg_drake.compose import BOARD_SIZES, SessionView, SetBoard, board_size, board_size_name
from burg_drake.core import BurgError, InvalidInputError, count_with_noun
from burg_drake.ui.board_view import BoardLayers, BoardOverlay
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.panel_parts import SidePanel, paragraph, secondary_text, upload_button
from burg_drake.ui.scene_view import Coloring
from burg_drake.ui.viewpoints import PageViews

if TYPE_CHECKING:
    from burg_drake.cameras import BoardPicture, Image
    from burg_drake.scene import Board

CUSTOM_SIZE = "own size"  # Choice for a size that is not a paper size.
LANDSCAPE_CHOICE = "across"  # Choice for a board whose long side lies along x.
PORTRAIT_CHOICE = "upright"  # Choice for a board whose long side lies along y.


class BoardPanel:
    """Chooses the board.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._actions = actions
        self._is_custom = False
        with gui.add_folder("Board"):
            self._size = actions.on_choice(
                gui.add_dropdown("Size", (*BOARD_SIZES, CUSTOM_SIZE)), self._set_paper
            )
            self._orientation = actions.on_choice(
                gui.add_dropdown("Lies", (LANDSCAPE_CHOICE, PORTRAIT_CHOICE)), self._set_orientation
            )
            self._extents = actions.typed_field(
                gui.add_vector2(
                    "Width, depth [mm]", (594.0, 420.0), min=(1.0, 1.0), max=(1e5, 1e5), step=0.1
                ),
                self._set_extents,
            )

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        size = view.document.board.size
        name = board_size_name(size)
        self._is_custom = self._is_custom or name is None
        self._size.value = CUSTOM_SIZE if self._is_custom or name is None else name
        self._orientation.value = PORTRAIT_CHOICE if size[1] > size[0] else LANDSCAPE_CHOICE
        self._orientation.visible = not self._is_custom
        self._extents.handle.visible = self._is_custom
        self._extents.show(tuple(round(1e3 * side, 3) for side in size))

    def _set_paper(self, name: str) -> None:
        self._is_custom = name == CUSTOM_SIZE
        if self._is_custom:
            self.show(self._actions.session.view)
            return
        width, depth = self._actions.session.view.document.board.size
        self._set_board_size(board_size(name, upright=depth > width))

    def _set_orientation(self, orientation: str) -> None:
        short, long = sorted(self._actions.session.view.document.board.size)
        self._set_board_size((short, long) if orientation == PORTRAIT_CHOICE else (long, short))

    def _set_extents(self, extents_mm: tuple[float, float]) -> None:
        width, depth = (round(1e-3 * side, 6) for side in extents_mm)
        self._set_board_size((width, depth), field="board")

    def _set_board_size(self, size: tuple[float, float], field: str = "") -> None:
        session = self._actions.session
        session.do(SetBoard(replace(session.view.document.board, size=size)), field=field)


CAMERA_RELEASE_TIMEOUT = 10.0
"""Seconds until a closed camera can be opened by others."""


class LivePicture:
    """Takes pictures of a board with a camera, in its own thread, until it is closed.

    Args:
        camera: argument of `cameras.open_source`.
        board: board in front of the camera.
        show: called with each picture, or with one line that says why there is none.
        previous: closed live picture that may still hold the camera; this one waits for its end.

    Attributes:
        camera, board: as given.
    """

    def __init__(
        self,
        camera: str,
        board: Board,
        show: Callable[[BoardPicture | str], None],
        previous: LivePicture | None = None,
    ) -> None:
        self.camera, self.board = camera, board
        self._show = show
        self._closed = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(previous,), name="live-picture", daemon=True
        )
        self._thread.start()

    def close(self) -> None:
        """Stops taking pictures; the camera is released soon afterwards."""
        self._closed.set()

    def wait(self, timeout: float) -> None:
        """Waits for the last picture of a finite source, at most `timeout` [s]."""
        self._thread.join(timeout)

    def _run(self, previous: LivePicture | None) -> None:
        interval = 0.5  # Seconds between pictures; each sends some hundred kilobytes to every page.
        from burg_drake.cameras import BoardRectifier, open_source

        if previous is not None:
            previous.wait(CAMERA_RELEASE_TIMEOUT)
        try:
            rectifier = BoardRectifier(self.board)
            with open_source(self.camera) as source:
                while not self._closed.is_set():
                    try:
                        frame = source.read()
                        if frame is None:
                            return
                        self._report(rectifier.picture(frame.image))
                    except BurgError as error:  # the board is hidden, or the camera was unplugged
                        self._report(str(error))
                    self._closed.wait(interval)
        except BurgError as error:
            self._report(str(error))

    def _report(self, picture: BoardPicture | str) -> None:
        if not self._closed.is_set():
            self._show(picture)


CAMERA_NUMBERS = ("0", "1", "2", "3")
"""Cameras of this machine that the page may open."""


class BackdropPanel(SidePanel):
    """Shows a picture of the real board under the objects.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
        layers: layers of the board.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions, layers: BoardLayers) -> None:
        super().__init__(gui, actions)
        self._layers = layers
        self._overlay: BoardOverlay | None = None
        self._live: LivePicture | None = None
        icon = viser.Icon
        with gui.add_folder("Real board"):
            self._text = gui.add_html("")
            upload = upload_button(gui, "Photo of the board", icon=icon.PHOTO, mime_type="image/*")
            upload.on_upload(self._on_upload)
            self._camera = gui.add_dropdown("Camera", CAMERA_NUMBERS)
            self._button("Take a picture", self._take_picture, icon=icon.CAMERA)
            self._live_checkbox = actions.on_choice(
                gui.add_checkbox("Live", False, hint="Show what the camera sees, again and again"),
                self._set_live,
            )
            self._opacity = actions.on_choice(
                gui.add_slider("Opacity", 0.0, 1.0, 0.05, 0.8), self._set_opacity, key="backdrop"
            )
            self._remove = self._button("Remove the picture", self._clear, icon=icon.X)
            self._show_overlay(None, "")

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view; a picture stays unchanged."""
        if self._live is not None and self._live.board != view.document.board:
            self._set_live(True)
        self._remove.visible = self._opacity.visible = self._overlay is not None

    def close(self) -> None:
        """Releases the camera."""
        live, self._live = self._live, None
        if live is not None:
            live.close()

    def _clear(self) -> None:
        self.close()
        self._live_checkbox.value = False
        self._show_overlay(None, "")

    async def _on_upload(self, event: Any) -> None:
        file = event.target.value
        self._actions.submit(lambda: self._use_file(file.content, file.name), event.client)

    def _use_file(self, data: bytes, name: str) -> None:
        from burg_drake.cameras import decode_image

        self._use_image(decode_image(data), name)

    def _take_picture(self) -> None:
        """Takes a picture with a camera of this machine.

        Raises:
            InvalidInputError: the camera is not one of `CAMERA_NUMBERS`, or does not show the
                board.
            CameraLost: the camera delivers no picture.
        """
        from burg_drake.cameras import open_source

        number, live = self._chosen_camera(), self._live
        if live is not None:
            self._set_live(False)
            self._live_checkbox.value = False
            live.wait(CAMERA_RELEASE_TIMEOUT)
        with open_source(number) as source:
            frame = source.read()
        self._use_image(None if frame is None else frame.image, f"camera {number}")

    def _chosen_camera(self) -> str:
        number = str(self._camera.value)
        if number not in CAMERA_NUMBERS:
            raise InvalidInputError(
                f"camera {number!r} does not exist; give one of {', '.join(CAMERA_NUMBERS)}"
            )
        return number

    def _use_image(self, image: Image | None, name: str) -> None:
        if image is None:
            raise InvalidInputError(f"{name} cannot be read as an image; give PNG or JPEG")
        from burg_drake.cameras import board_picture

        self._show_picture(board_picture(image, self._actions.session.view.document.board), name)

    def _show_picture(self, found: BoardPicture, name: str) -> None:
        markers = count_with_noun(len(found.ids), "marker")
        words = f"{name}: {markers}, off by {1e3 * found.error:.1f} mm"
        overlay = BoardOverlay(found.image, found.lower, found.upper, float(self._opacity.value))
        self._show_overlay(overlay, f"{words}. {found.note}" if found.note else words)

    def _set_live(self, on: bool) -> None:
        """Starts or stops the live picture of a camera."""
        before = self._live
        self.close()
        if on:
            camera, board = self._chosen_camera(), self._actions.session.view.document.board
            self._live = LivePicture(camera, board, self._on_live_picture, before)

    def _on_live_picture(self, picture: BoardPicture | str) -> None:
        """Called in the thread of the live picture."""
        live = self._live

        def show_picture() -> None:
            if live is None or live is not self._live:
                return
            if isinstance(picture, str):
                self._show_line(picture)
            else:
                self._show_picture(picture, f"camera {live.camera}")

        self._actions.submit(show_picture, key="live picture", wait_for_typing=True)

    def _set_opacity(self, opacity: float) -> None:
        if self._overlay is not None:
            self._overlay = replace(self._overlay, opacity=min(max(float(opacity), 0.0), 1.0))
            self._layers.show("backdrop", self._overlay)

    def _show_overlay(self, overlay: BoardOverlay | None, words: str) -> None:
        self._overlay = overlay
        self._layers.show("backdrop", overlay)
        self._show_line(words or "Lay a picture of the printed board under the objects.")
        self.show(self._actions.session.view)

    def _show_line(self, line: str) -> None:
        self._text.content = paragraph(secondary_text(line))


COLORING_CHOICES: dict[str, Coloring] = {
    "as they look": "objects",
    "by status": "status",
    "random": "random",
}
"""Ways to colour objects, by the text of the choice."""


class DisplayPanel(SidePanel):
    """Chooses how the scene is drawn.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
        views: views of all pages.
        on_change: called after each change of a choice.
    """

    def __init__(
        self,
        gui: viser.GuiApi,
        actions: PageActions,
        views: PageViews,
        on_change: Callable[[], None],
    ) -> None:
        super().__init__(gui, actions)
        self._on_change = on_change
        with gui.add_folder("Display"):
            self._colors: Any = gui.add_dropdown("Objects", tuple(COLORING_CHOICES))
            self._markers = gui.add_checkbox("Markers", True)
            for field in (self._colors, self._markers):
                actions.on_choice(field, lambda value: on_change())
            for label, key, icon, above in (
                ("From above", "T", viser.Icon.ARROW_BAR_DOWN, True),
                ("From the front", "F", viser.Icon.PERSPECTIVE, False),
            ):
                look = partial(views.set_view, above=above)
                self._page_button(label, look, width=6, icon=icon, hint=f"View ({key})")

    @property
    def coloring(self) -> Coloring:
        """The chosen colouring of objects."""
        return COLORING_CHOICES.get(self._colors.value, "objects")

    @property
    def markers(self) -> bool:
        """Whether markers are drawn on the board."""
        return bool(self._markers.value)

    def next_colors(self) -> None:
        """Switches to the next colouring."""
        names = tuple(COLORING_CHOICES)
        self._colors.value = names[(names.index(self._colors.value) + 1) % len(names)]
        self._on_change()
