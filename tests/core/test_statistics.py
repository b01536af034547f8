"""Intervals against published values and their defining equation."""

from __future__ import annotations

import math

import pytest

from burg_drake.core.statistics import wilson_interval


def test_wilson_interval_has_the_published_values() -> None:
    # R. G. Newcombe, Statistics in Medicine 17 (1998), Table I, method 3
    for successes, trials, low, high in (
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ):
        assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=5e-5)


def test_wilson_interval_solves_its_equation() -> None:
    # the bounds are where the observed share is z standard errors away
    for successes, trials in ((1, 3), (7, 10), (999, 1000)):
        for p in wilson_interval(successes, trials):
            error = math.sqrt(p * (1 - p) / trials)
            assert abs(successes / trials - p) / error == pytest.approx(1.959964, abs=1e-5)
    assert wilson_interval(0, 0) == (0.0, 1.0)
    assert wilson_interval(5, 5)[1] == 1.0
    low, high = wilson_interval(3, 10)
    assert wilson_interval(7, 10) == pytest.approx((1 - high, 1 - low))
