"""Comparison of methods: p values against closed forms and an independent library."""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np
import pytest

from burg_drake.benchmark import (
    compare_by_suite,
    compare_methods,
    permutation_p_value,
    version_notes,
)
from burg_drake.core import InvalidInputError
from tests.benchmark.judged import LIFTED, SLIPPED, judged, result


@pytest.mark.parametrize(("better", "worse"), [(5, 0), (6, 1), (9, 3), (4, 4)])
def test_differences_of_one_are_mcnemars_exact_test(better: int, worse: int) -> None:
    n, k = better + worse, min(better, worse)
    exact = min(1.0, 2 * sum(comb(n, i) for i in range(k + 1)) / 2**n)
    differences = np.array([1.0] * better + [-1.0] * worse + [0.0] * 7)
    assert permutation_p_value(differences) == pytest.approx(exact, abs=1e-12)


def test_methods_that_are_the_same_do_not_differ() -> None:
    assert permutation_p_value(np.zeros(20)) == 1.0


def test_p_values_of_random_differences_are_uniform() -> None:
    rng = np.random.default_rng(5)
    p = [permutation_p_value(rng.normal(size=9)) for _ in range(300)]
    assert 0.02 <= np.mean(np.array(p) < 0.05) <= 0.09


def made(name: str, lifted: int, n: int = 20, **more: str) -> object:
    answers = [judged(f"s{k}", [LIFTED if k < lifted else SLIPPED]) for k in range(n)]
    return result(answers, name, grasps=1, **more)


def test_the_best_method_comes_first_and_pairs_are_told_apart() -> None:
    found = compare_methods([made("weak", 3), made("strong", 18), made("same", 17)])
    assert found.names == ["strong", "same", "weak"]
    pairs = {(d.first, d.second): d for d in found.differences["top_success"]}
    assert pairs["strong", "weak"].is_significant and pairs["same", "weak"].is_significant
    assert not pairs["strong", "same"].is_significant
    far = pairs["strong", "weak"]
    assert far.difference == pytest.approx(0.75) and far.low < 0.75 < far.high


def test_several_versions_are_noted() -> None:
    def by(drake: str) -> object:
        found = made(drake, 3)
        document = replace(found.document, versions={"drake": drake, "numpy": drake})
        return type(found)(found.path, document, found.suite)

    assert version_notes([by("1.51.1"), by("1.51.1"), made("old", 3)]) == []
    (note,) = version_notes([by("1.51.1"), by("1.58.0")])
    assert "several versions of drake (1.51.1, 1.58.0)" in note


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (made("b", 3, suite_hash="1" * 16), "version is 0{16} in nowhere/a .* but 1{16}"),
        (made("a", 3), "nowhere/a and nowhere/a are both called a; change the name in one bench"),
    ],
)
def test_results_that_do_not_compare_are_refused(other: object, message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        compare_methods([made("a", 3), other])


def test_no_results_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="no results"):
        compare_by_suite([])
