"""Robust least squares of an object's displacement, with a covariance that holds where the errors
of neighbours are alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array

TUKEY = 4.685
"""Residual, in standard deviations, from which on nothing counts: 95 % efficiency on normal
errors [Huber and Ronchetti, Robust Statistics, 2009]."""
CONSISTENT = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""


ROUNDS = 12


@dataclass(frozen=True, eq=False)
class DisplacementFit:
    """A displacement that measurements agree on.

    Attributes:
        step: (3,) x, y [m] and angle [rad]; the angle is 0 where it is not fitted.
        covariance: (3, 3) of it.
        weights: (N,) of the measurements, in [0, 1]; 0 for outliers.
        scale: standard deviation of the measurements over what they claim.
        sensitivity: (3, N) by how much each measurement moves the result.
    """

    step: Array
    covariance: Array
    weights: Array
    scale: float
    sensitivity: Array


def fit_displacement(
    along: Array,
    offset: Array,
    deviation: Array,
    groups: NDArray[np.int64],
    symmetric: bool,
    unit: Array,
    nuisance: Array | None = None,
) -> DisplacementFit | None:
    """Solves `along @ step + nuisance @ unknown = offset` with Tukey's weights.

    Args:
        along: (N, 3).
        offset: (N,) measured.
        deviation: (N,) standard deviations of `offset`.
        groups: (N,) number of the neighbourhood that a measurement belongs to. The covariance is
            the sandwich of clustered errors [White 1980; Liang and Zeger 1986]: errors may be alike
            within a neighbourhood.
        symmetric: leave the angle out.
        unit: (3,) typical sizes of the step's parts, against bad scaling.
        nuisance: (N, M) what other unknowns, of mean 0 and standard deviation 1, add to `offset`.

    Returns:
        None if the measurements do not determine the step.
    """
    used = [0, 1] if symmetric else [0, 1, 2]
    extra = np.empty((len(offset), 0)) if nuisance is None else nuisance
    A = np.hstack([(along * unit)[:, used], extra]) / deviation[:, None]
    b = offset / deviation
    prior = np.diag([0.0] * len(used) + [1.0] * extra.shape[1])
    solved = _robust(A, b, prior, len(used))
    if solved is None:
        return None
    x, weights, scale = solved
    bread = np.linalg.inv((A * weights[:, None]).T @ A + prior)
    scores = A * (weights * (b - A @ x))[:, None]
    _, group = np.unique(groups, return_inverse=True)
    sums = np.zeros((group.max() + 1, A.shape[1]))
    np.add.at(sums, group, scores)
    few = len(sums) / max(len(sums) - len(used), 1)
    covariance = few * bread @ sums.T @ sums @ bread + bread
    n, unit = len(used), unit[used]
    step, spread, gain = np.zeros(3), np.zeros((3, 3)), np.zeros((3, len(b)))
    step[used] = x[:n] * unit
    spread[np.ix_(used, used)] = covariance[:n, :n] * np.outer(unit, unit)
    gain[used] = unit[:, None] * (bread @ (A * weights[:, None]).T)[:n] / deviation
    return DisplacementFit(step, spread, weights, scale, gain)


def _robust(A: Array, b: Array, prior: Array, n: int) -> tuple[Array, Array, float] | None:
    """Solution, weights and scale of `A x = b`; None where its first `n` are not determined."""
    if len(b) < 4 * n:
        return None
    x: Array = np.zeros(A.shape[1])
    scale = max(CONSISTENT * float(np.median(np.abs(b))), 1.0)
    weights: Array = np.ones(len(b))
    for _ in range(ROUNDS):
        weights = _tukey((b - A @ x) / scale)
        if weights.sum() < 4 * n:
            return None
        normal = (A * weights[:, None]).T @ A + prior
        values = np.linalg.eigvalsh(normal[:n, :n])
        if values[0] <= 1e-6 * values[-1]:
            return None
        x = np.asarray(np.linalg.solve(normal, (A * weights[:, None]).T @ b), dtype=float)
        near = (b - A @ x)[weights > 0.0]
        scale = max(min(scale, CONSISTENT * float(np.median(np.abs(near)))), 0.3)
    return x, weights, scale


def _tukey(residual: Array) -> Array:
    r = residual / TUKEY
    return np.where(np.abs(r) < 1.0, (1.0 - r**2) ** 2, 0.0)
