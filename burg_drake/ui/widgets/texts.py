"""Texts of panels, as HTML in the page's own style."""

from __future__ import annotations

import base64
from collections.abc import Iterable

from burg_drake.ui.widgets.status_colors import style_of
from burg_drake.visualization.style import Child, Html, element, join


def box(*children: Child) -> Html:
    """A paragraph of a panel."""
    return element("div", *children, class_="bd-box")


def title(text: str) -> Html:
    """The name of what a panel is about."""
    return element("span", text, class_="bd-title")


def head(text: str) -> Html:
    """A small heading."""
    return element("div", text, class_="bd-head")


def quiet(text: Child) -> Html:
    """A line that stands back."""
    return element("div", text, class_="bd-quiet")


def dot(color: str) -> Html:
    """A small disc in a colour as HTML has it."""
    return element("span", class_="bd-dot", style=f"background:{color}")


def status_chip(status: str, count: int) -> Html:
    """How many instances have a status."""
    style = style_of(status)
    return element("span", dot(style.hex), f"{count} {style.words}", class_="bd-chip")


def listing(items: Iterable[Child]) -> Html:
    """A list."""
    return element("ul", *(element("li", item) for item in items), class_="bd-list")


def table(heads: Iterable[str], rows: Iterable[Iterable[Child]], *, numbers: int = 0) -> Html:
    """A table.

    Args:
        heads: of its columns.
        rows: their cells.
        numbers: how many columns, from the right, have numbers.
    """
    names = list(heads)

    def row(cells: Iterable[Child], kind: str) -> Html:
        first = len(names) - numbers
        return element(
            "tr",
            *(
                element(kind, cell, class_="bd-number" if i >= first else None)
                for i, cell in enumerate(cells)
            ),
        )

    return element("table", row(names, "th"), *(row(r, "td") for r in rows), class_="bd-table")


def notice(text: str) -> Html:
    """A line that the user should see."""
    return element("div", text, class_="bd-notice")


def picture(png: bytes | None, kind: str) -> str:
    """A picture on a button; a blank in its place if there is none (yet)."""
    if png is None:
        return str(element("span", class_=kind))
    source = f"data:image/png;base64,{base64.b64encode(png).decode()}"
    return str(element("img", class_=kind, src=source))


def counted(count: int, noun: str) -> str:
    """Such as `1 object` and `2 objects`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def all_of(*children: Child) -> str:
    """Pieces one after the other."""
    return str(join(*children))
