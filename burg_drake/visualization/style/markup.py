"""HTML elements in which every text is escaped."""

from __future__ import annotations

from html import escape


class Html(str):
    """Markup that is complete and needs no escaping any more."""


VOID = ("br", "hr", "meta", "img", "input", "rect", "line", "path", "circle")
"""Elements without an end tag, and those of SVG that are closed at once."""

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
    if name in VOID and not children:
        closing = "/" if name in ("rect", "line", "path", "circle") else ""
        return Html(f"<{name}{written}{closing}>")
    return Html(f"<{name}{written}>{join(*children)}</{name}>")


def join(*children: Child) -> Html:
    """Children one after the other."""
    return Html("".join(c if isinstance(c, Html) else escape(str(c)) for c in _given(children)))


def _given(children: tuple[Child, ...]) -> list[Html | str | int | float]:
    return [child for child in children if child is not None]
