"""HTML elements in which every text is escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape


class Html(str):
    """Markup that is complete and needs no escaping any more."""


Child = Html | str | int | float | None


def element(name: str, /, *children: Child, **attributes: str | float | None) -> Html:
    """An element.

    Args:
        name: its tag.
        children: elements, and texts, which are escaped; None is left out.
        attributes: their values are escaped. Underscores stand for hyphens, a trailing one is
            dropped (`class_`); None leaves the attribute out.
    """
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in ("br", "hr", "meta", "rect", "line", "path", "circle") and not children:
        closing = "/" if name in ("rect", "line", "path", "circle") else ""
        return Html(f"<{name}{written}{closing}>")
    return Html(f"<{name}{written}>{join(*children)}</{name}>")


def join(*children: Child) -> Html:
    """Children one after the other."""
    return Html("".join(c if isinstance(c, Html) else escape(str(c)) for c in _given(children)))


def _given(children: tuple[Child, ...]) -> list[Html | str | int | float]:
    return [child for child in children if child is not None]


def section(title: str, text: str, *content: Child) -> Html:
    """A headed part of the page with one sentence on what it shows."""
    return element("section", element("h2", title), element("p", text), *content)


def table(
    head: Sequence[str], rows: Sequence[Html], *, numbers: Sequence[int] = (), style: str = ""
) -> Html:
    """A table; the columns whose indices are in `numbers` are aligned to the right."""
    cells = [
        element("th", name, class_="number" if k in numbers else None, scope="col")
        for k, name in enumerate(head)
    ]
    whole = element(
        "table",
        element("thead", element("tr", *cells)),
        element("tbody", *rows),
        class_=style or None,
    )
    return element("div", whole, class_="scroll")


def command(line: str) -> Html:
    """A command to copy, broken between words only."""
    words = [element("span", word) for word in line.split(" ")]
    spaced = [part for word in words for part in (word, " ")]
    return element("pre", element("code", *spaced[:-1], class_="copy"))
