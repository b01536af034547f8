"""Paper sizes, and the tiling of a board over as few pages as possible."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, InvalidInputError, UnknownNameError, suggest_names
from burg_drake.scene import MarkerLayout

PAPER_SIZES = {
    "A4": (0.210, 0.297),
    "A3": (0.297, 0.420),
    "A2": (0.420, 0.594),
    "A1": (0.594, 0.841),
    "A0": (0.841, 1.189),
    "letter": (8.5 * 0.0254, 11 * 0.0254),
    "legal": (8.5 * 0.0254, 14 * 0.0254),
    "tabloid": (11 * 0.0254, 17 * 0.0254),
}
"""Metres, short and long side; ISO 216 and ANSI/ASME Y14.1 with US legal."""
MIN_PAGE_WIDTH = 0.180  # Metres, for the rulers and the text beside them.
MIN_PAGE_HEIGHT = 0.140  # Metres, for the rulers.

BOTTOM_STRIP = 0.014
"""Metres of a page within its margins, for the ruler and the text."""


@dataclass(frozen=True)
class Paper:
    """A page, x to the right and y up from its lower left corner.

    Attributes:
        name: display name; for a custom size, width and height as oriented.
        width, height: printed lengths [m]; a printer that scales makes them longer.
        margin: white margin of the printer on all sides [m].
    """

    name: str
    width: float
    height: float
    margin: float

    @property
    def lower(self) -> tuple[float, float]:
        """Lower left corner of the drawing area for the board [m]."""
        left_strip = 0.007  # Metres, for the vertical ruler.
        return self.margin + left_strip, self.margin + BOTTOM_STRIP

    @property
    def upper(self) -> tuple[float, float]:
        """Upper right corner of the drawing area [m]."""
        return self.width - self.margin, self.height - self.margin

    @property
    def room(self) -> tuple[float, float]:
        """Extents of the drawing area [m]."""
        (x0, y0), (x1, y1) = self.lower, self.upper
        return x1 - x0, y1 - y0


def paper_size(name: str) -> tuple[str, float, float]:
    """Looks up a paper size.

    Args:
        name: name in `PAPER_SIZES` in any case, or `WxH` in millimetres, such as `700x500`.

    Returns:
        Its display name, short and long side [m].

    Raises:
        UnknownNameError: there is no such paper.
        InvalidInputError: it is too small or too large.
    """
    max_length = 5.08  # Metres; PDF pages have at most 14400 points (ISO 32000-1, annex C).
    known = {key.lower(): key for key in PAPER_SIZES}
    if name.lower() in known:
        key = known[name.lower()]
        return key, *PAPER_SIZES[key]
    own = re.fullmatch(r"(\d+(?:\.\d+)?)\s*[x×]\s*(\d+(?:\.\d+)?)(?:\s*mm)?", name.lower())
    if not own:
        raise UnknownNameError(
            f"page {name!r} does not exist; {suggest_names(name, PAPER_SIZES)}; or give WxH in mm,"
            " such as 700x500"
        )
    short, long = sorted(float(text) * 1e-3 for text in own.groups())
    if short < MIN_PAGE_HEIGHT or long < MIN_PAGE_WIDTH or long > max_length:
        raise InvalidInputError(
            f"page {name!r} must be at least {1e3 * MIN_PAGE_WIDTH:g} x"
            f" {1e3 * MIN_PAGE_HEIGHT:g} mm, for rulers and text, and at most"
            f" {1e3 * max_length:g} mm long, the limit of PDF"
        )
    return f"{1e3 * long:g} x {1e3 * short:g} mm", short, long


def page_orientations(
    name: str, margin: float, measured: tuple[float, float] = (0.1, 0.1)
) -> tuple[Paper, ...]:
    """The orientations of a paper, portrait and landscape, in which rulers and text fit.

    Args:
        name: see `paper_size`.
        margin: white margin of the printer [m].
        measured: printed lengths of 100 mm along x and y of the page [m].

    Raises:
        UnknownNameError: there is no such paper.
        InvalidInputError: the paper is too small or large; the margin leaves too little of it.
    """
    label, short, long = paper_size(name)
    sx, sy = (0.1 / m for m in measured)
    pages = [
        Paper(
            label if label in PAPER_SIZES else f"{1e3 * w:g} x {1e3 * h:g} mm",
            w / sx,
            h / sy,
            margin,
        )
        for w, h in ((short, long), (long, short))
    ]
    excess_margin = 2 * margin - 0.01  # the minimum sizes assume margins of 5 mm
    fits = [
        p
        for p in pages
        if p.width - excess_margin >= MIN_PAGE_WIDTH and p.height - excess_margin >= MIN_PAGE_HEIGHT
    ]
    if not fits:
        raise InvalidInputError(
            f"margins of {1e3 * margin:g} mm leave too little of page {label}; give smaller"
            " margins or a larger page"
        )
    return tuple(fits)


MAX_PAGES = 100
"""Pages of a printout; a larger board is a mistake in its size."""
BLEED = 1e-3
"""Metres that a page shows beyond the edge where it is trimmed."""
MAX_FLAP_WIDTH = 7e-3
"""Metres of the strip for glue, where the gap between markers is wide enough."""

Span = tuple[float, float]


@dataclass(frozen=True)
class Tile:
    """A page's part of the board.

    Attributes:
        number: page number from 1, row by row from the upper left.
        row, column: position of the page.
        cut_left, cut_top: positions at which the page is trimmed, to be glued onto its neighbour
            [m]; None for the first page.
        cut_right, cut_bottom: positions at which the next page begins, on top of the strip beyond
            [m].
        lower, upper: corners of the part that the page shows, in the scene frame [m].
        p_PS: origin of the scene frame on the page, from its lower left corner [m].
    """

    number: int
    row: int
    column: int
    cut_left: float | None
    cut_top: float | None
    cut_right: float | None
    cut_bottom: float | None
    lower: tuple[float, float]
    upper: tuple[float, float]
    p_PS: tuple[float, float]

    @property
    def visible_corners(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Lower left and upper right corner of the part that is visible after gluing [m]; on sides
        without a cut it ends with the page."""
        left, bottom = (
            edge if cut is None else cut
            for cut, edge in zip((self.cut_left, self.cut_bottom), self.lower, strict=True)
        )
        right, top = (
            edge if cut is None else cut
            for cut, edge in zip((self.cut_right, self.cut_top), self.upper, strict=True)
        )
        return (left, bottom), (right, top)


@dataclass(frozen=True)
class Tiling:
    """A board on pages of one size.

    Attributes:
        paper: the page.
        x_cuts: cuts from left to right [m].
        y_cuts: cuts from the top down [m].
        tiles: the pages.
        flap: width of the strips under the next page [m]; 0 if the gaps are too narrow.
    """

    paper: Paper
    x_cuts: tuple[float, ...]
    y_cuts: tuple[float, ...]
    tiles: tuple[Tile, ...]
    flap: float

    def visible_areas(self, size: tuple[float, float]) -> list[tuple[Array, Array]]:
        """Lower and upper corner (2,) of the part of the board that each page shows after gluing
        [m].

        Args:
            size: extents of the board [m].
        """
        xs, ys = [0.0, *self.x_cuts, size[0]], [size[1], *self.y_cuts, 0.0]
        return [
            (np.array([xs[t.column], ys[t.row + 1]]), np.array([xs[t.column + 1], ys[t.row]]))
            for t in self.tiles
        ]


def tile_board(
    size: tuple[float, float],
    layout: MarkerLayout,
    needed: tuple[Array, Array],
    papers: tuple[Paper, ...],
) -> Tiling:
    """The tiling with the fewest pages; in a tie, the one with the board's orientation.

    Args:
        size: extents of the board [m].
        layout: markers of the board, which are never cut.
        needed: lower and upper corner of the area that has to be on paper, with the markers [m].
        papers: paper orientations to choose from.

    Raises:
        InvalidInputError: no page is large enough for a marker, or there would be too many pages;
            the message says which paper works.
    """
    found = [
        t for paper in papers if (t := _tile_on_paper(size, layout, needed, paper)) is not None
    ]
    if not found:
        raise InvalidInputError(
            f"a marker of {1e3 * layout.side:g} mm, with half of the gaps around it, does not fit"
            f" on page {papers[0].name}; {_page_advice(size, layout, needed, papers[0].margin)}"
        )
    wide = size[0] >= size[1]
    best = min(found, key=lambda t: (len(t.tiles), (t.paper.width >= t.paper.height) != wide))
    if len(best.tiles) > MAX_PAGES:
        raise InvalidInputError(
            f"a board of {1e3 * size[0]:g} x {1e3 * size[1]:g} mm needs {len(best.tiles)} pages"
            f" {best.paper.name}, but at most {MAX_PAGES} are printed; check board.size, which is"
            " in metres"
        )
    return best


def _page_advice(
    size: tuple[float, float], layout: MarkerLayout, needed: tuple[Array, Array], margin: float
) -> str:
    for name in PAPER_SIZES:
        if any(_tile_on_paper(size, layout, needed, p) for p in page_orientations(name, margin)):
            return f"{name} would be large enough"
    return "give larger paper as WxH in mm, or smaller markers"


def _tile_on_paper(
    size: tuple[float, float], layout: MarkerLayout, needed: tuple[Array, Array], paper: Paper
) -> Tiling | None:
    """Tiles a board on a paper; None if a marker does not fit. Until the tiles are made, y points
    down from the top."""
    left, right = layout.p_SQ[:, 0, 0], layout.p_SQ[:, 1, 0]
    top, bottom = size[1] - layout.p_SQ[:, 0, 1], size[1] - layout.p_SQ[:, 3, 1]
    bars = _marker_spans(left, right), _marker_spans(top, bottom)
    spans = (
        (float(needed[0][0]), float(needed[1][0])),
        (size[1] - float(needed[1][1]), size[1] - float(needed[0][1])),
    )
    flap = _flap_width(*bars)
    cuts = [cut_axis(*case, flap) for case in zip(spans, bars, paper.room, strict=True)]
    if cuts[0] is None or cuts[1] is None:
        return None
    tiles = tuple(
        _make_tile(number, size, spans, (cuts[0], cuts[1]), paper, flap)
        for number in range((len(cuts[0]) + 1) * (len(cuts[1]) + 1))
    )
    return Tiling(paper, tuple(cuts[0]), tuple(size[1] - c for c in cuts[1]), tiles, flap)


def _marker_spans(starts: Array, ends: Array) -> list[Span]:
    """Intervals of the columns (or rows) of markers, in order."""
    return sorted(set(zip(np.round(starts, 9).tolist(), np.round(ends, 9).tolist(), strict=True)))


def _flap_width(*axes: list[Span]) -> float:
    """Half of the narrowest gap, less half a millimetre; 0 if that is below 3 mm."""
    gaps = [b[0] - a[1] for bars in axes for a, b in itertools.pairwise(bars)]
    flap = min([MAX_FLAP_WIDTH, *(gap / 2 - 5e-4 for gap in gaps)])
    return flap if flap >= 3e-3 else 0.0


def cut_axis(
    span: Span, bars: list[Span], room: float, flap: float = MAX_FLAP_WIDTH
) -> list[float] | None:
    """Chooses the cuts along one axis.

    Args:
        span: first and last coordinate of the area that has to be on paper [m].
        bars: columns of markers, in order; cuts stay 10 mm clear of them, or midway in narrow gaps.
        room: length that a page holds [m].
        flap: length that a page shows beyond the next cut [m].

    Returns:
        The fewest cuts, placed so that the longest part is as short as possible; None if no cuts
        work.
    """
    clearance = 10e-3  # Metres between a cut and markers, where the gap is wide enough.
    gaps = [(a[1], b[0]) for a, b in itertools.pairwise(bars)]
    gaps = [(-np.inf, bars[0][0]), *gaps, (bars[-1][1], np.inf)]
    narrowest = min(end - start for start, end in gaps)
    edge = min(clearance, narrowest / 2)
    allowed = [(max(start + edge, span[0]), min(end - edge, span[1])) for start, end in gaps]
    cuts = _fewest_cuts(span, allowed, room, flap)
    if not cuts:
        return cuts
    low, high = 0.0, room
    while high - low > 1e-4:
        tried = _fewest_cuts(span, allowed, (low + high) / 2, flap)
        if tried is not None and len(tried) == len(cuts):
            cuts, high = tried, (low + high) / 2
        else:
            low = (low + high) / 2
    return cuts


def _fewest_cuts(span: Span, allowed: list[Span], room: float, flap: float) -> list[float] | None:
    """The fewest cuts: each page takes as much as it holds."""
    cuts: list[float] = []
    start = span[0]
    while span[1] - start > room + 1e-9:
        reach = start + room - flap
        possible = [min(end, reach) for begin, end in allowed if begin <= reach + 1e-9]
        if not possible or max(possible) <= start + BLEED + 1e-9:
            return None
        cuts.append(max(possible))
        start = cuts[-1] - BLEED
        if len(cuts) > MAX_PAGES:
            break
    return cuts


def _make_tile(
    number: int,
    size: tuple[float, float],
    spans: tuple[Span, Span],
    cuts: tuple[list[float], list[float]],
    paper: Paper,
    flap: float,
) -> Tile:
    row, column = divmod(number, len(cuts[0]) + 1)
    parts = [_page_span(s, c, k, flap) for s, c, k in zip(spans, cuts, (column, row), strict=True)]
    (x0, x1), (v0, v1) = parts
    needed = np.array([[x0, size[1] - v1], [x1, size[1] - v0]])
    lower, upper = np.array(paper.lower), np.array(paper.upper)
    p_PS = (lower + upper - needed.sum(axis=0)) / 2
    for axis, page in enumerate((paper.width, paper.height)):
        if not cuts[axis]:  # without cuts, a page of the board's size has the board's edges
            p_PS[axis] = (page - size[axis]) / 2
    p_PS = np.clip(p_PS, lower - needed[0], upper - needed[1])
    left, right = _adjacent_cuts(cuts[0], column)
    top, bottom = (None if c is None else size[1] - c for c in _adjacent_cuts(cuts[1], row))
    shown = [lower - p_PS, upper - p_PS]
    for side, cut, axis, index in (
        (0, left, 0, 0),
        (1, right, 0, 1),
        (1, top, 1, 1),
        (0, bottom, 1, 0),
    ):
        if cut is not None:
            shown[side][axis] = needed[index][axis]
    return Tile(
        number + 1, row, column, left, top, right, bottom,
        (float(shown[0][0]), float(shown[0][1])),
        (float(shown[1][0]), float(shown[1][1])),
        (float(p_PS[0]), float(p_PS[1])),
    )  # fmt: skip


def _adjacent_cuts(cuts: list[float], k: int) -> tuple[float | None, float | None]:
    """The cuts before and after part k."""
    return (cuts[k - 1] if k > 0 else None), (cuts[k] if k < len(cuts) else None)


def _page_span(span: Span, cuts: list[float], k: int, flap: float) -> Span:
    """Interval that the page of part k has to show, with bleed and flap."""
    before, after = _adjacent_cuts(cuts, k)
    start = span[0] if before is None else before - BLEED
    return start, span[1] if after is None else after + flap
