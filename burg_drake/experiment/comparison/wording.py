"""A comparison in words, and its numbers as people read them."""

from __future__ import annotations

from collections.abc import Mapping

from burg_drake.core.grasps import outcome_label
from burg_drake.core.terminal import MISSING, format_number
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.standing_out import OutlierGroup
from burg_drake.experiment.statistics import (
    MEASURES,
    MIN_OF_EACH_OUTCOME,
    PROBABILITY,
    Agreement,
    Estimate,
)

IN_PERCENT = frozenset(name for name, measure in MEASURES.items() if measure.is_share) | {"excess"}
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
NAMES_OF_RUNS = {
    "predicted": "success in the first run",
    "actual": "success in the second run",
    "excess": "success in the first less the second",
}
"""Cells and figures of two runs, of which neither is the truth."""


def of_selected(comparison: Comparison) -> str:
    """What titles add to say of which trials their figures are; nothing where all count alike."""
    return "" if comparison.kind == "runs" else ", selected trials"


def cell_name(comparison: Comparison, cell: str) -> str:
    """What the grasps of a cell of the matrix have in common."""
    return (CELL_NAMES_OF_RUNS if comparison.kind == "runs" else CELL_NAMES)[cell]


def measure_name(comparison: Comparison, key: str) -> str:
    """What a figure is called."""
    if comparison.kind == "runs" and key in NAMES_OF_RUNS:
        return NAMES_OF_RUNS[key]
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
    c, found = comparison, estimated(comparison.judgement)
    if have_same_rows(c):
        return _same_rows_words(c)
    if c.kind == "runs":
        return (
            f"On {found.trials:,} grasps the two runs agree in {brief(found.accuracy)}: success in"
            f" {brief(found.predicted)} by the first ({c.first.label}) and in"
            f" {brief(found.actual)} by the second ({c.reference.label})."
        )
    plural = "" if found.trials == 1 else "s"
    trials = f"{found.trials:,} trial{plural} on the robot"
    where = f"In {trials}"
    if weighted(c.judgement) is not None:
        stand = "stand" if plural else "stands"
        where = f"Estimated for the {round(sum(found.cells)):,} grasps that {trials} {stand} for,"
    if c.other is not None and c.second is not None and c.difference is not None:
        first, second = f"the first simulator ({c.first.label})", f"the second ({c.second.label})"
        p = (
            ""
            if c.difference.p_value is None
            else f" (McNemar p = {format_number(c.difference.p_value)})"
        )
        return (
            f"{where} {first} was right in {brief(found.accuracy)}, {second} in"
            f" {brief(estimated(c.other).accuracy)}; {difference_words(c)}{p}."
        )
    true = f"Of the grasps that it expected to succeed, {brief(found.precision)} succeeded"
    foreseen = f"of the grasps that succeeded, it had expected {brief(found.recall)}"
    if found.precision.value is None:
        true = "It expected no grasp to succeed"
    if found.recall.value is None:
        foreseen = "no grasp succeeded"
    right = f"{where} the simulator's verdict was right for {brief(found.accuracy)} of the grasps"
    return f"{right}. {true}; {foreseen}. In brackets: 95 % intervals."


def estimated(judged: Judgement) -> Agreement:
    """The figures that sentences are made of: of all grasps that the trials stand for, if known;
    figures of the trials themselves depend on how many of which were chosen."""
    return weighted(judged) or judged.selected


def weighted(judged: Judgement) -> Agreement | None:
    """Figures of all grasps that the trials stand for; None if that is not known, or if they stand
    for themselves alone."""
    found = judged.all_grasps
    return None if found is None or round(sum(found.cells)) <= found.trials else found


def have_same_rows(comparison: Comparison) -> bool:
    """Whether two runs have the same rows, of which no figure of agreement says anything."""
    found = comparison.agreement
    return found is not None and found.same_rows == comparison.coverage.compared


def _same_rows_words(c: Comparison) -> str:
    why = "their settings differ, which changed nothing"
    if c.first.hashes == c.reference.hashes:
        why = f"both are run {', '.join(c.first.hashes[:3])}, one a copy of the other"
    elif not c.settings:
        why = "they were made with the same settings"
    return (
        f"The {c.coverage.compared:,} rows of both runs are the same, in outcome, stage and every"
        f" margin: {why}. They are one opinion, not two."
    )


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


def difference_of_all_words(comparison: Comparison) -> str:
    """Which of two simulators is right about more of the grasps that the trials stand for; empty
    where nothing says what they were chosen from."""
    found = comparison.difference_of_all
    if found is None or found.value is None:
        return ""
    return (
        f"Of all grasps that the trials stand for, the first is right about"
        f" {100 * found.value:+.1f} percentage points more {interval(found, percent=True)}."
    )


def bias_words(comparison: Comparison, judged: Judgement | None = None) -> str:
    """Whether a simulator promises too much: of all grasps that the trials stand for, if that is
    known, and then of the trials themselves as well, whose mix may turn it round."""
    judged = judged or comparison.judgement
    b = judged.bias
    if b.difference.value is None:
        return "no trials"
    parted = (
        f"{b.only_first:,} failed that it expected to succeed, {b.only_second:,} succeeded that it"
        " expected to fail"
    )
    who, other = "simulator promises", "the robot achieved"
    if comparison.kind == "runs":
        who, other = "first run sees", "the second"
        parted = (
            f"{b.only_first:,} succeeded in the first alone, {b.only_second:,} in the second alone"
        )
    elif comparison.other is not None:
        which = "second" if judged is comparison.other else "first"
        who = f"{which} simulator promises"
    every = weighted(judged)
    if every is not None and every.excess.value is not None:
        return (
            f"Over all these grasps the {who} {_more(every.excess.value, 'success than')} {other}"
            f" {interval(every.excess, percent=True)}. In the selected trials alone, each counted"
            f" once, it promises {_more(b.difference.value, 'than')} {other}: of {b.trials:,}"
            f" grasps, {parted}."
        )
    return (
        f"The {who} {_more(b.difference.value, 'success than')} {other}"
        f" {interval(b.difference, percent=True)}: of {b.trials:,} grasps, {parted}"
        f" (McNemar's exact test: p = {format_number(b.p_value)})."
    )


def _more(difference: float, of: str) -> str:
    """A difference in percentage points, as words."""
    if difference == 0:
        return f"just as much {of.replace('than', 'as')}"
    more = "more" if difference > 0 else "less"
    return f"{100 * abs(difference):.1f} percentage points {more} {of}"


def unpredictable_words(judged: Judgement) -> str:
    """Failures that a run of the hand alone does not predict, and precision without them; empty if
    there are none."""
    found = judged.unpredictable
    if found is None:
        return ""
    count = sum(found.outcomes.values())
    without = found.selected if weighted(judged) is None else found.all_grasps or found.selected
    return (
        f"{count:,} trial{'' if count == 1 else 's'} failed for reasons that a run of the hand"
        f" alone cannot predict ({counts_words(found.outcomes)}),"
        f" {found.predicted_successes:,} of them after a predicted success. They count as"
        f" failures; without them precision is {brief(without.precision)}"
        f" instead of {brief(estimated(judged).precision)}."
    )


def too_few_for_margins(comparison: Comparison, judged: Judgement) -> str:
    """Why nothing is said of how margins rank trials; empty where something is, or where there are
    no margins."""
    found = judged.calibration
    if not found or any(c.auroc.value is not None for c in found):
        return ""
    most = max(found, key=lambda c: min(c.successes, c.trials - c.successes))
    return (
        f"Too few trials to tell which margins predict {success_of(comparison)}: that takes"
        f" {MIN_OF_EACH_OUTCOME} successes and {MIN_OF_EACH_OUTCOME} failures; there are"
        f" {most.successes} and {most.trials - most.successes}."
    )


def counts_words(outcomes: Mapping[str, int]) -> str:
    """Outcomes with how often they occur."""
    return ", ".join(f"{n:,} {outcome_label(name)}" for name, n in outcomes.items())


def standing_out_name(one: OutlierGroup) -> str:
    """Name of an outlier group for people."""
    return outcome_label(one.name) if one.kind == "verdict" else one.name


def standing_out_words(judged: Judgement) -> str:
    """A sentence on the outlier groups; empty if there are none."""
    parts = [
        f"{standing_out_name(one)} ({one.kind}; {one.wrong} of {one.trials} predicted"
        f" {'successes failed' if one.predicted else 'failures succeeded'}, of all others"
        f" {one.other_wrong} of {one.other_trials})"
        for one in judged.standing_out
    ]
    return f"What stands out: {', '.join(parts)}." if parts else ""


def nothing_stands_out(judged: Judgement) -> str:
    """A sentence for judgements without outlier groups."""
    if not judged.tested_groups:
        return "Too few trials to tell whether verdicts of an object or a cause stand out."
    groups = f"{judged.tested_groups} groups" if judged.tested_groups > 1 else "group"
    return (
        f"No object, verdict or body in the way stands out among the {groups} that were tested"
        " (Fisher's exact test with Holm's correction)."
    )


def margin_title(name: str) -> tuple[str, str, float]:
    """What a margin is called, its unit for people, and how many of them its column's unit is."""
    from burg_drake.core.grasps import shown_unit

    if name == PROBABILITY:
        return "predicted probability", "", 1.0
    if name.endswith("_mm"):
        return name.removesuffix("_mm").replace("_", " "), "mm", 1.0
    return name.replace("_", " "), *shown_unit(name)
