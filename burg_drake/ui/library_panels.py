"""Panels that put objects on the board: one by one from the library, or many at random."""

from __future__ import annotations

from functools import partial
from typing import Any

import viser

from burg_drake.compose import (
    MAX_RANDOM_OBJECTS,
    AddObject,
    Clear,
    RandomConfiguration,
    SessionView,
)
from burg_drake.core import count_with_noun
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import LAYOUT_NAMES
from burg_drake.ui.background_pictures import ObjectPictures
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.panel_parts import (
    SidePanel,
    ask_for_confirmation,
    paragraph,
    picture_button,
    secondary_text,
    set_button_picture,
    title_html,
)
from burg_drake.visualization import element


class LibraryPanel(SidePanel):
    """Shows a library's objects; a click puts one on the board."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        super().__init__(gui, actions)
        self._library: ObjectLibrary | None = None
        self._pictures: ObjectPictures | None = None
        self._buttons: dict[str, Any] = {}
        self._title = gui.add_html("")
        self._search = actions.on_choice(
            gui.add_text(
                "Search", "", hint="Shows objects whose name or description has all words"
            ),
            self._filter,
            key="search",
        )
        self._objects = gui.add_folder(None)

    def show(self, view: SessionView, pictures: ObjectPictures) -> None:
        """Updates the panel from a view.

        Args:
            view: view of the session.
            pictures: pictures of the view's library.
        """
        if pictures is not self._pictures:
            self._library, self._pictures = view.library, pictures
            self._fill(view.library)
        self.draw()

    def draw(self) -> None:
        """Shows the pictures that are finished."""
        assert self._pictures is not None
        for name, button in self._buttons.items():
            set_button_picture(button, self._pictures.get(name))
        self._show_count()

    def _fill(self, library: ObjectLibrary) -> None:
        for button in self._buttons.values():
            button.remove()
        self._buttons = {}
        with self._objects:
            for name, entry in library.objects.items():
                hint = entry.description or name
                weight = "background only" if entry.is_fixed else f"{1e3 * entry.mass:.0f} g"
                button = picture_button(self._gui, name, f"{hint} ({weight})")
                self._actions.on_click(button, partial(self._actions.session.do, AddObject(name)))
                self._buttons[name] = button
        self._filter(self._search.value)

    def _filter(self, words: str) -> None:
        if self._library is None:
            return
        wanted = words.lower().split()
        for name, button in self._buttons.items():
            text = f"{name} {self._library.entry(name).description}".lower()
            button.visible = all(word in text for word in wanted)
        self._show_count()

    def _show_count(self) -> None:
        library = self._library
        assert library is not None
        found = sum(button.visible for button in self._buttons.values())
        total = len(library.objects)
        count = count_with_noun(total, "object")
        if found < total:
            count = f"{found} of {count}"
        why = self._pictures.missing if self._pictures else ""
        self._title.content = paragraph(
            title_html(library.name),
            element("span", f" {count}; click one to add it", class_="bd-quiet"),
            secondary_text(why) if why else None,
        )


MAX_SEED = 2**31 - 1  # Largest seed of a random configuration.


class FillPanel(SidePanel):
    """Places objects on the board at random, or removes all of them."""

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        super().__init__(gui, actions)
        icon = viser.Icon
        with gui.add_folder("Random configuration"):
            self._count = gui.add_number(
                "Objects",
                0,
                min=0,
                max=MAX_RANDOM_OBJECTS,
                step=1,
                hint="0: those that are on the board",
            )
            self._layout = gui.add_dropdown("Layout", LAYOUT_NAMES)
            self._seed: Any = gui.add_number(
                "Seed", 1, min=0, max=MAX_SEED, step=1, hint="Of the next configuration"
            )
            self._button("Shuffle", self._shuffle, width=6, icon=icon.ARROWS_SHUFFLE)
            self._clear = self._page_button(
                "Clear scene", self._ask_to_clear, width=6, icon=icon.TRASH
            )

    def show(self, view: SessionView) -> None:
        """Updates the panel from a view."""
        self._clear.disabled = not view.instances

    def _ask_to_clear(self, client: viser.ClientHandle | None) -> None:
        session = self._actions.session
        count = len(session.view.instances)
        if client is not None and count:
            ask_for_confirmation(
                self._actions,
                client,
                "Clear the scene?",
                f"This takes {count_with_noun(count, 'object')} off the board. Undo (Ctrl+Z) brings"
                " everything back.",
                "Clear it",
                lambda: session.do(Clear()),
            )

    def _shuffle(self) -> None:
        seed = self._seed.value
        self._seed.value = min(seed + 1, MAX_SEED)  # also if there is no room this time
        self._actions.session.do(
            RandomConfiguration(seed, self._count.value or None, self._layout.value)
        )
