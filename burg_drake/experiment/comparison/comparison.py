"""The result of a comparison, as JSON and in sentences."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from burg_drake.core import (
    MISSING_NUMBER,
    count_with_noun,
    display_unit,
    format_number,
    outcome_label,
)
from burg_drake.experiment.comparison.agreement_between_runs import RunAgreement
from burg_drake.experiment.comparison.compared_runs import Side
from burg_drake.experiment.comparison.confusion_matrix import (
    AGREEMENT_MEASURES,
    Agreement,
    Estimate,
    Paired,
)
from burg_drake.experiment.comparison.group_agreement import OutlierGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.margin_calibration import (
    MIN_TRIALS_PER_OUTCOME,
    PROBABILITY_MARGIN,
)
from burg_drake.experiment.trials.trial_sheet import Success


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Numbers of compared and omitted grasps.

    Attributes:
        compared: grasps with a verdict and an outcome.
        only_first, only_second: grasps or trials of one side only.
        other_content: grasps that share only their id.
        left_out: uninformative grasps of both sides, by reason.
    """

    compared: int
    only_first: int = 0
    only_second: int = 0
    other_content: int = 0
    left_out: Mapping[str, int]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A comparison with all its figures; all intervals are 95 % intervals.

    Attributes:
        kind: `trials`, a run against the robot; `runs`, a run against another one; `simulators`,
            two runs against the same trials on the robot.
        success: criterion of success.
        first: the run whose verdicts are predictions.
        second: the other run of `simulators`.
        reference: source of the outcomes: the trials, or the second run of `runs`.
        coverage: which grasps were compared.
        judgement: figures of the first run.
        other: figures of the second run of `simulators`.
        difference: counts of trials by which of the two `simulators` was right.
        difference_of_all: share of right verdicts of the first run minus that of the second, for
            all grasps that the trials stand for; None if the strata are unknown.
        agreement: agreement of the two `runs`, where neither is taken for the truth.
        settings: differing settings of two runs, in words.
        notes: caveats about the figures.
        seed: random seed of the intervals' resampling.
    """

    version: int = 1
    kind: Literal["trials", "runs", "simulators"]
    success: Success
    first: Side
    second: Side | None = None
    reference: Side
    coverage: Coverage
    judgement: Judgement
    other: Judgement | None = None
    difference: Paired | None = None
    difference_of_all: Estimate | None = None
    agreement: RunAgreement | None = None
    settings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seed: int = 0


def comparison_json(comparison: Comparison, more: Mapping[str, Any] | None = None) -> str:
    """A comparison as JSON; keys are the names of the dataclasses' fields.

    Args:
        comparison: the comparison.
        more: further keys.
    """
    return json.dumps(json_values(comparison) | dict(more or {}), indent=2, allow_nan=False) + "\n"


def json_values(value: Any) -> Any:
    """Value for JSON: dataclasses become mappings of all fields, sequences lists, and numbers that
    are not finite None."""
    if dataclasses.is_dataclass(value):
        return {f.name: json_values(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): json_values(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [json_values(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


PERCENT_MEASURES = frozenset(
    name for name, measure in AGREEMENT_MEASURES.items() if measure.is_share
) | {"excess"}
"""Measures that are shown in per cent."""


def selection_suffix(comparison: Comparison) -> str:
    """Suffix of titles of figures that hold for the selected trials; empty for two runs."""
    return "" if comparison.kind == "runs" else ", selected trials"


def cell_name(comparison: Comparison, cell: str) -> str:
    """Displayed name of a cell of the confusion matrix."""
    if comparison.kind == "runs":
        return {
            "tp": "success in both runs",
            "fp": "success in the first run, failure in the second",
            "fn": "failure in the first run, success in the second",
            "tn": "failure in both runs",
        }[cell]
    return {
        "tp": "success predicted and seen",
        "fp": "success predicted, failure seen",
        "fn": "failure predicted, success seen",
        "tn": "failure predicted and seen",
    }[cell]


def measure_name(comparison: Comparison, key: str) -> str:
    """Displayed name of a measure."""
    names_of_runs = {
        "predicted": "success in the first run",
        "actual": "success in the second run",
        "excess": "success in the first less the second",
    }
    if comparison.kind == "runs" and key in names_of_runs:
        return names_of_runs[key]
    return AGREEMENT_MEASURES[key].name


def success_description(comparison: Comparison) -> str:
    """Description of the success that margins should predict."""
    return "success in the second run" if comparison.kind == "runs" else "actual success"


def estimate_text(estimate: Estimate, *, percent: bool) -> str:
    """Displayed value of an estimate."""
    if estimate.value is None:
        return MISSING_NUMBER
    return f"{100 * estimate.value:.2f} %" if percent else f"{estimate.value + 0.0:.3f}"


def bracketed_interval(estimate: Estimate, *, percent: bool) -> str:
    """The interval of a figure in brackets; empty if there is none."""
    if estimate.low is None or estimate.high is None:
        return ""
    bounds, decimals = [estimate.low, estimate.high], 2
    if percent:
        bounds = [100 * bound for bound in bounds]
        decimals = 0 if bounds[1] - bounds[0] >= 2.0 else 1
    low, high = (f"{round(bound, decimals) + 0.0:.{decimals}f}" for bound in bounds)
    return f"[{low}, {high}]"


def brief_share_text(estimate: Estimate) -> str:
    """A share in whole per cents with its interval."""
    if estimate.value is None:
        return f"undefined ({estimate.reason})"
    return f"{100 * estimate.value:.0f} % {bracketed_interval(estimate, percent=True)}"


def headline_sentence(comparison: Comparison) -> str:
    """The main result in one sentence."""
    c, found = comparison, headline_agreement(comparison.judgement)
    if have_identical_rows(c):
        return _identical_rows_sentence(c)
    if c.kind == "runs":
        return (
            f"On {found.trials:,} grasps the two runs agree in {brief_share_text(found.accuracy)}:"
            f" success in {brief_share_text(found.predicted)} by the first ({c.first.label}) and in"
            f" {brief_share_text(found.actual)} by the second ({c.reference.label})."
        )
    trials = f"{count_with_noun(found.trials, 'trial')} on the robot"
    where = f"In {trials}"
    if population_agreement(c.judgement) is not None:
        stand = "stands" if found.trials == 1 else "stand"
        where = f"Estimated for the {round(sum(found.cells)):,} grasps that {trials} {stand} for,"
    if c.other is not None and c.second is not None and c.difference is not None:
        first, second = f"the first simulator ({c.first.label})", f"the second ({c.second.label})"
        d, other = c.difference, brief_share_text(headline_agreement(c.other).accuracy)
        p = "" if d.p_value is None else f" (McNemar p = {format_number(d.p_value)})"
        return (
            f"{where} {first} was right in {brief_share_text(found.accuracy)}, {second} in {other};"
            f" in {d.only_first} trials only the first was right, in {d.only_second} only the"
            f" second{p}."
        )
    precision, recall = brief_share_text(found.precision), brief_share_text(found.recall)
    expected = f"Of the grasps that it expected to succeed, {precision} succeeded"
    succeeded = f"of the grasps that succeeded, it had expected {recall}"
    if found.precision.value is None:
        expected = "It expected no grasp to succeed"
    if found.recall.value is None:
        succeeded = "no grasp succeeded"
    return (
        f"{where} the simulator's verdict was right for {brief_share_text(found.accuracy)} of the"
        f" grasps. {expected}; {succeeded}. In brackets: 95 % intervals."
    )


def headline_agreement(judgement: Judgement) -> Agreement:
    """Figures for sentences: if known, of all grasps that the trials represent, else of the trials
    themselves, whose figures depend on the selection.
    """
    return population_agreement(judgement) or judgement.selected


def population_agreement(judgement: Judgement) -> Agreement | None:
    """Figures of all grasps that the trials represent; None if unknown, or if each trial represents
    itself only.
    """
    found = judgement.all_grasps
    return None if found is None or round(sum(found.cells)) <= found.trials else found


def have_identical_rows(comparison: Comparison) -> bool:
    """Whether two runs have identical rows, so that figures of agreement are meaningless."""
    found = comparison.agreement
    return found is not None and found.same_rows == comparison.coverage.compared


def _identical_rows_sentence(c: Comparison) -> str:
    why = "their settings differ, which changed nothing"
    if c.first.hashes == c.reference.hashes:
        why = f"both are run {', '.join(c.first.hashes[:3])}, one a copy of the other"
    elif not c.settings:
        why = "they were made with the same settings"
    return (
        f"The {c.coverage.compared:,} rows of both runs are the same, in outcome, stage and every"
        f" margin: {why}. They are one opinion, not two."
    )


def agreement_sentence(comparison: Comparison) -> str:
    """Sentence on how often two runs hold the same grasps, with their engines; empty for other
    comparisons.
    """
    c, found = comparison, comparison.agreement
    if found is None:
        return ""
    kappa = "undefined" if found.kappa.value is None else estimate_text(found.kappa, percent=False)
    bounds = bracketed_interval(found.kappa, percent=False)
    return (
        f"Held in both or in neither: {brief_share_text(found.alike)}; Cohen's kappa"
        f" {f'{kappa} {bounds}'.rstrip()}. First: {c.first.engines}; second:"
        f" {c.reference.engines}."
    )


def population_difference_sentence(comparison: Comparison) -> str:
    """Sentence on which of two simulators is right about more of the represented grasps; empty if
    the strata are unknown.
    """
    found = comparison.difference_of_all
    if found is None or found.value is None:
        return ""
    return (
        "Of all grasps that the trials stand for, the first is right about"
        f" {100 * found.value:+.1f} percentage points more"
        f" {bracketed_interval(found, percent=True)}."
    )


def bias_sentence(comparison: Comparison, judgement: Judgement | None = None) -> str:
    """Sentence on the bias of a simulator: on all represented grasps, if known, and on the trials,
    whose selection may reverse the bias.
    """
    judgement = judgement or comparison.judgement
    b = judgement.bias
    if b.difference.value is None:
        return "no trials"
    parted = (
        f"{b.only_first:,} failed that it expected to succeed, {b.only_second:,} succeeded that it"
        " expected to fail"
    )
    claim, other = "simulator promises", "the robot achieved"
    if comparison.kind == "runs":
        claim, other = "first run sees", "the second"
        parted = (
            f"{b.only_first:,} succeeded in the first alone, {b.only_second:,} in the second alone"
        )
    elif comparison.other is not None:
        which = "second" if judgement is comparison.other else "first"
        claim = f"{which} simulator promises"
    population = population_agreement(judgement)
    if population is not None and population.excess.value is not None:
        points = _percentage_points_text(population.excess.value, "success than")
        of_trials = _percentage_points_text(b.difference.value, "than")
        interval = bracketed_interval(population.excess, percent=True)
        return (
            f"Over all these grasps the {claim} {points} {other}"
            f" {interval}. In the selected trials alone, each"
            f" counted once, it promises {of_trials} {other}: of {b.trials:,} grasps, {parted}."
        )
    points = _percentage_points_text(b.difference.value, "success than")
    return (
        f"The {claim} {points} {other}"
        f" {bracketed_interval(b.difference, percent=True)}: of {b.trials:,} grasps, {parted}"
        f" (McNemar's exact test: p = {format_number(b.p_value)})."
    )


def _percentage_points_text(difference: float, ending: str) -> str:
    """A difference in percentage points in words, with an ending such as `success than`."""
    if difference == 0:
        return f"just as much {ending.replace('than', 'as')}"
    more = "more" if difference > 0 else "less"
    return f"{100 * abs(difference):.1f} percentage points {more} {ending}"


def unpredictable_sentence(judgement: Judgement) -> str:
    """Sentence on failures that a run of the hand alone does not predict, and on precision without
    them; empty if there are none.
    """
    found = judgement.unpredictable
    if found is None:
        return ""
    count = sum(found.outcomes.values())
    of_population = None if population_agreement(judgement) is None else found.all_grasps
    without = of_population or found.selected
    return (
        f"{count_with_noun(count, 'trial')} failed for reasons that a run of the hand"
        f" alone cannot predict ({outcome_counts_text(found.outcomes)}),"
        f" {found.predicted_successes:,} of them after a predicted success. They count as"
        f" failures; without them precision is {brief_share_text(without.precision)}"
        f" instead of {brief_share_text(headline_agreement(judgement).precision)}."
    )


def too_few_trials_sentence(comparison: Comparison, judgement: Judgement) -> str:
    """Sentence on too few trials to assess margins; empty if margins are assessed, or if there are
    none.
    """
    found = judgement.calibration
    if not found or any(c.auroc.value is not None for c in found):
        return ""
    most = max(found, key=lambda c: min(c.successes, c.trials - c.successes))
    needed = MIN_TRIALS_PER_OUTCOME
    return (
        f"Too few trials to tell which margins predict {success_description(comparison)}: that"
        f" takes {needed} successes and {needed} failures; there are {most.successes} and"
        f" {most.trials - most.successes}."
    )


def outcome_counts_text(outcomes: Mapping[str, int]) -> str:
    """Text of outcomes with their counts."""
    return ", ".join(f"{n:,} {outcome_label(name)}" for name, n in outcomes.items())


def outlier_name(group: OutlierGroup) -> str:
    """Displayed name of an outlier group."""
    return outcome_label(group.name) if group.kind == "verdict" else group.name


def outlier_sentence(judgement: Judgement) -> str:
    """A sentence on the outlier groups; empty if there are none."""
    parts = [
        f"{outlier_name(group)} ({group.kind}; {group.wrong} of {group.trials} predicted"
        f" {'successes failed' if group.predicted else 'failures succeeded'}, of all others"
        f" {group.other_wrong} of {group.other_trials})"
        for group in judgement.standing_out
    ]
    return f"What stands out: {', '.join(parts)}." if parts else ""


def no_outliers_sentence(judgement: Judgement) -> str:
    """A sentence for judgements without outlier groups."""
    if not judgement.tested_groups:
        return "Too few trials to tell whether verdicts of an object or a cause stand out."
    groups = f"{judgement.tested_groups} groups" if judgement.tested_groups > 1 else "group"
    return (
        f"No object, verdict or body in the way stands out among the {groups} that were tested"
        " (Fisher's exact test with Holm's correction)."
    )


def margin_title(name: str) -> tuple[str, str, float]:
    """Displayed name and unit of a margin, and the factor from the column's to this unit."""
    if name == PROBABILITY_MARGIN:
        return "predicted probability", "", 1.0
    if name.endswith("_mm"):
        return name.removesuffix("_mm").replace("_", " "), "mm", 1.0
    return name.replace("_", " "), *display_unit(name)
