"""Colour bars in the terminal."""

from __future__ import annotations

import pytest

from burg_drake.apps import print_legend, tick_line
from burg_drake.visualization import ColorBar, LegendEntry


def test_numbers_are_below_their_places() -> None:
    line = tick_line([(0.0, "0"), (0.25, "0.5"), (0.5, "1"), (1.0, "≥ 2")], 40)
    assert len(line) == 40
    assert line.startswith("0 ") and line.endswith(" ≥ 2")
    assert abs(line.index("0.5") + 1 - 10) <= 1
    assert abs(line.index(" 1 ") + 1 - 20) <= 1


def test_numbers_without_room_are_left_out() -> None:
    ticks = [(0.0, "-1000000"), *((k / 20, "12345") for k in range(1, 20)), (1.0, "1000000")]
    words = tick_line(ticks, 40).split()
    assert words[0] == "-1000000" and words[-1] == "1000000"
    assert set(words[1:-1]) == {"12345"}


def test_histogram(capsys: pytest.CaptureFixture[str]) -> None:
    """Full height for the most, the lowest bar for one of many, nothing for none."""
    bar = ColorBar("x [m]", ("#000000",) * 4, (800, 1, 0, 400), ((0.0, "0"), (1.0, "1")), ("",) * 4)
    print_legend([bar, LegendEntry("not known (3)", "#999999")])
    title, histogram, ticks, missing = capsys.readouterr().out.splitlines()
    assert title == "x [m]"
    assert histogram == "██▁▁  ▄▄"
    assert ticks == "0      1"
    assert missing == "■ not known (3)"
