"""Fits the curves of `simulation.confidence`, and holds confidence against confirmations."""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from scipy.optimize import minimize

from burg_drake.core import CONTESTED_CONFIDENCE, Array, Outcome, wilson_interval
from burg_drake.simulation import (
    MAX_LIMIT_DISTANCE,
    Curve,
    Curves,
    Population,
    confidence_from_signs,
)

KNOTS = (0.02, 0.25, 0.5, 0.75, 0.98)
"""Quantiles of a sign's values at which its curve bends."""
OWN_KNOTS = {"limit": (0.0, 0.02, 0.05, 0.1, 0.2, MAX_LIMIT_DISTANCE)}
"""Values at which the curves of other signs bend."""
RIDGE = 0.2
"""Weight of the curves' squares, against the logarithm of the likelihood of all grasps: a sign that
tells little stays flat."""
BIN_EDGES = (0.0, 0.8, 0.9, 0.95, 1.0)
"""Of confidence, for the report."""


@dataclass(frozen=True)
class Judged:
    """An executed verdict, and how often the oracle confirms it.

    Attributes:
        engine: that gave it.
        object: the target.
        held_out: whether nothing is fitted on it.
        kind: of the grasp, see `confidence_trials.Grasp`.
        outcome: by the engine.
        signs: of the verdict.
        confirmed: share of trials, each changed slightly, in which the oracle finds the target
            held, or lost, as well.
    """

    engine: str
    object: str
    held_out: bool
    kind: str
    outcome: Outcome
    signs: Mapping[str, float]
    confirmed: float

    @property
    def confidence(self) -> float:
        """What the package says."""
        found = confidence_from_signs(self.engine, self.outcome, self.signs)
        assert found is not None
        return found


Verdicts = Mapping[str, Sequence[Judged]]
"""By engine."""


def fit_all(verdicts: Verdicts, population: Population) -> str:
    """The calibration as JSON, fitted on the objects that are not held out."""
    engines: dict[str, dict[str, object]] = {}
    for engine, found in verdicts.items():
        # The same simulator with longer steps, for the engine that executes few grasps.
        more = verdicts.get("standard", ()) if engine == "reference" else ()
        fitted = [v for v in (*found, *more) if not v.held_out]
        engines[engine] = {
            name: as_json(fit([v for v in fitted if v.outcome.held is held]))
            for name, held in (("held", True), ("lost", False))
        }
    content = {
        "about": "fitted by benchmarks/confidence.py",
        "population": asdict(population),
        "engines": engines,
    }
    return json.dumps(content, indent=1) + "\n"


def fit(verdicts: Sequence[Judged]) -> Curves:
    """Curves that make the confirmations of verdicts most likely."""
    names = list(verdicts[0].signs)
    values = {name: np.array([v.signs[name] for v in verdicts]) for name in names}
    knots = {
        name: np.array(OWN_KNOTS.get(name, np.unique(np.quantile(x, KNOTS).round(4))))
        for name, x in values.items()
    }
    names = [name for name in names if len(knots[name]) > 1]
    y = np.array([v.confirmed for v in verdicts])
    bases = [np.column_stack([_hat(values[n], knots[n], k) for k in range(len(knots[n]))])
             for n in names]  # fmt: skip
    X = np.column_stack([np.ones(len(y)), *bases])

    def loss(w: Array) -> tuple[float, Array]:
        z = X @ w
        penalty = np.concatenate([[0.0], w[1:]])
        value = np.logaddexp(0.0, z).sum() - y @ z + RIDGE * (penalty @ penalty)
        return float(value), X.T @ (1.0 / (1.0 + np.exp(-z)) - y) + 2.0 * RIDGE * penalty

    w = minimize(loss, np.zeros(X.shape[1]), jac=True, method="L-BFGS-B").x
    w[1 : 1 + len(knots[names[0]])] += w[0]  # the constant, into the first curve
    ends = np.cumsum([1, *(len(knots[name]) for name in names)])
    return {
        name: Curve(tuple(knots[name].tolist()), tuple(w[start:end].tolist()))
        for name, start, end in zip(names, ends, ends[1:], strict=False)
    }


def as_json(curves: Curves) -> dict[str, dict[str, list[float]]]:
    """Curves as the file has them."""
    return {
        name: {"knots": list(c.knots), "logits": [round(v, 4) for v in c.logits]}
        for name, c in curves.items()
    }


def _hat(x: Array, knots: Array, k: int) -> Array:
    """Values (N,) of the piecewise linear function that is 1 at a knot and 0 at the others."""
    return np.interp(x, knots, np.eye(len(knots))[k])


def print_report(verdicts: Verdicts) -> None:
    """Prints how confidence and confirmations agree, by engine and bin of confidence."""
    for engine, found in verdicts.items():
        for title, held_out in (("fitted on", False), ("held out", True)):
            print_bins(f"{engine}, {title}", [v for v in found if v.held_out is held_out])


def print_bins(title: str, verdicts: Sequence[Judged]) -> None:
    """A line for each bin."""
    said = np.array([v.confidence for v in verdicts])
    contested = np.mean(said < CONTESTED_CONFIDENCE)
    print(
        f"\n{title}: {len(verdicts)} verdicts on {len({v.object for v in verdicts})} objects,"
        f" {contested:.1%} contested (below {CONTESTED_CONFIDENCE:g})"
    )
    print(f"{'confidence':14} {'said':>7} {'confirmed':>9}  {'95 % interval':>16} {'of':>5}  error")
    for low, high in itertools.pairwise(BIN_EDGES):
        mine = [v for v, p in zip(verdicts, said, strict=True) if low <= p < high]
        if mine:
            one = summarize_bin(mine)
            print(
                f"{low:.2f} to {high:.2f}   {one.said:7.2%} {one.confirmed:9.2%}"
                f"  {one.low:6.1%} to {one.high:6.1%} {one.count:5}  {one.error:.3f}"
            )


@dataclass(frozen=True)
class BinSummary:
    """Verdicts with about the same confidence.

    Attributes:
        count: number of verdicts.
        said: their mean confidence.
        confirmed: share that the oracle confirms.
        low, high: 95 % interval of `confirmed`, Wilson's, as if each verdict were tried once.
    """

    count: int
    said: float
    confirmed: float
    low: float
    high: float

    @property
    def error(self) -> float:
        """Difference of what was said and what was confirmed."""
        return abs(self.said - self.confirmed)


def summarize_bin(verdicts: Sequence[Judged]) -> BinSummary:
    """What was said of some verdicts, and how many are confirmed."""
    same = sum(v.confirmed for v in verdicts)
    said = float(np.mean([v.confidence for v in verdicts]))
    low, high = wilson_interval(round(same), len(verdicts))
    return BinSummary(len(verdicts), said, same / len(verdicts), low, high)
