"""Buttons of panels, and the dialog that asks for confirmation."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from functools import cache
from importlib.resources import files
from typing import Any

import viser

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


def upload_button(gui: viser.GuiApi, label: str, *, width: int = 12, **options: Any) -> Any:
    """A button that asks for a file; see `plain_button`."""
    icon = options.pop("icon", None)
    return _mark_button(gui.add_upload_button(label, **options), icon, width, "bd-quiet-button")


def primary_button(gui: viser.GuiApi, label: str, *, width: int = 12, **options: Any) -> Any:
    """A button that stands out; see `plain_button`."""
    icon = options.pop("icon", None)
    return _mark_button(gui.add_button(label, **options), icon, width, "bd-strong-button")


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
    html = picture_html(png, f"bd-mark bd-picture bd-{width}" + (" bd-chosen" if chosen else ""))
    if button._icon_html != html:
        button._icon_html = html


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
    with _open_icon_archive().open(f"{name}.svg") as file:
        return file.read().decode()


@cache
def _open_icon_archive() -> zipfile.ZipFile:
    return zipfile.ZipFile(str(files("viser") / "_icons" / "tabler-icons.zip"))


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

    actions.clicked(yes, go_on)
    actions.clicked(no, modal.close)
