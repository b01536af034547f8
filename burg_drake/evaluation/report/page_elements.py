"""Page frame, style sheet, HTML blocks and outcome colours that reports share."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import NO_VALUE, Outcome
from burg_drake.evaluation.outcome_counts import member_codes
from burg_drake.evaluation.results_table import TextValues
from burg_drake.visualization import (
    OUTCOME_GROUPS,
    Child,
    Html,
    PageTable,
    contrast_ratio,
    element,
    join,
    page_style,
    render_page,
)


@dataclass(frozen=True)
class ReportSection:
    """A section of the report, mostly a table.

    Attributes:
        title: heading.
        text: text below the heading.
        table: table of the section, if any.
        charts: charts in place of a table.
        command: command to copy, above the table or charts.
        facts: names and texts in a list.
    """

    title: str
    text: str
    table: PageTable | None = None
    charts: Sequence[Html] = ()
    command: str = ""
    facts: Sequence[tuple[str, str]] = ()


GROUP_CLASSES = {group.name: f"g{i}" for i, group in enumerate(OUTCOME_GROUPS)}
"""CSS class of each outcome group, as style.css uses it."""
_THEMED_COLOURS = {
    "hand collides": ("#9aa2a9", "#6b747b"),
    "arm has no path": ("#1a3373", "#8fa6e8"),
    "simulation failed": ("#1d2328", "#f4f6f7"),
}
"""Colours with different tones on a light and on a dark page."""


def style_sheet() -> Html:
    """Style sheet of the page."""
    return join(page_style("burg_drake.evaluation.report", "style.css"), group_style())


def group_style() -> Html:
    """CSS rules for the colours of outcomes."""
    light = "".join(
        _group_rule(g.name, _THEMED_COLOURS.get(g.name, (g.hex,))[0]) for g in OUTCOME_GROUPS
    )
    dark = "".join(_group_rule(name, tones[1]) for name, tones in _THEMED_COLOURS.items())
    return Html(f"{light}@media screen and (prefers-color-scheme: dark) {{\n{dark}}}\n")


def _group_rule(group: str, colour: str) -> str:
    # Yellow lines are invisible on white, so a darker tone of the same hue is used.
    stroke_colours = {OUTCOME_GROUPS[1].hex: "#b59f00"}
    # Text is dark or white, whichever has more contrast.
    text_colours = ("#101418", "#ffffff")
    text = max(text_colours, key=lambda shade: contrast_ratio(shade, colour))
    name = GROUP_CLASSES[group]
    fill = f".{name} {{ background: {colour}; fill: {colour}; color: {text}; }}"
    return f"{fill} .grasp.{name} {{ stroke: {stroke_colours.get(colour, colour)}; }}\n"


def html_page(title: str, *content: Child) -> str:
    """A whole HTML document.

    Args:
        title: title of the window.
        content: content of the body.
    """
    return render_page(
        "visualization/document.html.jinja",
        title=title,
        style=style_sheet(),
        content=element("main", *content),
    )


def header(kind: str, title: str, about: str) -> Html:
    """The top of a page: kind of page, title, and one line of explanation."""
    return element(
        "header",
        element("p", kind, class_="kind"),
        element("h1", title),
        element("p", about, class_="about"),
    )


def tiles(entries: list[tuple[str, Child, str]]) -> Html:
    """Large numbers in a row; each has a name, a value and a note."""
    figures = [
        element("div", element("dt", name), element("dd", value, element("small", note)))
        for name, value, note in entries
    ]
    return element("dl", *figures, class_="tiles")


def section(title: str, text: str, *content: Child) -> Html:
    """A part of the page with a heading and one sentence on what it shows."""
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


def number_cells(values: Iterable[Child]) -> list[Html]:
    """Cells of a table, aligned to the right; `NO_VALUE` is drawn fainter."""
    return [element("td", v, class_="number zero" if v == NO_VALUE else "number") for v in values]


def command(line: str) -> Html:
    """A command to copy, which breaks only between words."""
    words = [element("span", word) for word in line.split(" ")]
    spaced = [part for word in words for part in (word, " ")]
    return element("pre", element("code", *spaced[:-1], class_="copy"))


def folded_section(title: str, text: str, *content: Child) -> Html:
    """A part of the page that is collapsed on the screen and open on paper."""
    summary = element("summary", element("h2", title))
    return element("section", element("details", summary, element("p", text), *content))


GROUP_INDICES = {outcome: k for k, group in enumerate(OUTCOME_GROUPS) for outcome in group.outcomes}
"""Index into `OUTCOME_GROUPS` of each outcome."""
LIFTED_GROUP = GROUP_INDICES[Outcome.LIFTED]
"""Index of the group of lifted grasps."""


def group_indices(outcomes: TextValues) -> NDArray[np.int8]:
    """Index into `OUTCOME_GROUPS` (N,) of each outcome (N,)."""
    return group_indices_of_codes(member_codes(outcomes, tuple(Outcome)))


def group_indices_of_codes(codes: NDArray[np.int8]) -> NDArray[np.int8]:
    """Index into `OUTCOME_GROUPS` (N,) of outcomes, given as indices into `Outcome` (N,)."""
    return np.array([GROUP_INDICES[outcome] for outcome in Outcome], dtype=np.int8)[codes]


def present_groups(groups: NDArray[np.int8]) -> list[int]:
    """Indices of the groups that occur, best first."""
    return [int(k) for k in np.unique(groups)]


def group_legend(indices: Sequence[int]) -> list[tuple[str, str]]:
    """CSS classes and names of groups."""
    return [(GROUP_CLASSES[OUTCOME_GROUPS[k].name], OUTCOME_GROUPS[k].name) for k in indices]
