"""Splits a board over pages: cuts in the gaps between markers, on as few pages as possible."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, InvalidInputError
from burg_drake.printout.paper import PAPERS, Paper, orientations
from burg_drake.scene.document import MarkerLayout

MOST_PAGES = 100
"""A board of more is a mistake in its size."""
BLEED = 1e-3
"""What a page shows beyond the edge along which it is trimmed [m], for a cut that strays."""
CLEAR = 10e-3
"""Least distance of a cut from markers [m], where the gap between them is wide enough; else cuts
are midway."""
FLAP = 7e-3
"""Width of the strip under the next page, which glue holds [m], where the gap between markers is
wide enough."""

Span = tuple[float, float]


@dataclass(frozen=True)
class Tile:
    """A page's part of the board.

    Attributes:
        number: of the page, from 1, row by row from the upper left.
        row, column: where it belongs.
        cut_left, cut_top: where the page is trimmed, to be glued onto the one beside it [m]; None
            where it is the first one.
        cut_right, cut_bottom: where the next page begins; the strip beyond comes under it.
        lower, upper: corners of what the page shows, in the scene frame [m].
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
    def core(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Corners of the part that is seen once all is glued, lower left and upper right [m]; on
        sides without a cut that is where the page ends."""
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
    """A board on pages of one kind.

    Attributes:
        paper: the page.
        x_cuts: from left to right [m].
        y_cuts: from the top down [m].
        tiles: the pages.
        flap: width of the strips under the next page [m]; 0 if the gaps are too narrow for any.
    """

    paper: Paper
    x_cuts: tuple[float, ...]
    y_cuts: tuple[float, ...]
    tiles: tuple[Tile, ...]
    flap: float


def tile_board(
    size: tuple[float, float],
    layout: MarkerLayout,
    needed: tuple[Array, Array],
    papers: tuple[Paper, ...],
) -> Tiling:
    """The tiling with the fewest pages; of two, the one that lies as the board does.

    Args:
        size: extents of the board [m].
        layout: its markers, none of which is cut.
        needed: lower and upper corner of what has to be on paper, markers included [m].
        papers: orientations to choose from.

    Raises:
        InvalidInputError: no page is large enough for a marker, or there would be too many; the
            message says what would do.
    """
    found = [t for paper in papers if (t := _tiling(size, layout, needed, paper)) is not None]
    if not found:
        raise InvalidInputError(
            f"a marker of {1e3 * layout.side:g} mm, with half of the gaps around it, does not fit"
            f" on page {papers[0].name}; {_remedy(size, layout, needed, papers[0].margin)}"
        )
    wide = size[0] >= size[1]
    best = min(found, key=lambda t: (len(t.tiles), (t.paper.width >= t.paper.height) != wide))
    if len(best.tiles) > MOST_PAGES:
        raise InvalidInputError(
            f"a board of {1e3 * size[0]:g} x {1e3 * size[1]:g} mm needs {len(best.tiles)} pages"
            f" {best.paper.name}, but at most {MOST_PAGES} are printed; check board.size, which is"
            " in metres"
        )
    return best


def _remedy(
    size: tuple[float, float], layout: MarkerLayout, needed: tuple[Array, Array], margin: float
) -> str:
    for name in PAPERS:
        if any(_tiling(size, layout, needed, p) for p in orientations(name, margin)):
            return f"{name} would be large enough"
    return "give larger paper as WxH in mm, or smaller markers"


def _tiling(
    size: tuple[float, float], layout: MarkerLayout, needed: tuple[Array, Array], paper: Paper
) -> Tiling | None:
    """All in y from the top down until the tiles are made; None if a marker does not fit."""
    left, right = layout.p_SQ[:, 0, 0], layout.p_SQ[:, 1, 0]
    top, bottom = size[1] - layout.p_SQ[:, 0, 1], size[1] - layout.p_SQ[:, 3, 1]
    bars = _bars(left, right), _bars(top, bottom)
    spans = (
        (float(needed[0][0]), float(needed[1][0])),
        (size[1] - float(needed[1][1]), size[1] - float(needed[0][1])),
    )
    flap = _flap(*bars)
    cuts = [cut_axis(*case, flap) for case in zip(spans, bars, paper.room, strict=True)]
    if cuts[0] is None or cuts[1] is None:
        return None
    tiles = tuple(
        _tile(number, size, spans, (cuts[0], cuts[1]), paper, flap)
        for number in range((len(cuts[0]) + 1) * (len(cuts[1]) + 1))
    )
    return Tiling(paper, tuple(cuts[0]), tuple(size[1] - c for c in cuts[1]), tiles, flap)


def _bars(starts: Array, ends: Array) -> list[Span]:
    """Columns (or rows) of markers: where they begin and end, in order."""
    return sorted(set(zip(np.round(starts, 9).tolist(), np.round(ends, 9).tolist(), strict=True)))


def _flap(*axes: list[Span]) -> float:
    """What half of the narrowest gap leaves, but for half a millimetre; none below 3 mm."""
    gaps = [b[0] - a[1] for bars in axes for a, b in itertools.pairwise(bars)]
    flap = min([FLAP, *(gap / 2 - 5e-4 for gap in gaps)])
    return flap if flap >= 3e-3 else 0.0


def cut_axis(span: Span, bars: list[Span], room: float, flap: float = FLAP) -> list[float] | None:
    """Where to cut along one axis.

    Args:
        span: first and last coordinate that have to be on paper [m].
        bars: columns of markers, in order; cuts stay `CLEAR` of them, or midway in narrow gaps.
        room: what a page holds [m].
        flap: what a page shows beyond a cut that follows [m].

    Returns:
        The fewest cuts, placed so that the longest part is as short as can be; None if there are
        none that do.
    """
    gaps = [(a[1], b[0]) for a, b in itertools.pairwise(bars)]
    gaps = [(-np.inf, bars[0][0]), *gaps, (bars[-1][1], np.inf)]
    narrowest = min(end - start for start, end in gaps)
    edge = min(CLEAR, narrowest / 2)
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
    """Each page takes as much as it holds, which makes the fewest."""
    cuts: list[float] = []
    start = span[0]
    while span[1] - start > room + 1e-9:
        reach = start + room - flap
        possible = [min(end, reach) for begin, end in allowed if begin <= reach + 1e-9]
        if not possible or max(possible) <= start + BLEED + 1e-9:
            return None
        cuts.append(max(possible))
        start = cuts[-1] - BLEED
        if len(cuts) > MOST_PAGES:
            break
    return cuts


def _tile(
    number: int,
    size: tuple[float, float],
    spans: tuple[Span, Span],
    cuts: tuple[list[float], list[float]],
    paper: Paper,
    flap: float,
) -> Tile:
    row, column = divmod(number, len(cuts[0]) + 1)
    parts = [_part(s, c, k, flap) for s, c, k in zip(spans, cuts, (column, row), strict=True)]
    (x0, x1), (v0, v1) = parts
    needed = np.array([[x0, size[1] - v1], [x1, size[1] - v0]])
    lower, upper = np.array(paper.lower), np.array(paper.upper)
    p_PS = (lower + upper - needed.sum(axis=0)) / 2
    for axis, page in enumerate((paper.width, paper.height)):
        if not cuts[axis]:  # the board's edges then are the page's where these are of one size
            p_PS[axis] = (page - size[axis]) / 2
    p_PS = np.clip(p_PS, lower - needed[0], upper - needed[1])
    left, right = _around(cuts[0], column)
    top, bottom = (None if c is None else size[1] - c for c in _around(cuts[1], row))
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


def _around(cuts: list[float], k: int) -> tuple[float | None, float | None]:
    """The cuts before and after part k."""
    return (cuts[k - 1] if k > 0 else None), (cuts[k] if k < len(cuts) else None)


def _part(span: Span, cuts: list[float], k: int, flap: float) -> Span:
    """What part k has to show, bleed and flap included."""
    before, after = _around(cuts, k)
    start = span[0] if before is None else before - BLEED
    return start, span[1] if after is None else after + flap
