"""Fits the curves of `simulation.confidence`, and holds confidence against confirmations."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from burg_drake.core import CONTESTED_CONFIDENCE, Array, Outcome, wilson_interval
from burg_drake.simulation import MAX_LIMIT_DISTANCE, Curve, Curves, confidence_from_signs

KNOTS = (0.02, 0.25, 0.5, 0.75, 0.98)
"""Quantiles of a sign's values at which its curve bends."""
OWN_KNOTS = {"limit": (0.0, 0.02, 0.05, 0.1, 0.2, MAX_LIMIT_DISTANCE)}
"""Values at which the curves of other signs bend."""
RIDGE = 0.3
"""Weight of the curves' squares, against the logarithm of the likelihood of all grasps: a sign that
tells little stays flat."""
BINS = 10
SURE = 0.95
"""Verdicts with more confidence are to be confirmed by the oracle."""
FEW = 20
"""Verdicts of one kind; of fewer no curves are fitted."""


@dataclass(frozen=True)
class Judged:
    """An executed verdict, and who confirms it.

    Attributes:
        engine: that gave it.
        object: the target.
        held_out: whether nothing is fitted on it.
        kind: of the grasp, see `confidence_trials.Grasp`.
        outcome: by the engine.
        signs: of the verdict.
        worlds: 1 where a perturbed world gives the same, else 0.
        oracle: likewise; None if it was not asked.
    """

    engine: str
    object: str
    held_out: bool
    kind: str
    outcome: Outcome
    signs: Mapping[str, float]
    worlds: Sequence[float]
    oracle: float | None

    @property
    def confirmed(self) -> float:
        """Share of confirmations; the oracle counts as much as all worlds together."""
        parts = [float(np.mean(self.worlds))] if self.worlds else []
        parts += [] if self.oracle is None else [self.oracle]
        return float(np.mean(parts)) if parts else math.nan


Verdicts = Mapping[str, Sequence[Judged]]
"""By engine."""


def fit_all(verdicts: Verdicts) -> str:
    """The calibration as JSON, fitted on the objects that are not held out."""
    engines = {}
    for engine, found in verdicts.items():
        engines[engine] = parts = {}
        for kind in (True, False):
            mine = [
                v
                for v in found
                if not v.held_out and v.outcome.held is kind and math.isfinite(v.confirmed)
            ]
            if len(mine) >= FEW:
                parts["held" if kind else "lost"] = as_json(fit(mine))
    about = "fitted by benchmarks/confidence.py"
    return json.dumps({"about": about, "engines": engines}, indent=1) + "\n"


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
    """Prints how confidence and confirmations agree, by engine, on the objects of either half."""
    for engine, found in verdicts.items():
        for title, mine in (
            ("fitted on", [v for v in found if not v.held_out]),
            ("held out", [v for v in found if v.held_out]),
            *(
                (f"held out, {kind}", [v for v in found if v.held_out and v.kind == kind])
                for kind in ("ordinary", "hard", "limit")
            ),
        ):
            print_half(f"{engine}, {title}", mine)


def print_half(title: str, verdicts: Sequence[Judged]) -> None:
    """The figures of some verdicts."""
    said = [(v, confidence_from_signs(v.engine, v.outcome, v.signs)) for v in verdicts]
    known = [(v, p) for v, p in said if p is not None]
    if not known:
        print(f"{title}: no verdict has a confidence")
        return
    p = np.array([p for _, p in known])
    print(f"\n{title}: {len(known)} executed grasps of {len({v.object for v, _ in known})} objects")
    print(f"  contested (below {CONTESTED_CONFIDENCE:g}): {np.mean(p < CONTESTED_CONFIDENCE):.1%}")
    for who, ask in CONFIRMATIONS.items():
        y = np.array([ask(v) for v, _ in known])
        asked = np.isfinite(y)
        if not asked.any():
            continue
        q, y = p[asked], y[asked]
        print(
            f"  {who:16} {len(y):5} grasps, confirmed {y.mean():.1%}, said {q.mean():.1%},"
            f" calibration error {calibration_error(q, y):.3f}, Brier {np.mean((q - y) ** 2):.4f}"
        )
        sure = q > SURE
        if sure.any():
            n, k = int(sure.sum()), float(y[sure].sum())
            low, high = wilson_interval(round(k), n)
            print(f"    above {SURE:g}: {k / n:.1%} of {n} ({low:.1%} to {high:.1%})")


def _worlds(verdict: Judged) -> float:
    return float(np.mean(verdict.worlds)) if verdict.worlds else math.nan


def _oracle(verdict: Judged) -> float:
    return math.nan if verdict.oracle is None else verdict.oracle


CONFIRMATIONS: Mapping[str, Callable[[Judged], float]] = {
    "worlds": _worlds,
    "oracle": _oracle,
    "both": lambda verdict: verdict.confirmed,
}


def calibration_error(p: Array, y: Array, bins: int = BINS) -> float:
    """Expected calibration error over bins of as many verdicts each.

    Args:
        p: (N,) confidence.
        y: (N,) shares of confirmations.
        bins: their number.
    """
    order = np.argsort(p, kind="stable")
    parts = np.array_split(order, bins)
    return float(sum(len(k) * abs(p[k].mean() - y[k].mean()) for k in parts if len(k)) / len(p))
