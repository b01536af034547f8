"""Legends as HTML: escaped, counted, and as long as they say."""

from __future__ import annotations

import dataclasses
import re

import pytest

from burg_drake.visualization import (
    BAR_MARGIN,
    BAR_WIDTH,
    HISTOGRAM_HEIGHT,
    ColorBar,
    LegendEntry,
    page_panel,
)

BAR = ColorBar(
    title="clearance [m] <b>",
    colors=("#000000", "#888888", "#ffffff", "#ff0000"),
    counts=(0, 10, 5, 0),
    ticks=((0.0, "≤ 0"), (0.5, "1"), (1.0, "2")),
    paths=("/g/0", "/g/1", "/g/2", "/g/3"),
    note="3 below the range",
)


def rects(html: str) -> list[dict[str, str]]:
    return [dict(re.findall(r'(\w+)="([^"]*)"', tag)) for tag in re.findall(r"<rect[^>]*>", html)]


def test_histogram_is_in_proportion() -> None:
    drawn = rects(BAR.picture())
    heights = [float(r["height"]) for r in drawn[::2]]
    assert heights == pytest.approx([0.0, HISTOGRAM_HEIGHT, HISTOGRAM_HEIGHT / 2, 0.0])
    feet = {float(r["y"]) + float(r["height"]) for r in drawn[::2]}
    assert feet == {float(HISTOGRAM_HEIGHT)}


def test_bar_has_every_color_side_by_side() -> None:
    drawn = rects(BAR.picture())[1::2]
    assert [r["fill"] for r in drawn] == list(BAR.colors)
    edges = [float(r["x"]) for r in drawn]
    widths = [float(r["width"]) for r in drawn]
    assert edges[0] == BAR_MARGIN and sum(widths) == BAR_WIDTH
    assert [x + w for x, w in zip(edges, widths, strict=True)][:-1] == edges[1:]


def test_ticks_are_below_their_places() -> None:
    found = re.findall(r'<text x="([\d.]+)"[^>]*>([^<]*)</text>', BAR.picture())
    assert found == [
        (f"{BAR_MARGIN:.1f}", "≤ 0"),
        (f"{BAR_MARGIN + BAR_WIDTH / 2:.1f}", "1"),
        (f"{BAR_MARGIN + BAR_WIDTH:.1f}", "2"),
    ]


def test_no_text_of_a_bar_meets_the_next() -> None:
    """Digits are 7 pixel wide in the widest usual font, DejaVu Sans of 11 pixel."""
    values = ["0.002", "0.004", "0.006", "0.008", "0.01", "0.012", "0.014"]
    ticks = tuple((k / 6, text) for k, text in enumerate(values))
    html = dataclasses.replace(BAR, ticks=ticks).picture()
    texts = re.findall(r'<text x="([\d.]+)" y="\d+"(?: style="text-anchor: (\w+)")?>([^<]*)<', html)
    shift = {"start": 0.0, "": 0.5, "end": 1.0}
    begins = [float(x) - shift[anchor] * 7 * len(text) for x, anchor, text in texts]
    ends = [begin + 7 * len(text) for begin, (_, _, text) in zip(begins, texts, strict=True)]
    assert all(e + 3 < b for e, b in zip(ends[:-1], begins[1:], strict=True))
    assert [text for _, _, text in texts] == ["0.002", "0.006", "0.008", "0.01", "0.014"]


def test_text_is_escaped_and_paths_are_there() -> None:
    html = page_panel("t", [], [BAR, LegendEntry("<i>&", "#123456", ("/g/unknown",))])
    assert "<b>" not in html and "clearance [m] &lt;b&gt;" in html
    assert "&lt;i&gt;&amp;" in html
    assert 'data-paths="/g/0 /g/1 /g/2 /g/3"' in html
    assert "<p>3 below the range</p>" in html
    assert html.count('type="range"') == 2 and html.count('type="checkbox"') == 1


def test_all_counts_zero() -> None:
    empty = ColorBar("x", ("#000000",), (0,), ((0.0, "0"), (1.0, "1")), ("/g/0",))
    assert float(rects(empty.picture())[0]["height"]) == 0.0
