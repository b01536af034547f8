"""Buttons of a panel: several in a row, with pictures, and few that stand out.

viser sets one button a row. A mark in a button's icon tells the style sheet (`page.css`) how wide
it is and how it looks.
"""

from __future__ import annotations

import zipfile
from functools import cache
from importlib.resources import files
from typing import Any

import viser

from burg_drake.ui.widgets.texts import picture


def quiet_button(gui: viser.GuiApi, label: str, *, width: int = 12, **options: Any) -> Any:
    """A button as most are.

    Args:
        gui: of viser.
        label: on it.
        width: twelfths of the panel: 2, 3, 4, 6 or 12.
        options: as of viser's `add_button`, `icon` among them.
    """
    icon = options.pop("icon", None)
    return _marked(gui.add_button(label, **options), icon, width, "bd-quiet-button")


def upload_button(gui: viser.GuiApi, label: str, *, width: int = 12, **options: Any) -> Any:
    """A button that asks for a file; see `quiet_button`."""
    icon = options.pop("icon", None)
    return _marked(gui.add_upload_button(label, **options), icon, width, "bd-quiet-button")


def strong_button(gui: viser.GuiApi, label: str, *, width: int = 12, **options: Any) -> Any:
    """A button that stands out; see `quiet_button`."""
    icon = options.pop("icon", None)
    return _marked(gui.add_button(label, **options), icon, width, "bd-strong-button")


def picture_button(
    gui: viser.GuiApi, label: str, png: bytes | None, *, width: int = 4, **options: Any
) -> Any:
    """A picture with its name below; see `quiet_button`."""
    button = gui.add_button(label, **options)
    show_picture(button, png, width=width)
    return button


def show_picture(button: Any, png: bytes | None, *, width: int = 4, chosen: bool = False) -> None:
    """Gives a button another picture.

    Args:
        button: of `picture_button`.
        png: a blank if None.
        width: as it was made with.
        chosen: it gets a frame.
    """
    html = picture(png, f"bd-mark bd-picture bd-{width}" + (" bd-chosen" if chosen else ""))
    if button._icon_html != html:
        button._icon_html = html


def _marked(button: Any, icon: str | None, width: int, look: str) -> Any:
    drawn, bare = ("", " bd-bare") if icon is None else (icon_svg(icon), "")
    button._icon_html = f'<span class="bd-mark bd-{width} {look}{bare}">{drawn}</span>'
    return button


@cache
def icon_svg(name: str) -> str:
    """The icon that viser calls `name`, as an element of HTML.

    Args:
        name: one of `viser.Icon`.
    """
    with _archive().open(f"{name}.svg") as file:
        return file.read().decode()


@cache
def _archive() -> zipfile.ZipFile:
    return zipfile.ZipFile(str(files("viser") / "_icons" / "tabler-icons.zip"))
