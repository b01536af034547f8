"""Calibration of margins, compared with scikit-learn, SciPy and a bootstrap."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import mannwhitneyu
from sklearn.isotonic import IsotonicRegression
from sklearn.metrics import roc_auc_score

from burg_drake.experiment import OrderedTrials, calibrate_margin, calibrate_margins, estimate_auroc
from burg_drake.experiment.comparison import margin_calibration


def trials(count: int, seed: int = 0, digits: int = 9) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    good = rng.random(count) < 0.4
    return np.round(rng.normal(size=count) + good, digits), good


@pytest.mark.parametrize("digits", [9, 1, 0])
def test_area_is_that_of_scikit_learn_and_mann_whitney(digits: int) -> None:
    values, good = trials(200, 1, digits)
    weight = np.random.default_rng(2).random(200) + 0.1
    rows = OrderedTrials.of(values, good, weight)
    assert estimate_auroc(rows).value == pytest.approx(roc_auc_score(good, values))
    assert estimate_auroc(rows, weighted=True).value == pytest.approx(
        roc_auc_score(good, values, sample_weight=weight)
    )
    u = mannwhitneyu(values[good], values[~good]).statistic
    assert estimate_auroc(rows).value == pytest.approx(u / good.sum() / (~good).sum())


def test_interval_of_the_area_meets_a_bootstrap() -> None:
    values, good = trials(400, 3)
    found = estimate_auroc(OrderedTrials.of(values, good))
    rng = np.random.default_rng(0)
    wins = np.sign(values[good][:, None] - values[~good]) / 2 + 0.5
    drawn = [
        wins[rng.integers(0, wins.shape[0], wins.shape[0])][
            :, rng.integers(0, wins.shape[1], wins.shape[1])
        ].mean()
        for _ in range(500)
    ]
    low, high = np.quantile(drawn, (0.025, 0.975))
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.015)


@pytest.mark.parametrize(("good", "bad"), [(5, 400), (6, 6), (30, 90)])
def test_interval_of_a_number_that_tells_nothing_is_that_of_mann_and_whitney(
    good: int, bad: int
) -> None:
    """Evenly mixed; the statistic has the variance (m + n + 1) / (12 m n) where nothing is told,
    also of few trials."""
    values = np.r_[(np.arange(good) + 0.5) / good, (np.arange(bad) + 0.5) / bad]
    found = estimate_auroc(OrderedTrials.of(values, np.arange(good + bad) < good))
    assert found.value == pytest.approx(0.5)
    assert found.low is not None and found.high is not None
    odds = np.log(found.high / (1 - found.high)) / 1.96 * 0.25  # one standard error of the area
    expected = np.sqrt((good + bad + 1) / (12 * good * bad))
    assert odds == pytest.approx(expected, rel=0.15)


def test_equal_weights_are_no_weights() -> None:
    values, good = trials(90, 4, 1)
    rows = OrderedTrials.of(values, good, np.full(90, 7.0))
    a, b = estimate_auroc(rows), estimate_auroc(rows, weighted=True)
    assert (a.value, a.low, a.high) == pytest.approx((b.value, b.low, b.high))


def test_small_numbers_may_be_the_better_ones() -> None:
    values, good = trials(100, 5)
    up, down = calibrate_margin("clearance", values, good), calibrate_margin("slip", -values, good)
    assert up.auroc == down.auroc
    assert [step.share for step in up.isotonic] == [step.share for step in down.isotonic][::-1]
    assert [(b.successes, b.trials) for b in up.bins] == [
        (b.successes, b.trials) for b in down.bins
    ][::-1]
    lows = [b.low for b in down.bins]
    assert lows == sorted(lows)


def test_perfect_separation_is_not_certain() -> None:
    values = np.arange(20.0)
    found = estimate_auroc(OrderedTrials.of(values, values >= 10))
    assert found.value == 1.0 and found.high == 1.0 and 0.6 < (found.low or 0) < 0.8
    few = estimate_auroc(OrderedTrials.of(np.r_[np.zeros(5), np.arange(1, 50)], np.arange(54) >= 5))
    assert 0.5 < (few.low or 0) < 0.6


def test_too_few_to_rank() -> None:
    """Of ten numbers that tell nothing, one ranks all of n and n trials without an error with a
    probability of 20 / binomial(2 n, n) at most: 29 % for 4, 8 % for 5."""
    for good, bad in ((1, 1), (4, 4), (4, 60), (60, 4)):
        found = estimate_auroc(
            OrderedTrials.of(np.arange(good + bad), np.arange(good + bad) < good)
        )
        assert found.value is None and found.reason == "fewer than 5 successes or failures"
    assert estimate_auroc(OrderedTrials.of(np.arange(10), np.arange(10) >= 5)).value == 1.0


@pytest.mark.parametrize("weighted", [False, True])
def test_isotonic_fit_is_that_of_scikit_learn(weighted: bool) -> None:
    values, good = trials(150, 6, 1)
    weight = np.random.default_rng(7).random(150) + 0.1 if weighted else None
    found = calibrate_margin("clearance", values, good, weight)
    expected = IsotonicRegression().fit(values, good, sample_weight=weight).predict(values)
    fitted = np.full(150, np.nan)
    for step in found.isotonic:
        fitted[(values >= step.low) & (values <= step.high)] = step.share
    assert fitted == pytest.approx(expected)


def test_bins_hold_all_trials_and_never_part_equal_numbers() -> None:
    values, good = trials(120, 8, 0)
    values[:5] = np.nan
    found = calibrate_margin("clearance", values, good)
    assert found.without == 5 and found.trials == 115 == sum(b.trials for b in found.bins)
    assert found.successes == good[5:].sum() == sum(b.successes for b in found.bins)
    for one, next_one in zip(found.bins, found.bins[1:], strict=False):
        assert one.high < next_one.low
    for b in found.bins:
        inside = (values >= b.low) & (values <= b.high)
        assert b.trials == inside.sum() and b.mean == pytest.approx(values[inside].mean())


def test_weighted_share_of_a_bin() -> None:
    values, good = trials(60, 9)
    weight = np.random.default_rng(1).random(60)
    for b in calibrate_margin("clearance", values, good, weight).bins:
        inside = (values >= b.low) & (values <= b.high)
        assert b.weighted is not None
        assert b.weighted.value == pytest.approx(np.average(good[inside], weights=weight[inside]))


def test_very_many_trials_share_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    values, good = trials(5000, 10)
    whole = calibrate_margin("clearance", values, good)
    monkeypatch.setattr(margin_calibration, "MAX_ORDERED_ROWS", 1000)
    coarse = calibrate_margin("clearance", values, good)
    assert coarse.auroc.value == pytest.approx(whole.auroc.value, abs=1e-3)
    assert coarse.trials == 5000 and coarse.successes == whole.successes
    assert coarse.bins[-1].high == values.max() and coarse.bins[0].low == values.min()
    tied = np.r_[values[:3000], np.full(2000, 99.0)]
    assert calibrate_margin("clearance", tied, good).trials == 5000


def test_rows_that_are_shared_hardly_change_the_area(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(margin_calibration, "MAX_ORDERED_ROWS", 1000)
    values = np.r_[np.arange(20_000.0), np.full(20_000, 2e4)]  # as where a margin is cut off
    last_five = (np.arange(40_000) >= 19_995) & (np.arange(40_000) < 20_000)
    for good in (np.arange(40_000) % 20_000 >= 19_995, last_five):
        area = estimate_auroc(OrderedTrials.of(values, good)).value
        assert area == pytest.approx(roc_auc_score(good, values), abs=2 / 1000)


@given(
    st.lists(st.tuples(st.sampled_from([np.nan, -1.0, 0.0, 1.0, np.inf]), st.booleans())),
    st.booleans(),
)
@settings(max_examples=80, deadline=None)
def test_edges(rows: list[tuple[float, bool]], weighted: bool) -> None:
    values = np.array([v for v, _ in rows], dtype=float)
    good = np.array([g for _, g in rows], dtype=bool)
    found = calibrate_margin("clearance", values, good, np.ones(len(rows)) if weighted else None)
    known = np.isfinite(values)
    few = min(good[known].sum(), (~good[known]).sum()) < 5
    assert (found.auroc.value is None) == few == bool(found.auroc.reason)
    assert sum(b.trials for b in found.bins) == known.sum()
    assert all(0.0 <= step.share <= 1.0 for step in found.isotonic)
    shares = [step.share for step in found.isotonic]
    assert shares == sorted(shares)


def test_margins_that_are_the_same_everywhere_tell_nothing_and_are_left_out() -> None:
    good = np.array([True, False, True])
    margins = {"slip": np.array([1.0, 2.0, 3.0]), "lift": np.ones(3), "tilt": np.full(3, np.nan)}
    assert [c.name for c in calibrate_margins(margins, good)] == ["slip"]
