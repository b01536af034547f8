"""A page that stands alone: one HTML file that needs nothing else."""

from __future__ import annotations

from burg_drake.visualization.style.markup import Child, Html, element


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
