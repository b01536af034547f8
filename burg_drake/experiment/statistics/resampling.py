"""Intervals of any measure of a confusion matrix by resampling its cells within strata.

The cost depends on the number of strata, not of trials. Proportions of the cells of a stratum are
drawn from their Dirichlet distribution given the counts (the Bayesian bootstrap: D. B. Rubin,
Annals of Statistics 9, 1981), since drawing counts anew takes a cell that happens to be empty for
one that cannot be filled: with 10 of 10 right it would be sure that all are. Jeffreys' half a trial
for each cell is shared among the strata by what they stand for, so that many small strata do not
outweigh what was seen. The n trials of a stratum count as n - 2, at least a third, since the spread
within it is taken from them, too. `benchmarks/compare.py` measures the coverage.
"""

from __future__ import annotations

import numpy as np

from burg_drake.core import Array
from burg_drake.experiment.statistics.arrays import Values

DRAWS = 4000
TAILS = (0.025, 0.975)
"""Of 95 % intervals."""
PRIOR = 0.5
"""Trials that are added to each cell, over all strata."""


def draw_cells(
    counts: Values, population: Array, rng: np.random.Generator, draws: int = DRAWS
) -> Array:
    """Confusion matrices that may stand behind the one that was seen.

    Args:
        counts: (S, 4) trials by stratum and cell.
        population: (S,) what each stratum stands for; strata without trials are left out.
        rng: of the draws.
        draws: how many.

    Returns:
        (draws, 4) cells of all strata together, in units of `population`.
    """
    seen = counts.sum(axis=1) > 0
    counts, population = counts[seen].astype(float), population[seen]
    size = counts.sum(axis=1, keepdims=True)
    alpha = counts * np.maximum(size - 2, size / 3) / size + prior(counts, population)
    drawn = rng.standard_gamma(alpha, (draws, *alpha.shape))
    proportions = drawn / drawn.sum(axis=2, keepdims=True)
    expected: Array = np.einsum("dsc,s->dc", proportions, population)
    return expected


def prior(counts: Array, population: Array) -> Array:
    """Half a trial for each cell, shared among the strata with such verdicts by what those stand
    for, or among all where no stratum has such verdicts.

    Args:
        counts: (S, 4) trials by stratum and cell, at least one in each stratum.
        population: (S,) what each stratum stands for.

    Returns:
        (S, 4) the columns sum to `PRIOR`.
    """
    shares = np.empty_like(counts)
    for cells in ((0, 1), (2, 3)):  # success predicted, and not
        of = counts[:, cells].sum(axis=1) / counts.sum(axis=1) * population
        if not of.any():
            of = population
        shares[:, cells] = (of / of.sum())[:, None]
    return PRIOR * shares


def draw_each(counts: Values, rng: np.random.Generator, draws: int = DRAWS) -> Array:
    """As `draw_cells` for many matrices that have nothing to do with each other.

    Args:
        counts: (G, 4) trials by matrix and cell.
        rng: of the draws.
        draws: how many of each.

    Returns:
        (draws, G, 4) proportions.
    """
    drawn = rng.standard_gamma(counts + PRIOR, (draws, *counts.shape))
    share: Array = drawn / drawn.sum(axis=2, keepdims=True)
    return share


def bounds(values: Array) -> tuple[Array, Array]:
    """95 % of the values along the first axis; what is not finite, as where all outcomes of a draw
    are alike, counts as 0.

    Args:
        values: (draws, ...).

    Returns:
        Lower and upper bounds (...).
    """
    finite = np.where(np.isfinite(values), values, 0.0)
    ordered = np.sort(np.ascontiguousarray(np.moveaxis(finite, 0, -1)))
    last = ordered.shape[-1] - 1
    low, high = (_between(ordered, tail * last) for tail in TAILS)
    return low, high


def _between(ordered: Array, place: float) -> Array:
    """What sorted values (..., draws) are at a place between two of them."""
    below = min(int(place), ordered.shape[-1] - 2) if ordered.shape[-1] > 1 else 0
    one, other = ordered[..., below], ordered[..., min(below + 1, ordered.shape[-1] - 1)]
    return one + (other - one) * (place - below)
