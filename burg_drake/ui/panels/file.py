"""The panel of files: save, load, the library of a new scene, and the printout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from burg_drake.compose.editing import SessionView
from burg_drake.compose.storage import FileChanged, UnsavedChanges
from burg_drake.printout import PAPERS, PrintSettings
from burg_drake.ui.widgets import PageActions, confirm, quiet_button, scene_names, strong_button

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
        self._shown_name = self._shown_library = ""
        icon = viser.Icon
        with gui.add_folder("Save"):
            self._name: Any = gui.add_text("Name", "", hint="Of the file")
            actions.clicked_by(strong_button(gui, "Save scene", icon=icon.DEVICE_FLOPPY), self.save)
        with gui.add_folder("Load"):
            self._scene = gui.add_dropdown("Scene", (NO_SCENES,))
            actions.clicked_by(quiet_button(gui, "Load scene", icon=icon.FOLDER_OPEN), self._load)
            self._library: Any = gui.add_dropdown("Library", actions.session.libraries())
            actions.clicked_by(
                quiet_button(
                    gui, "New scene", width=6, icon=icon.FILE_PLUS, hint="With this library"
                ),
                self._begin,
            )
            actions.clicked(
                quiet_button(
                    gui,
                    "Use library",
                    width=6,
                    icon=icon.PACKAGE,
                    hint="Take the objects of this scene, and new ones, from this library",
                ),
                lambda: actions.session.use_library(self._library.value),
            )
        with gui.add_folder("Print"):
            self._page = gui.add_dropdown("Page size", tuple(PAPERS), initial_value="A4")
            actions.clicked_by(
                quiet_button(gui, "Save printout", icon=icon.PRINTER, hint="Download it as PDF"),
                self.print_out,
            )

    def show(self, view: SessionView) -> None:
        """Brings the panel to a view; nothing of it changes while something is dragged."""
        if view.dragging:
            return
        name = view.path.stem if view.path else view.document.name
        if name != self._shown_name:
            self._shown_name = self._name.value = name
        names = scene_names(self._actions.session.folder) or (NO_SCENES,)
        if names != self._scene.options:
            self._scene.options = names
        libraries = self._actions.session.libraries()
        if libraries != self._library.options:
            self._library.options = libraries
        library = view.document.library
        if library != self._shown_library and library in libraries:
            self._shown_library = self._library.value = library

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
        self._actions.show_message(client, str(view.path), "Saved")

    def _open(self, open: Callable[..., Any], name: str, client: Client) -> None:
        """Goes over to another scene, and asks first if something would be lost."""
        try:
            open(name)
        except UnsavedChanges as error:
            if client is None:
                raise
            confirm(
                self._actions,
                client,
                "Discard changes?",
                str(error),
                "Discard them",
                lambda: open(name, discard=True),
            )

    def print_out(self, client: Client) -> None:
        """Sends the printout of the board to a page."""
        session = self._actions.session
        printout = session.printout(PrintSettings(page=self._page.value, instructions=True))
        for warning in printout.warnings:
            self._actions.show_warning(client, warning, "On the printout")
        if client is not None:
            client.send_file_download(
                f"{session.view.document.name}_{self._page.value}.pdf",
                printout.pdf,
                save_immediately=True,
            )

    def _load(self, client: Client) -> None:
        if self._scene.value != NO_SCENES:
            self._open(self._actions.session.load, self._scene.value, client)

    def _begin(self, client: Client) -> None:
        self._open(self._actions.session.new, self._library.value, client)
