"""A page that stands alone: one HTML file that needs nothing else."""

from __future__ import annotations

from importlib.resources import files

from burg_drake.visualization.style.markup import Child, Html, element


def page_style(package: str, name: str) -> str:
    """A style sheet of a page, with the rules before it that all pages have.

    Args:
        package: that has the sheet.
        name: of its file.
    """
    sheets = ("burg_drake.visualization.style", "page.css"), (package, name)
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
