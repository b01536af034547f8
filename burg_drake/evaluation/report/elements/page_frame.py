"""A page that stands alone: title, style sheet and content in one file."""

from __future__ import annotations

from burg_drake.evaluation.report.elements.blocks import Child, Html, element
from burg_drake.evaluation.report.elements.style import style_sheet
from burg_drake.visualization.style import html_document


def html_page(title: str, *content: Child) -> str:
    """A whole HTML document.

    Args:
        title: of the window.
        content: of the body.
    """
    return html_document(title, style_sheet(), element("main", *content))


def header(kind: str, title: str, about: str) -> Html:
    """The top of a page: what kind of page it is, of what, and a line about it."""
    return element(
        "header",
        element("p", kind, class_="kind"),
        element("h1", title),
        element("p", about, class_="about"),
    )


def tiles(entries: list[tuple[str, Child, str]]) -> Html:
    """Large figures in a row: name, figure, note of each."""
    return element(
        "dl",
        *(
            element("div", element("dt", name), element("dd", value, element("small", note)))
            for name, value, note in entries
        ),
        class_="tiles",
    )


def closing_section(*sections: Child) -> Html:
    """The folded sections at the end; on paper they begin a new page."""
    return element("div", *sections, class_="closer")
