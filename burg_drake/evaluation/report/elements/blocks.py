"""The parts that the report's sections are made of."""

from __future__ import annotations

from collections.abc import Sequence

from burg_drake.visualization.style import (
    Child as Child,
    Html as Html,
    element as element,
    join as join,
)


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


def folded(title: str, text: str, *content: Child) -> Html:
    """A part of the page for those who look for it: closed on the screen, open on paper."""
    summary = element("summary", element("h2", title))
    return element("section", element("details", summary, element("p", text), *content))
