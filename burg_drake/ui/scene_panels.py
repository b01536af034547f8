"""Panels of the scene as a whole: its name and state with undo and redo, and its files."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import viser

from burg_drake.compose import FileChanged, SessionView, UnsavedChanges
from burg_drake.core import BurgError
from burg_drake.printout import PAPER_SIZES, PrintSettings
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.panel_parts import (
    STATUS_STYLES,
    SidePanel,
    ask_for_confirmation,
    notice_html,
    paragraph,
    secondary_text,
    status_chip,
    title_html,
)
from burg_drake.ui.shortcuts import KeysDialog
from burg_drake.visualization import Html, element


class SummaryPanel(SidePanel):
    """Shows name and state of the scene, with buttons for undo and redo.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
        keys: dialog with mouse actions and shortcuts.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions, keys: KeysDialog) -> None:
        super().__init__(gui, actions)
        icon, session = viser.Icon, actions.session
        self._text = gui.add_html("")
        self._dismiss = self._button("I have read this", self._dismiss_notices)
        self._undo = self._button("Undo", session.undo, width=4, icon=icon.ARROW_BACK_UP)
        self._redo = self._button("Redo", session.redo, width=4, icon=icon.ARROW_FORWARD_UP)
        self._page_button(
            "Keys", keys.toggle, width=4, icon=icon.KEYBOARD, hint="Mouse and keys (H)"
        )

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        self._text.content = paragraph(*_summary_html(view))
        self._dismiss.visible = bool(view.notices)
        _set_enabled(self._undo, view.undo_label, "Undo")
        _set_enabled(self._redo, view.redo_label, "Redo")

    def _dismiss_notices(self) -> None:
        for line in self._actions.session.view.notices:
            self._actions.session.dismiss(line)


def _set_enabled(button: Any, label: str | None, verb: str) -> None:
    button.disabled = label is None
    button.hint = f"{verb}: {label}" if label else f"Nothing to {verb.lower()}"


def _summary_html(view: SessionView) -> list[Html]:
    count: Counter[str] = Counter(view.status.values())
    state = "saved" if view.saved else "not saved"
    where = view.path.name if view.path else "no file yet"
    chips = [status_chip(status, count[status]) for status in STATUS_STYLES if count[status]]
    return [
        title_html(view.document.name),
        secondary_text(f"{where}, {state}"),
        element("div", *(chips or [secondary_text("The board is empty.")])),
        *(notice_html(line) for line in view.notices),
    ]


_LIBRARY_KEY = re.compile(rb"^library:", re.MULTILINE)  # Line that identifies a scene file.


def scene_names(folder: Path) -> tuple[str, ...]:
    """Names of the scene files of a folder, without their suffix, in alphabetical order.

    Args:
        folder: the folder that was opened; unreadable files in it are left out.
    """
    max_files = 500  # Maximum number of files read.
    head_bytes = 4096  # Bytes from the start of a file that are searched for the library.
    found = []
    try:
        files = sorted(folder.glob("*.yaml"))
    except OSError:
        return ()
    for path in files[:max_files]:
        try:
            with path.open("rb") as file:
                if _LIBRARY_KEY.search(file.read(head_bytes)):
                    found.append(path.stem)
        except OSError:
            continue
    return tuple(found)


NO_SCENES = "(none in the folder)"  # Choice while the folder has no scenes.
Client = viser.ClientHandle | None


class FilePanel(SidePanel):
    """Saves, loads and prints scenes."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        super().__init__(gui, actions)
        self._shown_name = self._shown_library = ""
        icon = viser.Icon
        with gui.add_folder("Save"):
            self._name: Any = gui.add_text("Name", "", hint="Of the file")
            self._page_button("Save scene", self.save, primary=True, icon=icon.DEVICE_FLOPPY)
        with gui.add_folder("Load"):
            self._scene = gui.add_dropdown("Scene", (NO_SCENES,))
            self._page_button("Load scene", self._load_scene, icon=icon.FOLDER_OPEN)
            self._library: Any = gui.add_dropdown("Library", actions.session.libraries())
            self._page_button(
                "New scene",
                self._begin_scene,
                width=6,
                icon=icon.FILE_PLUS,
                hint="With this library",
            )
            self._button(
                "Use library",
                lambda: actions.session.use_library(self._library.value),
                width=6,
                icon=icon.PACKAGE,
                hint="Take the objects of this scene, and new ones, from this library",
            )
        with gui.add_folder("Print"):
            self._page = gui.add_dropdown("Page size", tuple(PAPER_SIZES), initial_value="A4")
            self._page_button(
                "Save printout", self.print_out, icon=icon.PRINTER, hint="Download it as PDF"
            )

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view, but not during a drag."""
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
        """Saves the scene under the name in the field."""
        session, name = self._actions.session, self._name.value.strip()
        view = session.view
        is_own_name = view.path is not None and name == view.path.stem
        other_name = None if is_own_name else name or None

        def overwrite() -> None:
            session.save(other_name, overwrite=True)

        try:
            view = session.save(other_name)
        except FileChanged as error:
            self._confirm(client, error, "Overwrite the file?", "Overwrite", overwrite)
            return
        assert view.path is not None
        self._actions.show_message(client, str(view.path), "Saved")

    def _open_scene(self, open_scene: Callable[..., Any], name: str, client: Client) -> None:
        """Opens another scene; asks first if changes would be lost."""
        discard = partial(open_scene, name, discard=True)
        try:
            open_scene(name)
        except UnsavedChanges as error:
            self._confirm(client, error, "Discard changes?", "Discard them", discard)

    def _confirm(
        self, client: Client, error: BurgError, title: str, label: str, action: Callable[[], Any]
    ) -> None:
        """Asks on a page whether to act in spite of an error; raises the error if there is no page
        to ask."""
        if client is None:
            raise error
        ask_for_confirmation(self._actions, client, title, str(error), label, action)

    def print_out(self, client: Client) -> None:
        """Sends the printout of the board to a page, as a download."""
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

    def _load_scene(self, client: Client) -> None:
        if self._scene.value != NO_SCENES:
            self._open_scene(self._actions.session.load, self._scene.value, client)

    def _begin_scene(self, client: Client) -> None:
        self._open_scene(self._actions.session.new, self._library.value, client)
