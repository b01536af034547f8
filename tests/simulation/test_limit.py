"""The search for a limit, against limits that are known."""

from __future__ import annotations

import math

import pytest

from burg_drake.simulation import largest_passing


@pytest.mark.parametrize("limit", [0.0511, 0.3, 7.0, 49.9])
@pytest.mark.parametrize("guess", [1e-9, 0.05, 1.0, 7.1, 1e9])
def test_a_limit_is_found_within_the_tolerance(limit: float, guess: float) -> None:
    tried = []

    def bears(load: float) -> bool:
        tried.append(load)
        return load <= limit

    found = largest_passing(bears, guess=guess, low=0.05, high=50.0, tolerance=0.02)
    assert found <= limit <= found * 1.02
    assert found in tried and len(set(tried)) == len(tried)
    assert all(0.05 <= load <= 50.0 for load in tried)


def test_limits_beyond_what_is_tried() -> None:
    options = {"guess": 1.0, "low": 0.05, "high": 50.0, "tolerance": 0.02}
    assert largest_passing(lambda load: True, **options) == math.inf
    assert largest_passing(lambda load: False, **options) == 0.0


def test_what_is_returned_is_borne_and_the_next_is_not_even_with_gaps() -> None:
    tried = {}

    def bears(load: float) -> bool:
        tried[load] = int(load) % 2 == 0  # holds from 0 to 1, from 2 to 3, ...
        return tried[load]

    found = largest_passing(bears, guess=2.5, low=0.05, high=50.0, tolerance=0.02)
    assert tried[found]
    assert any(found < load <= found * 1.02 and not held for load, held in tried.items())


def test_few_loads_are_tried_near_a_good_guess() -> None:
    tried = []
    largest_passing(
        lambda load: tried.append(load) or load <= 10.0,  # type: ignore[func-returns-value]
        guess=9.0,
        low=0.05,
        high=50.0,
        tolerance=0.03,
    )
    assert len(tried) <= 7
