"""A comparison in words, and its numbers as people read them."""

from __future__ import annotations

from burg_drake.core.terminal import MISSING, format_number
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.statistics import MEASURES, PROBABILITY, Estimate

SHARES = frozenset(name for name, measure in MEASURES.items() if measure.is_share)
CELL_NAMES = {
    "tp": "success predicted and seen",
    "fp": "success predicted, failure seen",
    "fn": "failure predicted, success seen",
    "tn": "failure predicted and seen",
}
CELL_NAMES_OF_RUNS = {
    "tp": "success in both runs",
    "fp": "success in the first run, failure in the second",
    "fn": "failure in the first run, success in the second",
    "tn": "failure in both runs",
}
"""Cells of two runs, of which neither is the truth."""


def of_selected(comparison: Comparison) -> str:
    """What titles add to say of which trials their figures are; nothing where all count alike."""
    return "" if comparison.kind == "runs" else ", selected trials"


def cell_name(comparison: Comparison, cell: str) -> str:
    """What the grasps of a cell of the matrix have in common."""
    return (CELL_NAMES_OF_RUNS if comparison.kind == "runs" else CELL_NAMES)[cell]


def measure_name(comparison: Comparison, key: str) -> str:
    """What a figure is called."""
    if comparison.kind == "runs" and key in ("predicted", "actual"):
        return f"success in the {'first' if key == 'predicted' else 'second'} run"
    return MEASURES[key].name


def success_of(comparison: Comparison) -> str:
    """What margins are to tell of."""
    return "success in the second run" if comparison.kind == "runs" else "actual success"


def number(found: Estimate, *, percent: bool) -> str:
    """The value of a figure."""
    if found.value is None:
        return MISSING
    return f"{100 * found.value:.2f} %" if percent else f"{found.value + 0.0:.3f}"


def interval(found: Estimate, *, percent: bool) -> str:
    """The interval of a figure in brackets; empty if there is none."""
    if found.low is None or found.high is None:
        return ""
    bounds, decimals = [found.low, found.high], 2
    if percent:
        bounds = [100 * bound for bound in bounds]
        decimals = 0 if bounds[1] - bounds[0] >= 2.0 else 1
    low, high = (f"{round(bound, decimals) + 0.0:.{decimals}f}" for bound in bounds)
    return f"[{low}, {high}]"


def brief(found: Estimate) -> str:
    """A share in whole per cents with its interval."""
    if found.value is None:
        return f"undefined ({found.reason})"
    return f"{100 * found.value:.0f} % {interval(found, percent=True)}"


def headline(comparison: Comparison) -> str:
    """What was found, in one sentence."""
    c, found = comparison, comparison.judgement.selected
    if c.kind == "runs":
        return (
            f"On {found.trials:,} grasps the two runs agree in {brief(found.accuracy)}: success in"
            f" {brief(found.predicted)} by the first ({c.first.label}) and in"
            f" {brief(found.actual)} by the second ({c.reference.label})."
        )
    plural = "" if found.trials == 1 else "s"
    trials = f"In {found.trials:,} trial{plural} on the robot"
    if c.other is not None and c.second is not None and c.difference is not None:
        first, second = f"the first simulator ({c.first.label})", f"the second ({c.second.label})"
        p = (
            ""
            if c.difference.p_value is None
            else f" (McNemar p = {format_number(c.difference.p_value)})"
        )
        return (
            f"{trials} {first} was right in {brief(found.accuracy)}, {second} in"
            f" {brief(c.other.selected.accuracy)}; {difference_words(c)}{p}."
        )
    true = f"of the successes that it predicted {brief(found.precision)} came true"
    foreseen = f"of those that came about it had predicted {brief(found.recall)}"
    if found.precision.value is None:
        true = "it predicted no success"
    if found.recall.value is None:
        foreseen = "none came about"
    right = f"{trials} the simulator's verdict was right in {brief(found.accuracy)}"
    return f"{right}; {true}, {foreseen}."


def alike_words(comparison: Comparison) -> str:
    """How often two runs hold the same grasps, and which engine each is; nothing of others."""
    c, found = comparison, comparison.agreement
    if found is None:
        return ""
    kappa = "undefined" if found.kappa.value is None else number(found.kappa, percent=False)
    bounds = interval(found.kappa, percent=False)
    return (
        f"Held in both or in neither: {brief(found.alike)}; Cohen's kappa"
        f" {f'{kappa} {bounds}'.rstrip()}. First: {c.first.engines}; second:"
        f" {c.reference.engines}."
    )


def difference_words(comparison: Comparison) -> str:
    """Which of two simulators was right where the other was wrong."""
    d = comparison.difference
    if d is None:
        return ""
    return f"in {d.only_first} trials only the first was right, in {d.only_second} only the second"


def bias_words(comparison: Comparison, judged: Judgement | None = None) -> str:
    """Whether a simulator promises too much."""
    b = (judged or comparison.judgement).bias
    if b.difference.value is None:
        return "no trials"
    more = "more" if b.difference.value > 0 else "less"
    size = f"{100 * abs(b.difference.value):.1f} percentage points {more} success than"
    if b.difference.value == 0:
        size = "just as much success as"
    parted = (
        f"{b.only_first:,} predicted successes did not come true, {b.only_second:,} came about"
        " against the prediction"
    )
    who, other = ("simulator promises", "the robot achieved")
    if comparison.kind == "runs":
        who, other = "first run sees", "the second"
        parted = (
            f"{b.only_first:,} are a success in the first alone, {b.only_second:,} in the second"
            " alone"
        )
    elif comparison.other is not None:
        which = "second" if judged is comparison.other else "first"
        who = f"{which} simulator promises"
    return (
        f"The {who} {size} {other} {interval(b.difference, percent=True)}: {parted}"
        f" (McNemar's exact test: p = {format_number(b.p_value)})."
    )


def margin_title(name: str) -> tuple[str, str, float]:
    """What a margin is called, its unit for people, and how many of them its column's unit is."""
    from burg_drake.core.grasps import shown_unit

    if name == PROBABILITY:
        return "predicted probability", "", 1.0
    if name.endswith("_mm"):
        return name.removesuffix("_mm").replace("_", " "), "mm", 1.0
    return name.replace("_", " "), *shown_unit(name)
