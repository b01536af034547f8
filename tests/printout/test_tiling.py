"""Pages: no marker is cut, no page too many, everything is on paper."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from burg_drake.core import InvalidInputError, UnknownNameError
from burg_drake.printout import (
    BLEED,
    MAX_FLAP_WIDTH,
    PAPER_SIZES,
    cut_axis,
    page_orientations,
    paper_size,
    tile_board,
)
from burg_drake.scene import Markers, marker_layout

A2 = (0.594, 0.420)


def corners(layout) -> tuple[np.ndarray, np.ndarray]:
    points = layout.p_SQ[:, :, :2].reshape(-1, 2)
    return points.min(axis=0), points.max(axis=0)


def fewest_by_trial(span, bars, room: float, flap: float) -> int | None:
    """Tries all sets of cuts midway between markers."""
    middles = [(a[1] + b[0]) / 2 for a, b in itertools.pairwise(bars)]
    for n in range(len(middles) + 1):
        for cuts in itertools.combinations(middles, n):
            starts = [span[0], *(c - BLEED for c in cuts)]
            ends = [*(c + flap for c in cuts), span[1]]
            if all(e - s <= room + 1e-9 for s, e in zip(starts, ends, strict=True)):
                return n
    return None


def test_fewest_cuts_against_all_sets_of_cuts() -> None:
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(200):
        side, gap, count = rng.uniform(0.02, 0.08), rng.uniform(0.004, 0.02), rng.integers(1, 8)
        starts = 0.03 + np.arange(count) * (side + gap)
        bars = [(s, s + side) for s in starts.tolist()]
        span = (bars[0][0], bars[-1][1])
        room, flap = rng.uniform(0.05, 0.4), min(MAX_FLAP_WIDTH, gap / 2 - 5e-4)
        cuts = cut_axis(span, bars, room, flap)
        expected = fewest_by_trial(span, bars, room, flap)
        assert (None if cuts is None else len(cuts)) == expected
        seen.add(expected)
        for cut in cuts or []:
            assert all(cut <= a - gap / 2 + 1e-9 or cut >= b + gap / 2 - 1e-9 for a, b in bars)
    assert {None, 0, 1, 2} <= seen


@pytest.mark.parametrize(
    ("page", "pages"), [("A4", 6), ("A3", 3), ("A2", 1), ("A1", 1), ("A0", 1), ("letter", 6)]
)
def test_the_default_board(page: str, pages: int) -> None:
    layout = marker_layout(A2, Markers())
    tiling = tile_board(A2, layout, corners(layout), page_orientations(page, 5e-3))
    assert len(tiling.tiles) == pages and tiling.flap == pytest.approx(MAX_FLAP_WIDTH)
    paper, whole = tiling.paper, np.zeros(len(layout.ids), dtype=int)
    for tile in tiling.tiles:
        lower, upper = np.array(tile.lower), np.array(tile.upper)
        on_page = lower + tile.p_PS, upper + tile.p_PS
        assert (on_page[0] >= np.array(paper.lower) - 1e-9).all()
        assert (on_page[1] <= np.array(paper.upper) + 1e-9).all()
        points = layout.p_SQ[:, :, :2]
        inside = ((points > lower) & (points < upper)).all(axis=2)
        whole += inside.all(axis=1)
        parted = inside.any(axis=1) & ~inside.all(axis=1)
        assert not parted.any()
        for x in (tile.cut_left, tile.cut_right):
            assert x is None or x in tiling.x_cuts
    assert (whole == 1).all()


def test_a_board_of_the_papers_size_lies_on_it() -> None:
    layout = marker_layout(A2, Markers())
    (tile,) = tile_board(A2, layout, corners(layout), page_orientations("A2", 5e-3)).tiles
    np.testing.assert_allclose(tile.p_PS, 0.0, atol=1e-12)


def test_narrow_gaps_leave_no_strip_for_glue() -> None:
    layout = marker_layout(A2, Markers(spacing=0.004))
    tiling = tile_board(A2, layout, corners(layout), page_orientations("A4", 5e-3))
    assert tiling.flap == 0.0 and len(tiling.tiles) > 1


def test_mistakes() -> None:
    large = marker_layout(A2, Markers(side=0.3))
    with pytest.raises(InvalidInputError, match=r"300 mm.* does not fit on page A4; A2 would be"):
        tile_board(A2, large, corners(large), page_orientations("A4", 5e-3))
    size = (2.0, 2.0)
    huge = marker_layout(size, Markers(side=1.8))
    with pytest.raises(InvalidInputError, match=r"larger paper as WxH in mm, or smaller"):
        tile_board(size, huge, corners(huge), page_orientations("A4", 5e-3))
    size = (4.4, 3.2)
    wide = marker_layout(size, Markers(spacing=0.2))
    with pytest.raises(
        InvalidInputError, match=r"needs .* pages A4, but at most 100 .* board.size"
    ):
        tile_board(size, wide, corners(wide), page_orientations("A4", 5e-3))
    with pytest.raises(UnknownNameError, match="page 'A44' does not exist; did you mean 'A4'"):
        paper_size("A44")
    with pytest.raises(InvalidInputError, match="at least 180 x 140 mm"):
        paper_size("100x200")
    with pytest.raises(InvalidInputError, match="margins of 45 mm leave too little of page A4"):
        page_orientations("A4", 0.045)


def test_papers() -> None:
    """ISO 216: each half of the one before, sides as 1 to the root of 2, to the millimetre."""
    series = [PAPER_SIZES[f"A{k}"] for k in range(5)]
    for (short, long), (half, side) in itertools.pairwise(series):
        assert side == short and abs(half - long / 2) < 1e-3
        assert abs(long / short - 2**0.5) < 3e-3
    assert paper_size("Letter") == ("letter", 8.5 * 0.0254, 11 * 0.0254)
    name, short, long = paper_size("700x500 mm")
    assert (name, short, long) == ("700 x 500 mm", 0.5, pytest.approx(0.7))
