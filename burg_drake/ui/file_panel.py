"""The panel of files: save, load, the library of a new scene, and the printout."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import viser

from burg_drake.compose.scene_file import FileChanged, UnsavedChanges
from burg_drake.compose.view import View
from burg_drake.printout.board_printout import PrintSettings, print_board
from burg_drake.printout.paper import PAPERS
from burg_drake.ui.buttons import quiet_button, strong_button
from burg_drake.ui.dialogs import confirm
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.scene_files import scene_names

NO_SCENES = "(none in the folder)"
Client = viser.ClientHandle | None


class FilePanel:
    """Saves, loads and prints scenes.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._actions = actions
        self._shown_name = ""
        icon = viser.Icon
        with gui.add_folder("Save"):
            self._name: Any = gui.add_text("Name", "", hint="Of the file, and of the scene")
            actions.clicked_by(strong_button(gui, "Save scene", icon=icon.DEVICE_FLOPPY), self.save)
        with gui.add_folder("Load"):
            self._scene = gui.add_dropdown("Scene", (NO_SCENES,))
            actions.clicked_by(
                quiet_button(gui, "Load scene", icon=icon.FOLDER_OPEN), self._load_chosen
            )
        with gui.add_folder("Print"):
            self._page = gui.add_dropdown("Page size", tuple(PAPERS), initial_value="A4")
            actions.clicked_by(
                quiet_button(gui, "Save printout", icon=icon.PRINTER, hint="Download it as PDF"),
                self.print_out,
            )

    def show(self, view: View) -> None:
        """Brings the panel to a view."""
        if view.document.name != self._shown_name:
            self._shown_name = self._name.value = view.document.name
        names = scene_names(self._actions.session.folder) or (NO_SCENES,)
        if names != self._scene.options:
            self._scene.options = names

    def save(self, client: Client) -> None:
        """Writes the scene to the file of the name that stands in the field."""
        session, name = self._actions.session, self._name.value.strip()
        view = session.view
        own = view.path is not None and name in ("", view.path.stem)
        try:
            view = session.save(None if own else name or None)
        except FileChanged as error:
            if client is None:
                raise
            confirm(
                self._actions,
                client,
                "Overwrite the file?",
                str(error),
                "Overwrite",
                lambda: session.save(None if own else name or None, overwrite=True),
            )
            return
        assert view.path is not None
        self._actions.tell(client, str(view.path), "Saved")

    def load(self, name: str, client: Client) -> None:
        """Opens a scene of the folder, and asks first if something would be lost."""
        session = self._actions.session
        try:
            session.load(name)
        except UnsavedChanges as error:
            if client is None:
                raise
            confirm(
                self._actions,
                client,
                "Discard changes?",
                str(error),
                "Discard and load",
                lambda: session.load(name, discard=True),
            )

    def print_out(self, client: Client) -> None:
        """Sends the printout of the board to a page."""
        session = self._actions.session
        document = session.view.document
        scene = session.view.state.scene(session.view.path or Path(f"{document.name}.yaml"))
        printout = print_board(scene, PrintSettings(page=self._page.value))
        for warning in printout.warnings:
            self._actions.warn(client, warning, "On the printout")
        if client is not None:
            client.send_file_download(
                f"{document.name}_{self._page.value}.pdf", printout.pdf, save_immediately=True
            )

    def _load_chosen(self, client: Client) -> None:
        if self._scene.value != NO_SCENES:
            self.load(self._scene.value, client)
