"""The panel of the backdrop: the real board, by a photo or a camera, under the objects."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import viser

from burg_drake.compose.editing import SessionView
from burg_drake.core import InvalidInputError
from burg_drake.ui.view import CAMERA_RELEASE_TIMEOUT, BoardLayers, BoardOverlay, LivePicture
from burg_drake.ui.widgets import (
    PageActions,
    all_of,
    box,
    counted,
    quiet,
    quiet_button,
    upload_button,
)

if TYPE_CHECKING:
    from burg_drake.cameras.rectification import BoardPicture
    from burg_drake.cameras.sources import Image

CAMERAS = ("0", "1", "2", "3")
"""Numbers of cameras of this machine that the page may open; it can name nothing else."""
PHOTO_OPACITY = 0.8


class BackdropPanel:
    """Lays a picture of the real board under the objects.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
        layers: of the board.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions, layers: BoardLayers) -> None:
        self._actions, self._layers = actions, layers
        self._sheet: BoardOverlay | None = None
        self._live: LivePicture | None = None
        icon = viser.Icon
        with gui.add_folder("Real board"):
            self._text = gui.add_html("")
            upload = upload_button(gui, "Photo of the board", icon=icon.PHOTO, mime_type="image/*")
            upload.on_upload(self._uploaded)
            self._camera = gui.add_dropdown("Camera", CAMERAS)
            actions.clicked(
                quiet_button(gui, "Take a picture", icon=icon.CAMERA), self._take_picture
            )
            self._on = actions.chosen(
                gui.add_checkbox("Live", False, hint="Show what the camera sees, again and again"),
                self._watch,
            )
            self._opacity = actions.chosen(
                gui.add_slider("Opacity", 0.0, 1.0, 0.05, PHOTO_OPACITY),
                self._set_opacity,
                key="backdrop",
            )
            self._remove = actions.clicked(
                quiet_button(gui, "Remove the picture", icon=icon.X), self._clear
            )
            self._show_sheet(None, "")

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view; a picture stays as it is."""
        if self._live is not None and self._live.board != view.document.board:
            self._watch(True)
        self._remove.visible = self._opacity.visible = self._sheet is not None

    def close(self) -> None:
        """Lets go of the camera."""
        live, self._live = self._live, None
        if live is not None:
            live.close()

    def _clear(self) -> None:
        self.close()
        self._on.value = False
        self._show_sheet(None, "")

    async def _uploaded(self, event: Any) -> None:
        file = event.target.value
        self._actions.submit(lambda: self._use_file(file.content, file.name), event.client)

    def _use_file(self, data: bytes, name: str) -> None:
        from burg_drake.cameras.sources import decode_image

        self._use_image(decode_image(data), name)

    def _take_picture(self) -> None:
        """Takes a picture with a camera of this machine.

        Raises:
            InvalidInputError: it is not one of `CAMERAS`, or does not show the board.
            CameraLost: it gives no picture.
        """
        from burg_drake.cameras.sources import open_source

        number, live = self._chosen_camera(), self._live
        if live is not None:
            self._watch(False)
            self._on.value = False
            live.wait(CAMERA_RELEASE_TIMEOUT)
        with open_source(number) as source:
            frame = source.read()
        self._use_image(None if frame is None else frame.image, f"camera {number}")

    def _chosen_camera(self) -> str:
        number = str(self._camera.value)
        if number not in CAMERAS:
            raise InvalidInputError(
                f"camera {number!r} does not exist; give one of {', '.join(CAMERAS)}"
            )
        return number

    def _use_image(self, image: Image | None, name: str) -> None:
        if image is None:
            raise InvalidInputError(f"{name} cannot be read as an image; give PNG or JPEG")
        from burg_drake.cameras.rectification import board_picture

        self._show_picture(board_picture(image, self._actions.session.view.document.board), name)

    def _show_picture(self, found: BoardPicture, name: str) -> None:
        words = f"{name}: {counted(len(found.ids), 'marker')}, off by {1e3 * found.error:.1f} mm"
        sheet = BoardOverlay(found.image, found.lower, found.upper, float(self._opacity.value))
        self._show_sheet(sheet, f"{words}. {found.note}" if found.note else words)

    def _watch(self, on: bool) -> None:
        """Shows what a camera sees from now on, or no more."""
        before = self._live
        self.close()
        if on:
            camera, board = self._chosen_camera(), self._actions.session.view.document.board
            self._live = LivePicture(camera, board, self._on_live_picture, before)

    def _on_live_picture(self, what: BoardPicture | str) -> None:
        """Called by the live picture's thread."""
        live = self._live

        def lay() -> None:
            if live is None or live is not self._live:
                return
            if isinstance(what, str):
                self._show_line(what)
            else:
                self._show_picture(what, f"camera {live.camera}")

        self._actions.submit(lay, key="live picture", wait_for_typing=True)

    def _set_opacity(self, opacity: float) -> None:
        if self._sheet is not None:
            self._sheet = replace(self._sheet, opacity=min(max(float(opacity), 0.0), 1.0))
            self._layers.show("backdrop", self._sheet)

    def _show_sheet(self, sheet: BoardOverlay | None, words: str) -> None:
        self._sheet = sheet
        self._layers.show("backdrop", sheet)
        self._show_line(words or "Lay a picture of the printed board under the objects.")
        self.show(self._actions.session.view)

    def _show_line(self, line: str) -> None:
        self._text.content = all_of(box(quiet(line)))
