"""Which colours a column gets, and the numbers in legends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from burg_drake.core import GraspSet, InvalidInputError, UnknownNameError
from burg_drake.visualization import (
    COLOR_BINS,
    ColorBar,
    LegendEntry,
    color_grasps_by,
    column_title,
    default_color_column,
)

N = 40


def grasps(**columns: object) -> GraspSet:
    return GraspSet.create(np.tile(np.eye(4), (N, 1, 1)), object="mug", columns=columns)  # type: ignore[arg-type]


def test_bar_of_a_number() -> None:
    clearance = np.linspace(-0.01, 0.03, N)
    clearance[[3, 5]] = math.nan
    clearance[7] = 9.0
    groups, (bar, unknown) = color_grasps_by(grasps(clearance=clearance), "clearance", (0.0, 0.03))
    assert isinstance(bar, ColorBar) and isinstance(unknown, LegendEntry)
    assert bar.title == "clearance [m]"
    assert sum(bar.counts) == N - 2 == sum(len(g.members) for g in groups) - 2
    assert len(bar.colors) == len(bar.paths) == len(bar.counts) == COLOR_BINS
    below = int((clearance < 0.0).sum())
    assert bar.note == f"{below} below the range, 1 above the range"
    assert [text for _, text in bar.ticks] == [
        "≤ 0",
        "0.005",
        "0.01",
        "0.015",
        "0.02",
        "0.025",
        "≥ 0.03",
    ]
    assert [place for place, _ in bar.ticks] == pytest.approx(np.linspace(0, 1, 7))
    assert unknown.label == "not known (2)"


def test_ticks_leave_room_for_the_ends() -> None:
    _, (bar,) = color_grasps_by(grasps(epsilon=np.linspace(0, 1, N)), "epsilon", (0.001, 0.0999))
    assert isinstance(bar, ColorBar)
    assert [text for _, text in bar.ticks] == [
        "≤ 0.001",
        "0.02",
        "0.04",
        "0.06",
        "0.08",
        "≥ 0.0999",
    ]


def test_ticks_of_large_numbers_that_are_close_differ() -> None:
    _, (bar,) = color_grasps_by(grasps(time=1e6 + np.linspace(0, 1, N)), "time")
    assert isinstance(bar, ColorBar)
    texts = [text for _, text in bar.ticks]
    assert len(set(texts)) == len(texts) >= 5
    assert [float(text) for text in texts] == pytest.approx(1e6 + np.linspace(0, 1, len(texts)))


def test_paths_of_the_bar_are_those_of_the_groups() -> None:
    groups, (bar,) = color_grasps_by(grasps(epsilon=np.linspace(0, 1, N)), "epsilon")
    assert isinstance(bar, ColorBar)
    drawn = {f"/drake/grasps/{g.key}" for g in groups}
    assert drawn == {path for path, count in zip(bar.paths, bar.counts, strict=True) if count}


def test_names_and_truth_values() -> None:
    _, legend = color_grasps_by(grasps(stage=np.array(["clear"] * 30 + ["executed"] * 10)), "stage")
    assert [entry.label for entry in legend] == ["clear (30)", "executed (10)"]  # type: ignore[union-attr]
    _, legend = color_grasps_by(grasps(ok=np.arange(N) < 25), "ok")
    assert [entry.label for entry in legend] == ["yes (25)", "no (15)"]  # type: ignore[union-attr]


def test_outcomes_of_one_colour_share_a_line() -> None:
    names = np.array(["lifted"] * 10 + ["slipped"] * 10 + ["dropped"] * 10 + [""] * 10)
    _, legend = color_grasps_by(grasps(outcome=names))
    assert [entry.label for entry in legend] == [  # type: ignore[union-attr]
        "lifted (10)",
        "lost during lift or hold (20)",
        "not judged (10)",
    ]
    paths = legend[1].paths
    assert set(paths) == {"/drake/grasps/slipped", "/drake/grasps/dropped"}


def test_what_is_shown_without_being_asked() -> None:
    plain = grasps()
    assert default_color_column(plain) is None
    _, (entry,) = color_grasps_by(plain)
    assert isinstance(entry, LegendEntry) and entry.label == f"grasps ({N})"
    scored = plain.with_columns(score=np.arange(N))
    assert default_color_column(scored) == "score"
    assert default_color_column(scored.with_columns(outcome="lifted")) == "outcome"


def test_errors() -> None:
    with pytest.raises(UnknownNameError, match=r"'clearence'; .*'clearance'"):
        color_grasps_by(grasps(clearance=1.0), "clearence")
    with pytest.raises(InvalidInputError, match="for numbers; column 'object' has names"):
        color_grasps_by(grasps(), "object", (0.0, 1.0))
    with pytest.raises(InvalidInputError, match="for numbers; all grasps have one colour"):
        color_grasps_by(grasps(), None, (0.0, 1.0))
    with pytest.raises(InvalidInputError, match="the range 1 to 0 does not rise"):
        color_grasps_by(grasps(), "width", (1.0, 0.0))


def test_units() -> None:
    names = ("slip", "tilt", "pad_force", "patch_area", "moved_mug", "epsilon", "made_up")
    assert [column_title(name) for name in names] == [
        *("slip [m]", "tilt [rad]", "pad_force [N]", "patch_area [m²]", "moved_mug [m]"),
        *("epsilon", "made_up"),
    ]
    assert column_title("arm_clearance") == "arm_clearance [m]"
