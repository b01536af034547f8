"""Paper: sizes by name, and what of a page can be drawn on."""

from __future__ import annotations

import re
from dataclasses import dataclass

from burg_drake.core import InvalidInputError, UnknownNameError, nearest

PAPERS = {
    "A4": (0.210, 0.297),
    "A3": (0.297, 0.420),
    "A2": (0.420, 0.594),
    "A1": (0.594, 0.841),
    "A0": (0.841, 1.189),
    "letter": (8.5 * 0.0254, 11 * 0.0254),
    "legal": (8.5 * 0.0254, 14 * 0.0254),
    "tabloid": (11 * 0.0254, 17 * 0.0254),
}
"""Short and long side [m]; ISO 216, and ANSI/ASME Y14.1 with US legal."""
LEAST_WIDTH, LEAST_HEIGHT = 0.180, 0.140
"""Of a page [m], for the rulers of 100 mm and the text beside them."""
GREATEST = 5.08
"""PDF pages are at most 14400 points wide (ISO 32000-1, annex C) [m]."""

LEFT_STRIP = 0.007
BOTTOM_STRIP = 0.014
"""What rulers and text take of a page within its margins [m]."""


@dataclass(frozen=True)
class Paper:
    """A page, x to the right and y up from its lower left corner.

    Attributes:
        name: for people; of a size of one's own width and height, as it lies.
        width, height: [m], as long as they are printed; a printer that scales makes them longer.
        margin: that the printer leaves white on all sides [m].
    """

    name: str
    width: float
    height: float
    margin: float

    @property
    def lower(self) -> tuple[float, float]:
        """Lower left corner of what the board may be drawn on [m]."""
        return self.margin + LEFT_STRIP, self.margin + BOTTOM_STRIP

    @property
    def upper(self) -> tuple[float, float]:
        """Its upper right corner [m]."""
        return self.width - self.margin, self.height - self.margin

    @property
    def room(self) -> tuple[float, float]:
        """Its extents [m]."""
        (x0, y0), (x1, y1) = self.lower, self.upper
        return x1 - x0, y1 - y0


def paper_size(name: str) -> tuple[str, float, float]:
    """Looks a paper up.

    Args:
        name: of `PAPERS` in any case, or `WxH` in millimetres, such as `700x500`.

    Returns:
        Its name as it is written, short and long side [m].

    Raises:
        UnknownNameError: there is no such paper.
        InvalidInputError: it is too small or too large.
    """
    known = {key.lower(): key for key in PAPERS}
    if name.lower() in known:
        key = known[name.lower()]
        return key, *PAPERS[key]
    own = re.fullmatch(r"(\d+(?:\.\d+)?)\s*[x×]\s*(\d+(?:\.\d+)?)(?:\s*mm)?", name.lower())
    if not own:
        raise UnknownNameError(
            f"page {name!r} does not exist; {nearest(name, PAPERS)}; or give WxH in mm, such as"
            " 700x500"
        )
    short, long = sorted(float(text) * 1e-3 for text in own.groups())
    if short < LEAST_HEIGHT or long < LEAST_WIDTH or long > GREATEST:
        raise InvalidInputError(
            f"page {name!r} must be at least {1e3 * LEAST_WIDTH:g} x {1e3 * LEAST_HEIGHT:g} mm,"
            f" for rulers and text, and at most {1e3 * GREATEST:g} mm long, the limit of PDF"
        )
    return f"{1e3 * long:g} x {1e3 * short:g} mm", short, long


def orientations(
    name: str, margin: float, measured: tuple[float, float] = (0.1, 0.1)
) -> tuple[Paper, ...]:
    """A paper upright and across, as far as rulers and text fit.

    Args:
        name: see `paper_size`.
        margin: that the printer leaves white [m].
        measured: what 100 mm along x and y of the page measure in print [m].

    Raises:
        UnknownNameError: there is no such paper.
        InvalidInputError: the paper is too small or large; the margin leaves too little of it.
    """
    label, short, long = paper_size(name)
    sx, sy = (0.1 / m for m in measured)
    pages = [
        Paper(label if label in PAPERS else f"{1e3 * w:g} x {1e3 * h:g} mm", w / sx, h / sy, margin)
        for w, h in ((short, long), (long, short))
    ]
    white = 2 * margin - 0.01  # the least sizes are those with margins of 5 mm
    fits = [p for p in pages if p.width - white >= LEAST_WIDTH and p.height - white >= LEAST_HEIGHT]
    if not fits:
        raise InvalidInputError(
            f"margins of {1e3 * margin:g} mm leave too little of page {label}; give smaller"
            " margins or a larger page"
        )
    return tuple(fits)
