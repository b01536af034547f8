"""Intervals against published values and their defining equation."""

from __future__ import annotations

import math

import numpy as np
import pytest
import statsmodels.api as sm

from burg_drake.core import (
    TUKEY_LIMIT,
    clustered_interval,
    mean_interval,
    robust_sd,
    tukey_weights,
    wilson_interval,
)


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


CLUSTERS = (
    ([9, 1, 8, 2, 7], [10, 10, 10, 10, 10]),
    ([30, 2, 0, 5], [31, 40, 9, 12]),
    ([0, 20], [20, 21]),
)


@pytest.mark.parametrize(("successes", "trials"), CLUSTERS)
def test_clustered_interval_is_that_of_a_regression_with_clustered_errors(
    successes: list[int], trials: list[int]
) -> None:
    """statsmodels: least squares of a constant, with a sandwich by cluster and Student's quantile;
    clusters without trials change nothing."""
    outcomes = np.concatenate([np.arange(n) < k for k, n in zip(successes, trials, strict=True)])
    group = np.repeat(np.arange(len(trials)), trials)
    model = sm.OLS(outcomes.astype(float), np.ones(len(outcomes)))
    fit = model.fit(cov_type="cluster", cov_kwds={"groups": group}, use_t=True)
    low, high = fit.conf_int()[0]
    wilson = wilson_interval(sum(successes), sum(trials))
    assert low < wilson[0] and high > wilson[1]  # clusters differ by more than chance
    expected = (max(0.0, low), min(1.0, high))
    assert clustered_interval(successes, trials) == pytest.approx(expected)
    assert clustered_interval([0, *successes], [0, *trials]) == pytest.approx(expected)


def test_clusters_that_are_alike_are_independent_trials() -> None:
    for successes, trials in (([5, 5, 5, 5], [10, 10, 10, 10]), ([3], [9]), ([3, 0], [9, 0])):
        wilson = wilson_interval(sum(successes), sum(trials))
        assert clustered_interval(successes, trials) == wilson
    assert clustered_interval([], []) == clustered_interval([0], [0]) == (0.0, 1.0)


def test_a_few_outliers_hardly_change_the_robust_standard_deviation() -> None:
    residuals = np.random.default_rng(0).normal(0.0, 2.0, 100_000)
    residuals[:1000] = 1e6
    assert robust_sd(residuals) == pytest.approx(2.0, rel=0.03)


def test_tukey_weights_are_those_of_statsmodels() -> None:
    residuals = np.linspace(-6.0, 6.0, 25)
    expected = sm.robust.norms.TukeyBiweight(TUKEY_LIMIT).weights(residuals)
    np.testing.assert_allclose(tukey_weights(residuals / TUKEY_LIMIT), expected, atol=1e-15)


@pytest.mark.parametrize(("a", "b"), [(0.3, 0.1), (5.0, 1.0), (0.05, 0.5), (2.0, 8.0)])
@pytest.mark.parametrize("n", [10, 20])
def test_intervals_of_means_cover_the_mean(a: float, b: float, n: int) -> None:
    rng = np.random.default_rng(3)
    covered = 0
    for _ in range(1000):
        low, high = mean_interval(rng.beta(a, b, n))
        covered += low <= a / (a + b) <= high
    assert covered >= 900


def test_intervals_of_means_narrow_with_the_spread_and_the_number() -> None:
    def width(values: list[float]) -> float:
        low, high = mean_interval(np.array(values))
        assert 0.0 <= low <= np.mean(values) <= high <= 1.0
        return high - low

    assert width([0.4, 0.6] * 10) < width([0.0, 1.0] * 10) < width([0.0, 1.0] * 4)
    assert mean_interval(np.zeros(20))[1] > 0.1  # what 20 scenes lack may still occur
    assert mean_interval(np.empty(0)) == (0.0, 1.0)
