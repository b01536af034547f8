"""HTML elements in which every text is escaped, and whole pages in one HTML file."""

from __future__ import annotations

from html import escape
from importlib.resources import files


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
    # HTML elements without an end tag, and SVG elements without content.
    void_elements = ("br", "hr", "meta", "img", "input", "rect", "line", "path", "circle")
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for key, value in attributes.items()
        if value is not None
    )
    if name in void_elements and not children:
        closing = "/" if name in ("rect", "line", "path", "circle") else ""
        return Html(f"<{name}{written}{closing}>")
    return Html(f"<{name}{written}>{join(*children)}</{name}>")


def join(*children: Child) -> Html:
    """Children one after the other."""
    given = (child for child in children if child is not None)
    return Html("".join(c if isinstance(c, Html) else escape(str(c)) for c in given))


def page_style(package: str, name: str) -> str:
    """A style sheet of a page, with the rules before it that all pages have.

    Args:
        package: that has the sheet.
        name: of its file.
    """
    sheets = ("burg_drake.visualization", "page.css"), (package, name)
    return "".join((files(where) / file).read_text(encoding="utf-8") for where, file in sheets)


def html_document(title: str, style: str, *content: Child) -> str:
    """A whole HTML document.

    Args:
        title: of the window.
        style: its style sheet.
        content: of the body.
    """
    return "<!DOCTYPE html>\n" + element(
        "html",
        element(
            "head",
            element("meta", charset="utf-8"),
            element("meta", name="viewport", content="width=device-width, initial-scale=1"),
            element("title", title),
            element("style", Html(style)),
        ),
        element("body", *content),
        lang="en",
    )
