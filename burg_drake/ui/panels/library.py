"""The panel of the library: pictures of its objects, a search, and a click that adds one."""

from __future__ import annotations

from functools import partial
from typing import Any

import viser

from burg_drake.compose.commands import AddObject
from burg_drake.compose.editing import SessionView
from burg_drake.objects.library import ObjectLibrary
from burg_drake.ui.view import ObjectPictures
from burg_drake.ui.widgets import (
    PageActions,
    all_of,
    box,
    counted,
    picture_button,
    quiet,
    show_picture,
    title,
)
from burg_drake.visualization.style import element


class LibraryPanel:
    """Shows a library's objects; a click puts one on the board.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._gui = gui
        self._actions = actions
        self._library: ObjectLibrary | None = None
        self._pictures: ObjectPictures | None = None
        self._buttons: dict[str, Any] = {}
        self._title = gui.add_html("")
        self._search = actions.chosen(
            gui.add_text(
                "Search", "", hint="Shows objects whose name or description has all words"
            ),
            lambda words: self._filter(words),
            key="search",
        )
        self._objects = gui.add_folder(None)

    def show(self, view: SessionView, pictures: ObjectPictures) -> None:
        """Brings the panel to a view.

        Args:
            view: of the session.
            pictures: of the view's library.
        """
        if pictures is not self._pictures:
            self._library, self._pictures = view.library, pictures
            self._fill(view.library)
        self._draw()

    def draw(self) -> None:
        """Shows the pictures that are there by now."""
        self._draw()

    def _fill(self, library: ObjectLibrary) -> None:
        for button in self._buttons.values():
            button.remove()
        self._buttons = {}
        with self._objects:
            for name, entry in library.objects.items():
                hint = entry.description or name
                weight = "background only" if entry.is_fixed else f"{1e3 * entry.mass:.0f} g"
                button = picture_button(self._gui, name, None, hint=f"{hint} ({weight})")
                self._actions.clicked(button, partial(self._actions.session.do, AddObject(name)))
                self._buttons[name] = button
        self._filter(self._search.value)

    def _filter(self, words: str) -> None:
        if self._library is None:
            return
        wanted = words.lower().split()
        found = 0
        for name, button in self._buttons.items():
            text = f"{name} {self._library.entry(name).description}".lower()
            button.visible = all(word in text for word in wanted)
            found += button.visible
        self._show_count(found)

    def _show_count(self, found: int) -> None:
        library = self._library
        assert library is not None
        total = len(library.objects)
        count = f"{found} of {counted(total, 'object')}"
        if found == total:
            count = counted(total, "object")
        why = self._pictures.missing if self._pictures else ""
        content = all_of(
            box(
                title(library.name),
                element("span", f" {count}; click one to add it", class_="bd-quiet"),
                quiet(why) if why else None,
            )
        )
        if self._title.content != content:
            self._title.content = content

    def _draw(self) -> None:
        assert self._pictures is not None
        for name, button in self._buttons.items():
            show_picture(button, self._pictures.get(name))
        self._show_count(sum(button.visible for button in self._buttons.values()))
