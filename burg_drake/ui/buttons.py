"""The base class of panels, their buttons, and the dialog that asks for confirmation."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any

import viser

from burg_drake.compose import Command
from burg_drake.ui.page_actions import PageActions
from burg_drake.ui.panel_html import join_html, paragraph, picture_html


def plain_button(gui: viser.GuiApi, label: str, *, width: int = 12, **options: Any) -> Any:
    """A button as most are.

    Args:
        gui: of viser.
        label: on it.
        width: twelfths of the panel: 2, 3, 4, 6 or 12.
        options: as of viser's `add_button`, `icon` among them.
    """
    icon = options.pop("icon", None)
    return _mark_button(gui.add_button(label, **options), icon, width, "bd-quiet-button")


def primary_button(gui: viser.GuiApi, label: str, *, width: int = 12, **options: Any) -> Any:
    """A button that stands out; see `plain_button`."""
    icon = options.pop("icon", None)
    return _mark_button(gui.add_button(label, **options), icon, width, "bd-strong-button")


def upload_button(gui: viser.GuiApi, label: str, icon: str, mime_type: str) -> Any:
    """A button as wide as the panel that asks for a file."""
    button = gui.add_upload_button(label, mime_type=mime_type)
    return _mark_button(button, icon, 12, "bd-quiet-button")


def picture_button(
    gui: viser.GuiApi, label: str, png: bytes | None, *, width: int = 4, **options: Any
) -> Any:
    """A picture with its name below; see `plain_button`."""
    button = gui.add_button(label, **options)
    set_button_picture(button, png, width=width)
    return button


def set_button_picture(
    button: Any, png: bytes | None, *, width: int = 4, chosen: bool = False
) -> None:
    """Gives a button another picture.

    Args:
        button: of `picture_button`.
        png: a blank if None.
        width: as it was made with.
        chosen: it gets a frame.
    """
    frame = " bd-chosen" if chosen else ""
    button._icon_html = picture_html(png, f"bd-mark bd-picture bd-{width}{frame}")


def _mark_button(button: Any, icon: str | None, width: int, look: str) -> Any:
    drawn, bare = ("", " bd-bare") if icon is None else (icon_svg(icon), "")
    button._icon_html = f'<span class="bd-mark bd-{width} {look}{bare}">{drawn}</span>'
    return button


@cache
def icon_svg(name: str) -> str:
    """The icon that viser calls `name`, as an element of HTML.

    Args:
        name: one of `viser.Icon`.
    """
    with zipfile.ZipFile(str(files("viser") / "_icons" / "tabler-icons.zip")) as archive:
        return archive.read(f"{name}.svg").decode()


def ask_for_confirmation(
    actions: PageActions,
    client: viser.ClientHandle,
    title: str,
    text: str,
    label: str,
    action: Callable[[], Any],
) -> None:
    """Asks a page whether something shall be done.

    Args:
        actions: of the page.
        client: the page.
        title: of the question.
        text: what would be lost.
        label: of the button that does it.
        action: what it does.
    """
    gui = client.gui
    modal = gui.add_modal(title)
    with modal:
        gui.add_html(join_html(paragraph(text)))
        yes = primary_button(gui, label, width=6, color="red")
        no = plain_button(gui, "Cancel", width=6)

    def go_on() -> None:
        modal.close()
        action()

    actions.on_click(yes, go_on)
    actions.on_click(no, modal.close)


class SidePanel:
    """A panel beside the scene.

    Args:
        gui: of viser, in whose container the panel goes.
        actions: what it may do.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._gui, self._actions = gui, actions

    def _button(self, label: str, action: Callable[[], Any], **options: Any) -> Any:
        """Adds a button; `options` as of `_page_button`."""
        return self._page_button(label, lambda client: action(), **options)

    def _selection_button(
        self, label: str, command: Callable[[tuple[str, ...]], Command], **options: Any
    ) -> Any:
        """Adds a button whose command gets the names of the selected instances."""
        session = self._actions.session
        return self._button(label, lambda: session.do(command(session.view.selection)), **options)

    def _page_button(
        self,
        label: str,
        action: Callable[[viser.ClientHandle | None], Any],
        *,
        primary: bool = False,
        **options: Any,
    ) -> Any:
        """Adds a button whose action gets the page that it was clicked on.

        Args:
            label: on the button.
            action: what it does.
            primary: it stands out.
            options: see `plain_button`.
        """
        make = primary_button if primary else plain_button
        return self._actions.on_page_click(make(self._gui, label, **options), action)
