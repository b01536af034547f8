"""Parts of panels: texts as HTML, colours of statuses, buttons, and the base class."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import viser
from viser._icons import svg_from_icon

from burg_drake.compose import Command
from burg_drake.ui.page_actions import PageActions
from burg_drake.visualization import Child, Html, element

Rgb8 = tuple[int, int, int]


@dataclass(frozen=True)
class StatusStyle:
    """Colour and text of an instance's status.

    Attributes:
        color: red, green, blue as bytes.
        words: text on the page.
    """

    color: Rgb8
    words: str

    @property
    def hex(self) -> str:
        """The colour in HTML notation."""
        return "#" + bytes(self.color).hex()


STATUS_STYLES: dict[str, StatusStyle] = {
    "ok": StatusStyle((46, 160, 67), "ok"),
    "collision": StatusStyle((214, 40, 40), "in collision"),
    "out_of_bounds": StatusStyle((236, 90, 180), "out of bounds"),
    "in_ground": StatusStyle((140, 80, 30), "in the ground"),
    "hovering": StatusStyle((64, 140, 230), "hovering"),
    "sunken": StatusStyle((64, 140, 230), "sunk into the table"),
}
"""Style by status; green, red and pink as in Rudorfer et al. (2022), blue for warnings."""

UNCHECKED_STYLE = StatusStyle((120, 120, 120), "not checked")
"""Style of an instance without a status."""
FIXED_COLOR: Rgb8 = (150, 155, 162)
"""sRGB of background objects and obstacles."""


def status_style(status: str) -> StatusStyle:
    """The style of a status."""
    return STATUS_STYLES.get(status, UNCHECKED_STYLE)


def paragraph(*children: Child) -> str:
    """A paragraph of a panel."""
    return str(element("div", *children, class_="bd-box"))


def title_html(text: str) -> Html:
    """The title of a panel."""
    return element("span", text, class_="bd-title")


def small_heading(text: str) -> Html:
    """A small heading."""
    return element("div", text, class_="bd-head")


def secondary_text(text: Child) -> Html:
    """A line of secondary text."""
    return element("div", text, class_="bd-quiet")


def color_dot(color: str) -> Html:
    """A small disc in a colour, in HTML notation."""
    return element("span", class_="bd-dot", style=f"background:{color}")


def status_chip(status: str, count: int) -> Html:
    """Number of instances with a status."""
    style = status_style(status)
    return element("span", color_dot(style.hex), f"{count} {style.words}", class_="bd-chip")


def html_list(items: Iterable[Child]) -> Html:
    """A list."""
    return element("ul", *(element("li", item) for item in items), class_="bd-list")


def html_table(heads: Iterable[str], rows: Iterable[Iterable[Child]], *, numbers: int = 0) -> Html:
    """A table.

    Args:
        heads: heads of its columns.
        rows: their cells.
        numbers: count of number columns, from the right.
    """
    names = list(heads)
    classes = [None] * (len(names) - numbers) + ["bd-number"] * numbers

    def row(cells: Iterable[Child], kind: str) -> Html:
        pairs = zip(cells, classes, strict=True)
        return element("tr", *(element(kind, cell, class_=name) for cell, name in pairs))

    return element("table", row(names, "th"), *(row(r, "td") for r in rows), class_="bd-table")


def notice_html(text: str) -> Html:
    """A highlighted line for the user."""
    return element("div", text, class_="bd-notice")


def text_button(
    gui: viser.GuiApi,
    label: str,
    *,
    width: int = 12,
    icon: str | None = None,
    primary: bool = False,
    **options: Any,
) -> Any:
    """A button with a label.

    Args:
        gui: API of viser.
        label: text on the button.
        width: twelfths of the panel: 2, 3, 4, 6 or 12.
        icon: beside the label, one of `viser.Icon`.
        primary: whether to highlight the button.
        options: options of viser's `add_button`.
    """
    look = "bd-strong-button" if primary else "bd-quiet-button"
    return _mark_button(gui.add_button(label, **options), icon, width, look)


def upload_button(gui: viser.GuiApi, label: str, icon: str, mime_type: str) -> Any:
    """A button as wide as the panel that asks for a file."""
    button = gui.add_upload_button(label, mime_type=mime_type)
    return _mark_button(button, icon, 12, "bd-quiet-button")


def picture_button(gui: viser.GuiApi, label: str, hint: str) -> Any:
    """A button for a picture with its name below; see `set_button_picture`."""
    button = gui.add_button(label, hint=hint)
    set_button_picture(button, None)
    return button


def set_button_picture(button: Any, png: bytes | None, *, chosen: bool = False) -> None:
    """Gives a button another picture.

    Args:
        button: button made by `picture_button`.
        png: a blank if None.
        chosen: whether to draw a frame around it.
    """
    kind = "bd-mark bd-picture bd-4" + (" bd-chosen" if chosen else "")
    picture = element("span", class_=kind)
    if png is not None:
        source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
        picture = element("img", class_=kind, src=source)
    button._icon_html = str(picture)


def _mark_button(button: Any, icon: str | None, width: int, look: str) -> Any:
    drawn, bare = ("", " bd-bare") if icon is None else (svg_from_icon(icon), "")
    button._icon_html = f'<span class="bd-mark bd-{width} {look}{bare}">{drawn}</span>'
    return button


def ask_for_confirmation(
    actions: PageActions,
    client: viser.ClientHandle,
    title: str,
    text: str,
    label: str,
    action: Callable[[], Any],
) -> None:
    """Asks on a page for confirmation of an action.

    Args:
        actions: actions of the page.
        client: the page.
        title: title of the question.
        text: what would be lost.
        label: label of the button that confirms.
        action: run if confirmed.
    """
    gui = client.gui
    modal = gui.add_modal(title)
    with modal:
        gui.add_html(paragraph(text))
        yes = text_button(gui, label, width=6, primary=True, color="red")
        no = text_button(gui, "Cancel", width=6)

    def go_on() -> None:
        modal.close()
        action()

    actions.on_click(yes, go_on)
    actions.on_click(no, modal.close)


class SidePanel:
    """A panel beside the scene.

    Args:
        gui: API of viser, inside the container for the panel.
        actions: actions of the page.
    """

    def __init__(self, gui: viser.GuiApi, actions: PageActions) -> None:
        self._gui, self._actions = gui, actions

    def _button(self, label: str, action: Callable[[], Any], **options: Any) -> Any:
        """Adds a button; see `text_button` for `options`."""
        return self._page_button(label, lambda client: action(), **options)

    def _selection_button(
        self, label: str, command: Callable[[tuple[str, ...]], Command], **options: Any
    ) -> Any:
        """Adds a button whose command gets the names of the selected instances."""
        session = self._actions.session
        return self._button(label, lambda: session.do(command(session.view.selection)), **options)

    def _page_button(
        self, label: str, action: Callable[[viser.ClientHandle | None], Any], **options: Any
    ) -> Any:
        """Adds a button whose action takes the page that it was clicked on; see `text_button` for
        `options`."""
        return self._actions.on_page_click(text_button(self._gui, label, **options), action)
