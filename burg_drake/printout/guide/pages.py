"""Lays the steps of a guide out in columns, on one page where that is possible, and draws them."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.printout.guide.sketches import BOX
from burg_drake.printout.guide.steps import Step
from burg_drake.printout.paper import Paper
from burg_drake.printout.pen import BOLD, FAINT, INK, POINT, REGULAR, Pen, text_width

TITLE, HEADING, BODY = 20.0, 12.5, 10.0
"""Sizes of text [points], on A4; larger on larger paper."""
LEADING = 1.2
"""Distance of lines, as a share of the size of their text."""
SCALES = (2.0, 1.8, 1.6, 1.4, 1.3, 1.2, 1.1, 1.0)
"""How much larger than on A4 all may be, the first that fits on one page."""
RIM = 5e-3
"""Around the text, within the page's margin [m]."""
GAP = 8e-3
"""Between columns [m]."""
COLUMN = BOX[0] + 1e-3
"""Least width of a column [m]."""
AFTER = 3.5e-3
"""Between steps [m]."""
HEADER = 17e-3
"""What title and subtitle take [m]."""


@dataclass(frozen=True)
class Guide:
    """What is told on the first page.

    Attributes:
        title: of the page.
        subtitle: one line.
        steps: in their order.
    """

    title: str
    subtitle: str
    steps: tuple[Step, ...]


@dataclass(frozen=True)
class Place:
    """Where a step stands.

    Attributes:
        number: of the step, from 1.
        step: what it says.
        page: number of the page, from 0.
        left, top: its upper left corner, from the lower left one of the page's area of text [m].
        width: of its column [m].
    """

    number: int
    step: Step
    page: int
    left: float
    top: float
    width: float


def draw_guide(pen: Pen, paper: Paper, guide: Guide, *, scale_page: tuple[float, float]) -> int:
    """Draws the pages of a guide and ends each.

    Args:
        pen: draws in metres.
        paper: of the pages.
        guide: what they say.
        scale_page: how much larger all is drawn along x and y.

    Returns:
        How many pages there are.
    """
    fits = ((s, lay_out(guide, paper, s)) for s in SCALES)
    scale, places = next(
        (found for found in fits if found[1] and found[1][-1].page == 0),
        (SCALES[-1], lay_out(guide, paper, SCALES[-1])),
    )
    pages = places[-1].page + 1
    edge = paper.margin + RIM
    for page in range(pages):
        canvas = pen.canvas
        canvas.scale(*scale_page)
        canvas.translate(edge / POINT, edge / POINT)
        canvas.scale(scale, scale)
        width, height = (side - 2 * edge for side in (paper.width, paper.height))
        _draw_header(pen, guide, height / scale, width / scale)
        for place in places:
            if place.page == page:
                _draw_step(pen, place)
        canvas.showPage()
    return pages


def lay_out(guide: Guide, paper: Paper, scale: float) -> list[Place]:
    """Places the steps column by column, and goes on on another page where there is no room.

    Args:
        guide: what is to be placed.
        paper: of the pages.
        scale: of all; lengths of the places are before it is applied.

    Returns:
        The places in the order of the steps; empty if no column fits on the page.
    """
    edge = paper.margin + RIM
    width, height = (paper.width - 2 * edge) / scale, (paper.height - 2 * edge) / scale
    columns = int((width + GAP) / (COLUMN + GAP))
    if columns < 1:
        return []
    each = (width + GAP) / columns - GAP
    places: list[Place] = []
    page, column, top = 0, 0, height - HEADER
    for number, step in enumerate(guide.steps, start=1):
        tall = step_height(step, each)
        if tall > top and top < height - HEADER:
            column, top = column + 1, height - HEADER
            if column == columns:
                page, column = page + 1, 0
        places.append(Place(number, step, page, column * (each + GAP), top, each))
        top -= tall + AFTER
    return places


def step_height(step: Step, width: float) -> float:
    """What a step takes of a column [m]."""
    lines = sum(len(wrapped(words, width)) for words in step.words)
    sketch = step.height + 2e-3 if step.draw else 0.0
    return LEADING * POINT * (HEADING + 2.0 + lines * BODY) + sketch


def wrapped(words: str, width: float, size: float = BODY) -> list[str]:
    """Lines of text that are no longer than a width [m], where its words allow that."""
    lines, line = [], ""
    for word in words.split():
        longer = f"{line} {word}" if line else word
        if line and text_width(longer, size, REGULAR) > width:
            lines.append(line)
            longer = word
        line = longer
    return [*lines, line]


def _draw_header(pen: Pen, guide: Guide, top: float, right: float) -> None:
    pen.text(0.0, top - TITLE * POINT, guide.title, TITLE, font=BOLD)
    size = BODY * min(1.0, right / max(text_width(guide.subtitle, BODY), 1e-9))
    pen.text(0.0, top - 13e-3, guide.subtitle, max(size, 10.0))
    pen.line((0.0, top - 15e-3), (right, top - 15e-3), width=0.2e-3, color=FAINT)


def _draw_step(pen: Pen, place: Place) -> None:
    y = place.top - HEADING * POINT
    heading = f"{place.number}  {place.step.heading}"
    pen.text(place.left, y, heading, HEADING, font=BOLD, color=INK)
    y -= 2.0 * LEADING * POINT
    if place.step.draw:
        y -= place.step.height + 1e-3
        pen.canvas.saveState()
        pen.canvas.translate((place.left + (place.width - BOX[0]) / 2) / POINT, y / POINT)
        place.step.draw(pen)
        pen.canvas.restoreState()
        y -= 1e-3
    for paragraph in place.step.words:
        for line in wrapped(paragraph, place.width):
            y -= LEADING * BODY * POINT
            pen.text(place.left, y + 0.25 * BODY * POINT, line, BODY)
