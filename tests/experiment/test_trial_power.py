"""Interval widths and detectable differences, compared with other ways to compute them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.proportion import proportion_confint

from burg_drake.experiment import (
    Stratum,
    detectable_difference_sentence,
    effective_trials,
    expected_estimates,
    half_width,
    mcnemar_power,
    power_table,
    smallest_difference,
)
from tests.experiment.trial_sheets import make_sheet


@pytest.mark.parametrize(("share", "trials"), [(0.5, 10), (0.8, 60), (0.95, 33)])
def test_intervals_are_as_wide_as_those_of_trials_by_chance(share: float, trials: int) -> None:
    drawn = np.random.default_rng(0).binomial(trials, share, 20_000)
    low, high = proportion_confint(drawn, trials, method="wilson")
    assert half_width(share, trials) == pytest.approx((high - low).mean() / 2, rel=3e-3)


@pytest.mark.parametrize(
    ("trials", "better", "worse"), [(30, 0.4, 0.1), (60, 0.25, 0.05), (60, 0.1, 0.1)]
)
def test_power_is_the_share_of_experiments_that_find_it(
    trials: int, better: float, worse: float
) -> None:
    rng = np.random.default_rng(1)
    tables = rng.multinomial(trials, [better, worse, 1.0 - better - worse], 20_000)
    kinds, repeats = np.unique(tables[:, :2], axis=0, return_counts=True)
    found = [
        not b + c or mcnemar([[0, b], [c, 0]], exact=True).pvalue > 0.05 for b, c in kinds.tolist()
    ]
    share = 1.0 - repeats[found].sum() / repeats.sum()
    assert mcnemar_power(trials, better, worse) == pytest.approx(share, abs=0.012)


def test_smallest_difference_in_closed_form() -> None:
    """Where the worse method is never right alone, six disagreements are what it takes: 2 / 2^6 is
    below 5 %, and 2 / 2^5 is not."""
    for trials in (12, 60, 400):
        d = smallest_difference(trials)
        missed = sum(math.comb(trials, k) * d**k * (1 - d) ** (trials - k) for k in range(6))
        assert 1.0 - missed == pytest.approx(0.8, abs=2e-3)
    assert math.isnan(smallest_difference(5))
    assert mcnemar_power(5, 1.0, 0.0) == 0.0 == mcnemar_power(50, 0.0, 0.0)


def test_more_trials_and_less_noise_find_smaller_differences() -> None:
    found = [[smallest_difference(n, worse) for worse in (0.0, 0.05, 0.1)] for n in (60, 120, 240)]
    assert (np.diff(found, axis=0) < 0).all() and (np.diff(found, axis=1) > 0).all()
    for n, worse in ((60, 0.05), (240, 0.1)):
        d = smallest_difference(n, worse)
        assert mcnemar_power(n, worse + d, worse) == pytest.approx(0.8, abs=5e-3)


def test_weights_make_some_trials_count_less() -> None:
    def stratum(population: int, selected: int) -> Stratum:
        return Stratum(
            run="a",
            object="mug",
            label="x",
            population=population,
            selected=selected,
            wanted=selected,
        )

    assert effective_trials({"a": stratum(10, 5), "b": stratum(20, 10)}) == pytest.approx(15.0)
    uneven = {"a": stratum(90, 5), "b": stratum(10, 5)}
    weights = np.repeat([18.0, 2.0], 5)
    assert effective_trials(uneven) == pytest.approx(weights.sum() ** 2 / (weights**2).sum())
    assert effective_trials({}) == 0.0


def test_the_plan_prints_what_is_to_be_expected() -> None:
    sheet = make_sheet(20)
    rows = {row.name: row.trials for row in expected_estimates(sheet)}
    assert rows == {"mug": 20, "all": 20, "precision": 10, "recall": 10}
    text = "\n".join(line for line, _ in power_table(sheet).lines(100))
    assert "± 20 %" in text and "precision" in text
    assert (
        f"differ by {100 * smallest_difference(20):.0f} points"
        in detectable_difference_sentence(20)
    )
    assert "3 trials are too few" in detectable_difference_sentence(3)
