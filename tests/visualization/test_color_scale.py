"""Ranges without outliers, bins, ticks; and numbers that are none."""

from __future__ import annotations

import math

import numpy as np
import pytest

from burg_drake.core import InvalidInputError
from burg_drake.visualization import COLOR_BINS, ColorScale, color_scale


def test_range_of_well_behaved_numbers_is_theirs() -> None:
    scale = color_scale(np.linspace(0.0, 1.0, 101))
    assert (scale.lower, scale.upper) == (0.0, 1.0)
    assert scale.count_outside(np.linspace(0.0, 1.0, 101)) == (0, 0)


def test_outliers_do_not_widen_the_range() -> None:
    numbers = np.concatenate([np.linspace(0.0, 1.0, 1000), [1e6, -1e9, 4e5]])
    scale = color_scale(numbers)
    assert -0.2 <= scale.lower <= 0.05 and 0.95 <= scale.upper <= 1.2
    below, above = scale.count_outside(numbers)
    assert below >= 1 and above >= 2
    assert below + above < 0.05 * len(numbers)


def test_infinite_and_missing_numbers_do_not_count() -> None:
    numbers = np.array([math.nan, math.inf, -math.inf, 1.797e308, 2.0, 3.0])
    scale = color_scale(numbers)
    assert (scale.lower, scale.upper) == (2.0, 3.0)
    assert scale.bins(numbers).tolist() == [
        -1,
        COLOR_BINS - 1,
        0,
        COLOR_BINS - 1,
        0,
        COLOR_BINS - 1,
    ]
    assert scale.count_outside(numbers) == (1, 2)


@pytest.mark.parametrize("numbers", [[], [math.nan], [math.inf, -math.inf]])
def test_nothing_to_go_by(numbers: list[float]) -> None:
    scale = color_scale(numbers)
    assert math.isfinite(scale.lower) and scale.lower < scale.upper
    assert scale.bins(numbers).shape == (len(numbers),)


@pytest.mark.parametrize("value", [0.0, 0.3, -7.0, 1e-12, 1e12, 5e-324])
def test_one_value_is_in_the_middle(value: float) -> None:
    scale = color_scale([value] * 5)
    assert scale.lower < value < scale.upper
    assert len(scale.ticks()) >= 3
    assert (scale.upper + scale.lower) / 2 == pytest.approx(value, abs=1e-15)
    assert scale.bins([value])[0] in (COLOR_BINS // 2 - 1, COLOR_BINS // 2)


def test_one_value_that_nearly_all_have() -> None:
    scale = color_scale([0.0] * 99 + [1.0])
    assert (scale.lower, scale.upper) == (0.0, 1.0)


@pytest.mark.parametrize("factor", [1e-9, 1.0, 3.7e5])
@pytest.mark.parametrize("shift", [0.0, -0.4, 20.0])
def test_ends_and_ticks_are_round_numbers(factor: float, shift: float) -> None:
    numbers = factor * (np.linspace(0.0, 1.0, 50) + shift)
    scale = color_scale(numbers)
    assert scale.lower <= numbers[0] + 1e-9 * factor
    assert scale.upper >= numbers[-1] - 1e-9 * factor
    ticks = np.array(scale.ticks())
    assert 3 <= len(ticks) <= 9
    step = np.diff(ticks)
    assert step == pytest.approx(step[0])
    mantissa = step[0] / 10.0 ** math.floor(math.log10(step[0] * (1 + 1e-12)))
    assert min(abs(mantissa - m) for m in (1.0, 2.0, 5.0)) < 1e-6
    assert np.round(ticks / step[0]) * step[0] == pytest.approx(ticks)
    assert ticks[0] >= scale.lower - 1e-6 * factor and ticks[-1] <= scale.upper + 1e-6 * factor


def test_given_limits_are_kept() -> None:
    scale = color_scale([0.0, 100.0], (0.003, 0.0471))
    assert (scale.lower, scale.upper) == (0.003, 0.0471)
    assert scale.ticks() == pytest.approx([0.01, 0.02, 0.03, 0.04])


@pytest.mark.parametrize(
    "limits", [(1.0, 1.0), (1.0, 0.0), (0.0, math.inf), (math.nan, 1.0), (-1e308, 1e308)]
)
def test_limits_that_do_not_rise(limits: tuple[float, float]) -> None:
    with pytest.raises(InvalidInputError, match="does not rise from one finite number"):
        color_scale([1.0], limits)


def test_bins_by_brute_force() -> None:
    scale = ColorScale(-1.0, 3.0)
    edges = [-1.0 + 4.0 * k / COLOR_BINS for k in range(COLOR_BINS + 1)]
    numbers = np.random.default_rng(3).uniform(-1.0, 3.0, 500)
    for number, found in zip(numbers, scale.bins(numbers), strict=True):
        assert edges[found] <= number < edges[found + 1]
    assert scale.bins([-1.0, 3.0]).tolist() == [0, COLOR_BINS - 1]


def test_colors_follow_the_bins() -> None:
    colors = ColorScale(0.0, 1.0).colors()
    assert colors.shape == (COLOR_BINS, 3)
    assert len({tuple(c) for c in colors.tolist()}) == COLOR_BINS
