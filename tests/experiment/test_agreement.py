"""Figures of a confusion matrix, compared with scikit-learn and statsmodels."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import beta
from sklearn import metrics
from statsmodels.stats.contingency_tables import mcnemar
from statsmodels.stats.inter_rater import cohens_kappa
from statsmodels.stats.proportion import proportion_confint

from burg_drake.experiment import (
    AGREEMENT_MEASURES,
    CELL_PRIOR,
    Agreement,
    compare_paired,
    compare_paired_counts,
    count_cells,
    count_cells_by_group,
    distribute_prior,
    estimate_agreement,
    estimate_agreements,
    interval_bounds,
)

PAPER = (
    ((21, 9, 10, 20), "70.00", "67.74"),
    ((10, 13, 12, 25), "43.48", "45.45"),
)
"""The two tables of the paper: (TP, FP, FN, TN), precision and recall in per cent."""
Cells = st.tuples(*[st.integers(0, 40)] * 4)


def trials(cells: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Predicted and actual success of trials, with these counts."""
    predicted = np.repeat([True, True, False, False], cells)
    return predicted, np.repeat([True, False, True, False], cells)


@pytest.mark.parametrize(("cells", "precision", "recall"), PAPER)
def test_tables_of_the_paper(cells: tuple[int, ...], precision: str, recall: str) -> None:
    found = estimate_agreement(np.array(cells))
    assert found.cells == cells
    assert f"{100 * (found.precision.value or 0):.2f}" == precision
    assert f"{100 * (found.recall.value or 0):.2f}" == recall


@given(st.lists(Cells, min_size=1, max_size=3), st.booleans())
@settings(max_examples=60, deadline=None)
def test_intervals_stay_within_what_is_possible(
    counts: list[tuple[int, ...]], weighted: bool
) -> None:
    """A share is in [0, 1], a difference of shares in [-1, 1], and above 0 where all were to
    succeed, below 0 where none was: nothing succeeds more often than always."""
    table = np.array(counts)
    found = estimate_agreement(table, population=10.0 * table.sum(axis=1) if weighted else None)
    for name, measure in AGREEMENT_MEASURES.items():
        figure = found.figure(name)
        if figure.low is not None and figure.high is not None and figure.value is not None:
            assert measure.low <= figure.low <= figure.value <= figure.high <= measure.high
    if not table.sum():
        return
    predicted = table[:, :2].sum() / table.sum()
    low, high = found.excess.low, found.excess.high
    assert low is not None and high is not None
    if predicted in (0.0, 1.0):
        assert predicted - 1.0 <= low <= high <= predicted


def test_excess_where_all_were_to_succeed() -> None:
    """If all are predicted to succeed, the excess is the share of failures, with its interval."""
    found = estimate_agreement(np.array([2, 0, 0, 0])).excess
    low, high = proportion_confint(0, 2, method="wilson")
    assert (found.value, found.low, found.high) == (0.0, pytest.approx(low), pytest.approx(high))


ORACLES = {
    "precision": lambda y, p, w: metrics.precision_score(y, p, sample_weight=w),
    "recall": lambda y, p, w: metrics.recall_score(y, p, sample_weight=w),
    "specificity": lambda y, p, w: metrics.recall_score(~y, ~p, sample_weight=w),
    "f1": lambda y, p, w: metrics.f1_score(y, p, sample_weight=w),
    "accuracy": lambda y, p, w: metrics.accuracy_score(y, p, sample_weight=w),
    "balanced_accuracy": lambda y, p, w: metrics.balanced_accuracy_score(y, p, sample_weight=w),
    "matthews": lambda y, p, w: metrics.matthews_corrcoef(y, p, sample_weight=w),
    "kappa": lambda y, p, w: metrics.cohen_kappa_score(y, p, sample_weight=w),
    "predicted": lambda y, p, w: np.average(p, weights=w),
    "actual": lambda y, p, w: np.average(y, weights=w),
}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_selected_trials_as_scikit_learn_has_them(seed: int) -> None:
    predicted, actual = trials(tuple(np.random.default_rng(seed).integers(1, 30, 4)))
    found = estimate_agreement(count_cells(predicted, actual))
    for name, oracle in ORACLES.items():
        expected = oracle(actual, predicted, None)
        assert found.figure(name).value == pytest.approx(expected, abs=1e-12), name


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_all_grasps_as_scikit_learn_has_them_with_weights(seed: int) -> None:
    rng = np.random.default_rng(seed)
    predicted, actual = rng.random((2, 80)) < 0.6
    stratum = rng.integers(0, 5, 80)
    population = rng.integers(50, 900, 5).astype(float)
    weight = (population / np.bincount(stratum))[stratum]
    found = estimate_agreement(
        count_cells_by_group(predicted, actual, stratum, 5), population=population
    )
    assert sum(found.cells) == pytest.approx(population.sum())
    for name, oracle in ORACLES.items():
        expected = oracle(actual, predicted, weight)
        assert found.figure(name).value == pytest.approx(expected, abs=1e-12), name


def test_shares_have_wilsons_intervals_as_statsmodels_has_them() -> None:
    found = estimate_agreement(np.array((21, 9, 10, 20)))
    for figure, part, whole in (
        (found.precision, 21, 30),
        (found.recall, 21, 31),
        (found.specificity, 20, 29),
        (found.accuracy, 41, 60),
    ):
        expected = proportion_confint(part, whole, method="wilson")
        assert (figure.low, figure.high) == pytest.approx(expected, abs=1e-9)


def test_interval_of_kappa_meets_the_asymptotic_one_where_there_are_many_trials() -> None:
    cells = np.array((4200, 1800, 2000, 4000))
    found = estimate_agreement(cells).kappa
    table = cells[[0, 1, 2, 3]].reshape(2, 2)
    expected = cohens_kappa(table)
    assert found.value == pytest.approx(expected.kappa)
    assert found.low == pytest.approx(expected.kappa_low, abs=2e-3)
    assert found.high == pytest.approx(expected.kappa_upp, abs=2e-3)


def test_intervals_of_the_rest_meet_drawing_trials_anew_where_there_are_many() -> None:
    predicted, actual = trials((420, 180, 200, 400))
    found = estimate_agreement(count_cells(predicted, actual))
    rng = np.random.default_rng(3)
    rows = rng.integers(0, len(actual), (300, len(actual)))
    drawn = [np.corrcoef(actual[k], predicted[k])[0, 1] for k in rows]  # the same for yes and no
    low, high = np.quantile(drawn, (0.025, 0.975))
    assert found.matthews.low == pytest.approx(low, abs=0.015)
    assert found.matthews.high == pytest.approx(high, abs=0.015)


def test_weights_of_equal_strata_change_nothing_but_the_scale() -> None:
    counts = np.array([(8, 2, 3, 7), (6, 4, 1, 9)])
    selected = estimate_agreement(counts)
    represented = estimate_agreement(counts, population=np.array([200.0, 200.0]))
    for name in AGREEMENT_MEASURES:
        assert represented.figure(name).value == pytest.approx(selected.figure(name).value)


def test_a_stratum_that_stands_for_many_widens_recall() -> None:
    counts = np.array([(20, 0, 0, 0), (0, 0, 0, 20)])  # no failure was seen to succeed
    few = estimate_agreement(counts, population=np.array([100.0, 100.0])).recall
    many = estimate_agreement(counts, population=np.array([100.0, 5000.0])).recall
    assert few.value == many.value == 1.0
    assert (many.low or 0) < 0.5 < (few.low or 0)


@pytest.mark.parametrize("cells", [(3, 2), (2, 2), (9, 1), (20, 10)])
def test_intervals_of_many_strata_have_the_spread_of_stratified_sampling(
    cells: tuple[int, int],
) -> None:
    """The unbiased variance of a stratified share, W^2 p (1 - p) / (n - 1) of each stratum (W. G.
    Cochran, Sampling Techniques, 1977, ch. 5, without the correction for finite populations);
    half a trial a cell is nothing among a hundred strata."""
    one, other = cells
    size, strata = one + other, 100
    weight = np.random.default_rng(0).uniform(50, 500, strata)
    counts = np.tile((one, other, 0, 0), (strata, 1))
    found = estimate_agreement(counts, population=weight).precision
    p, W = one / size, weight / weight.sum()
    error = np.sqrt((W**2).sum() * p * (1 - p) / (size - 1))
    assert found.value == pytest.approx(p)
    assert found.low is not None and found.high is not None
    assert (found.high - found.low) / (2 * 1.96 * error) == pytest.approx(1.0, abs=0.06)


def test_strata_of_two_trials_count_as_a_third_of_them() -> None:
    """Their spread cannot be told from themselves. Shares are drawn from a beta distribution with a
    third of the trials, whose variance scipy knows."""
    counts, widths = np.tile((1, 1, 0, 0), (300, 1)), []
    for seed in range(4):
        found = estimate_agreement(counts, population=np.ones(300), seed=seed).precision
        assert found.low is not None and found.high is not None
        widths.append(found.high - found.low)
    expected = np.sqrt(beta(1 / 3, 1 / 3).var() / 300)
    assert np.mean(widths) / (2 * 1.96) == pytest.approx(expected, rel=0.025)


def test_bounds_are_quantiles() -> None:
    rng = np.random.default_rng(0)
    for draws in (2, 5, 40, 401):
        values = rng.normal(size=(draws, 3, 2))
        expected = np.quantile(values, (0.025, 0.975), axis=0)
        np.testing.assert_allclose(interval_bounds(values), expected, atol=1e-12)
    assert interval_bounds(np.array([[np.nan], [np.nan]]))[1].tolist() == [0.0]


def test_groups_have_the_intervals_of_their_own_trials() -> None:
    """Each as if it were alone, but for the draws; of many trials normal ones."""
    cells = [(4200, 1800, 2000, 4000), (300, 300, 100, 500), (40, 10, 20, 30)]
    every = estimate_agreements(np.array(cells))
    for own, found in zip(cells, every, strict=True):
        alone = estimate_agreement(np.array(own))
        for name in AGREEMENT_MEASURES:
            a, b = alone.figure(name), found.figure(name)
            assert a.value == b.value and a.low is not None and a.high is not None
            tolerance = 0.1 * (a.high - a.low)
            assert (b.low, b.high) == pytest.approx((a.low, a.high), abs=tolerance), name
    n = 12000  # predicted 6000, actual 6200: the difference of a matched pair
    error = np.sqrt((1800 + 2000) / n - (200 / n) ** 2) / np.sqrt(n)
    for found in (every[0].excess, compare_paired_counts(*cells[0]).difference):
        assert found.value == pytest.approx(-200 / n)
        bounds_of_normal = (-200 / n - 1.96 * error, -200 / n + 1.96 * error)
        assert (found.low, found.high) == pytest.approx(bounds_of_normal, abs=0.1 * error)


def test_prior_is_half_a_trial_a_cell() -> None:
    counts = np.array([(3.0, 1, 0, 0), (0, 0, 2, 2), (1, 1, 1, 1)])
    assert distribute_prior(counts, np.array([10.0, 20.0, 30.0])).sum(axis=0) == pytest.approx(
        [CELL_PRIOR] * 4
    )


@given(Cells)
@settings(max_examples=15, deadline=None)
def test_undefined_figures_have_a_reason_and_others_lie_within_their_intervals(
    cells: tuple[int, int, int, int],
) -> None:
    for found in (estimate_agreement(np.array(cells)), *estimate_agreements(np.array([cells]))):
        check(found)


def check(found: Agreement) -> None:
    for name, measure in AGREEMENT_MEASURES.items():
        figure = found.figure(name)
        if figure.value is None:
            assert figure.reason and figure.low is None and figure.high is None
        else:
            assert figure.low is not None and figure.high is not None and not figure.reason
            assert measure.low - 1e-9 <= figure.low <= figure.value
            assert figure.value <= figure.high <= measure.high + 1e-9


@given(st.lists(Cells, min_size=1, max_size=5), st.integers(0, 5))
@settings(max_examples=15, deadline=None)
def test_strata_without_trials_and_of_one_kind(
    counts: list[tuple[int, int, int, int]], seed: int
) -> None:
    population = np.random.default_rng(seed).integers(1, 300, len(counts)).astype(float)
    check(estimate_agreement(np.array(counts), population=population, seed=seed))


@pytest.mark.parametrize(
    ("cells", "undefined"),
    [
        ((0, 0, 0, 0), set(AGREEMENT_MEASURES)),
        ((5, 0, 0, 0), {"specificity", "balanced_accuracy", "matthews", "kappa"}),
        ((0, 0, 0, 5), {"precision", "recall", "f1", "balanced_accuracy", "matthews", "kappa"}),
        ((0, 0, 3, 5), {"precision", "matthews"}),
        ((0, 4, 0, 5), {"recall", "balanced_accuracy", "matthews"}),
        ((1, 1, 1, 1), set()),
    ],
)
def test_what_is_undefined(cells: tuple[int, ...], undefined: set[str]) -> None:
    found = estimate_agreement(np.array(cells))
    assert {name for name in AGREEMENT_MEASURES if found.figure(name).value is None} == undefined


def test_intervals_depend_on_the_seed_alone() -> None:
    counts = np.array((21, 9, 10, 20))
    assert estimate_agreement(counts, seed=4) == estimate_agreement(counts, seed=4)
    assert (
        estimate_agreement(counts, seed=4).matthews != estimate_agreement(counts, seed=5).matthews
    )


def test_swapping_success_and_failure_swaps_the_figures() -> None:
    found, swapped = (
        estimate_agreement(np.array((21, 9, 10, 25))),
        estimate_agreement(np.array((25, 10, 9, 21))),
    )
    assert found.specificity == swapped.recall
    assert found.accuracy == swapped.accuracy
    assert found.matthews.value == pytest.approx(swapped.matthews.value)


@pytest.mark.parametrize("counts", [(20, 9, 3, 8), (5, 1, 0, 2), (3, 7, 7, 1), (0, 0, 12, 0)])
def test_mcnemar_as_statsmodels_has_it(counts: tuple[int, int, int, int]) -> None:
    both, one, other, neither = counts
    found = compare_paired_counts(*counts)
    expected = mcnemar(np.array([[both, one], [other, neither]]), exact=True)
    assert found.p_value == pytest.approx(expected.pvalue)
    assert found.difference.value == pytest.approx((one - other) / sum(counts))


def test_paired_answers_are_counted() -> None:
    first = np.array([True, True, False, False, True])
    found = compare_paired(first, np.array([True, False, True, False, False]))
    assert (found.both, found.only_first, found.only_second, found.neither) == (1, 2, 1, 1)
    assert compare_paired(first, first).p_value == 1.0
    assert compare_paired(first[:0], first[:0]).p_value is None
    assert compare_paired(first[:0], first[:0]).difference.value is None


def test_nothing_warns() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for cells in ((0, 0, 0, 0), (1, 0, 0, 0), (0, 0, 0, 1), (0, 1, 1, 0)):
            estimate_agreement(np.array(cells))
