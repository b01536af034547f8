"""Tables of the findings of a comparison, for a terminal and for a page."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from burg_drake.core import (
    CONTESTED_CONFIDENCE,
    MISSING_NUMBER,
    Stage,
    TextTable,
    format_count,
    format_number,
    outcome_label,
)
from burg_drake.evaluation import command
from burg_drake.experiment.comparison.agreement_between_runs import (
    MarginDifference,
    PartedGrasp,
    RunAgreement,
)
from burg_drake.experiment.comparison.comparison import (
    PERCENT_MEASURES,
    Comparison,
    agreement_sentence,
    bias_sentence,
    estimate_text,
    have_identical_rows,
    headline_sentence,
    margin_title,
    measure_name,
    no_outliers_sentence,
    outcome_counts_text,
    outlier_name,
    population_difference_sentence,
    selection_suffix,
    success_description,
    too_few_trials_sentence,
    unpredictable_sentence,
)
from burg_drake.experiment.comparison.confusion_matrix import (
    AGREEMENT_MEASURES,
    Agreement,
    Estimate,
)
from burg_drake.experiment.comparison.finding_tables import Figure, FindingTable
from burg_drake.experiment.comparison.group_agreement import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.margin_calibration import MarginCalibration
from burg_drake.visualization import join


def comparison_tables(comparison: Comparison) -> Iterator[TextTable | str]:
    """Tables and sentences for a terminal, the most important first."""
    c = comparison
    yield headline_sentence(c)
    if c.agreement is not None and not have_identical_rows(c):
        yield agreement_sentence(c)
        yield from _agreement_tables(c.agreement)
    if words := population_difference_sentence(c):
        yield words
    if not have_identical_rows(c):
        if c.other is None:
            yield from _judgement_tables(c, c.judgement, "")
        else:
            yield from _judgement_tables(c, c.judgement, ", first run")
            yield from _judgement_tables(c, c.other, ", second run")
    yield coverage_sentences(c)
    yield from (f"differs: {text}" for text in c.settings)
    yield from (f"note: {text}" for text in c.notes)


def _agreement_tables(agreement: RunAgreement) -> Iterator[TextTable | str]:
    """Tables of agreement by object, disagreements by stage, and differences of margins; without
    empty tables.
    """
    if len(agreement.objects) > 1:
        yield run_agreement_finding("object", agreement.objects).text_table()
    if agreement.apart:
        yield _stage_table(agreement.apart)
    if agreement.parted:
        yield parted_finding(agreement.parted).text_table()
    if agreement.confidence:
        yield confidence_finding(agreement.confidence).text_table()
    if agreement.margins:
        yield _margin_bin_table(agreement.margins)
    if agreement.differences:
        yield margin_difference_finding(agreement.differences).text_table()


def _judgement_tables(c: Comparison, judgement: Judgement, name: str) -> Iterator[TextTable | str]:
    """Tables and sentences about one run, whose name is added to titles."""
    yield _matrix_table(c, judgement, name)
    yield measure_finding(c, [("", judgement)]).text_table(name)
    yield bias_sentence(c, judgement)
    if judgement.unpredictable is not None:
        yield unpredictable_sentence(judgement)
        yield unpredictable_finding(judgement).text_table(name)
    if c.kind != "runs":
        if judgement.standing_out:
            yield outlier_finding(judgement).text_table(name)
        else:
            yield no_outliers_sentence(judgement)
    for kind, groups in (("object", judgement.objects), ("scene", judgement.scenes)):
        if len(groups) > 1:
            yield group_finding(c, kind, groups).text_table(name)
    yield verdict_finding(c, judgement).text_table(name)
    telling = [m for m in judgement.calibration if m.auroc.value is not None]
    if telling:
        yield margin_finding(c, telling).text_table(name)
    elif words := too_few_trials_sentence(c, judgement):
        yield words
    placement = placement_finding(c, judgement)
    if placement is not None:
        yield placement.text_table(name)


def _matrix_table(comparison: Comparison, judgement: Judgement, name: str) -> TextTable:
    """The confusion matrix."""
    runs = comparison.kind == "runs"
    title = "Verdicts of both runs" if runs else f"Verdicts and outcomes, selected trials{name}"
    other = "in the second" if runs else "on the robot"
    table = TextTable(title).texts("in the first" if runs else "predicted")
    table.numbers(f"success {other}", f"failure {other}")
    found = judgement.selected
    table.row("success", format_count(int(found.tp)), format_count(int(found.fp)))
    table.row("failure", format_count(int(found.fn)), format_count(int(found.tn)))
    return table


def coverage_sentences(comparison: Comparison) -> str:
    """Sentences about compared and omitted grasps."""
    v = comparison.coverage
    what = "grasps" if comparison.kind == "runs" else "trials"
    parts = [f"{v.compared:,} {what} compared"]
    if v.only_first or v.only_second:
        parts.append(f"{v.only_first:,} only in the first, {v.only_second:,} only in the second")
    if v.other_content:
        parts.append(f"{v.other_content:,} with the same id but another pose or width")
    parts += [f"{n:,} left out: {reason.replace('_', ' ')}" for reason, n in v.left_out.items()]
    return "; ".join(parts)


NamedJudgements = Sequence[tuple[str, Judgement]]
"""Name and judgement of each run; the name is empty if there is only one run."""


def measure_finding(comparison: Comparison, judgements: NamedJudgements) -> FindingTable:
    """Table of all measures of the selected trials and of all grasps, with their intervals."""
    captions = []
    text = "Intervals are 95 % intervals: Wilson's for shares, a Bayesian bootstrap for all others."
    for _, judgement in judgements:
        if judgement.all_grasps is not None:
            grasps = format_count(round(sum(judgement.all_grasps.cells)))
            captions.append(
                f"selected trials: the {judgement.selected.trials} that were compared; all grasps:"
                f" the {grasps} that they stand for, each for its share of those that it was chosen"
                " from"
            )
            text = (
                "The grasps were chosen from strata. Figures of the selected trials describe"
                " this experiment. In figures for all grasps each trial stands for its share"
                " of a stratum; they describe what a user of the simulator can expect. 95 %"
                " intervals: Wilson's for shares of the selected trials; a Bayesian"
                " bootstrap within strata for all others."
            )
    columns = _named_agreements(judgements)
    reasons = {a.figure(key).reason for key in AGREEMENT_MEASURES for _, a in columns} - {""}
    if reasons:
        captions.append(f"-: cannot be calculated ({'; '.join(sorted(reasons))})")
    found = FindingTable(title="Figures", caption="\n".join(captions), text=text, style="figures")
    found.texts("figure").figures(*(name for name, _ in columns))
    for key in AGREEMENT_MEASURES:
        figures = (Figure(a.figure(key), key in PERCENT_MEASURES) for _, a in columns)
        found.row(measure_name(comparison, key), *figures)
    return found


def _named_agreements(judgements: NamedJudgements) -> list[tuple[str, Agreement]]:
    """Agreement of the selected trials, and of all grasps where that is known."""
    found = []
    for name, judgement in judgements:
        suffix = f", {name}" if name else ""
        found.append((f"selected trials{suffix}", judgement.selected))
        if judgement.all_grasps is not None:
            found.append((f"all grasps{suffix}", judgement.all_grasps))
    return found if len(found) > 1 else [("value", found[0][1])]


def unpredictable_finding(judgement: Judgement) -> FindingTable:
    """Table of figures with and without failures that the hand alone does not predict."""
    measures = ("precision", "recall", "accuracy")
    assert judgement.unpredictable is not None
    pairs = [("trials", judgement.selected, judgement.unpredictable.selected)]
    if judgement.all_grasps is not None and judgement.unpredictable.all_grasps is not None:
        pairs = [("selected trials", *pairs[0][1:])]
        pairs.append(("all grasps", judgement.all_grasps, judgement.unpredictable.all_grasps))
    found = FindingTable(
        title="With and without outcomes that the hand alone cannot predict",
        page_title="What the hand alone cannot predict",
        text=unpredictable_sentence(judgement),
        style="figures",
    )
    found.texts("of").figures(*measures)
    for name, every, without in pairs:
        for which, agreement in (("with", every), ("without", without)):
            figures = (Figure(agreement.figure(key)) for key in measures)
            found.row(f"{name}, {which}", *figures)
    return found


def outlier_finding(judgement: Judgement) -> FindingTable:
    """Table of objects and causes whose verdicts are wrong more often than those of others."""
    caption = (
        "wrong more often than others with the same prediction: Fisher's exact test, one-sided"
        f" mid-p, corrected by Holm's method for {judgement.tested_groups} groups"
    )
    text = (
        "Objects, verdicts and bodies in the way for which predictions were wrong more"
        " often than for others with the same prediction. p: one-sided mid-p of Fisher's"
        f" exact test with Holm's correction for the {judgement.tested_groups} tested"
        " groups: if nothing differs, nothing is named in 19 of 20 experiments."
    )
    if judgement.unpredictable is not None:
        caption += "; without what the hand alone cannot predict"
        text += " Failures that the hand alone cannot predict are left out."
    found = FindingTable(title="What stands out", caption=caption, text=text)
    found.names("what", "").texts("predicted").numbers("wrong", "others wrong")
    found.texts("ended").numbers("p corrected")
    for group in judgement.standing_out:
        found.row(
            group.kind,
            outlier_name(group),
            "success" if group.predicted else "failure",
            f"{group.wrong} of {group.trials}",
            f"{group.other_wrong} of {group.other_trials}",
            outcome_counts_text(group.ended),
            format_number(group.corrected),
        )
    return found


def group_finding(comparison: Comparison, kind: str, groups: Sequence[FactorGroup]) -> FindingTable:
    """Table of counts and shares by object or scene."""
    right = "same verdict in both runs" if comparison.kind == "runs" else "right verdicts"
    title = f"By {kind}{selection_suffix(comparison)}"
    text = f"Share of {right}, precision and recall, with 95 % intervals."
    return _group_table(title, text, kind, groups)


def placement_finding(comparison: Comparison, judgement: Judgement) -> FindingTable | None:
    """Table of agreement by placement; None if no placement was measured."""
    p = judgement.placement
    if p is None or not p.within.trials + p.beyond.trials:
        return None
    groups = (
        FactorGroup(name=f"all within {p.limit_mm:g} mm", agreement=p.within),
        FactorGroup(name="one farther off", agreement=p.beyond),
        FactorGroup(name="not all measured", agreement=p.unmeasured),
    )
    text = (
        "Where objects were off their planned places, the simulation judged another"
        " scene than the robot had. If agreement is much better in the first row, the"
        " cause is placement and not physics."
    )
    title = f"By placement of the objects{selection_suffix(comparison)}"
    found = _group_table(title, text, "placement", groups)
    area = Figure(p.largest.auroc, percent=False)
    if area.estimate.value is not None:
        found.caption = f"AUROC of the largest offset for right verdicts: {' '.join(area.texts)}"
    return found


def _group_table(title: str, text: str, head: str, groups: Sequence[FactorGroup]) -> FindingTable:
    """Table of counts and shares with intervals by group of trials."""
    found = FindingTable(title=title, text=text, style="groups", max_rows=20, max_page_rows=60)
    found.names(head).numbers("trials", "TP", "FP", "FN", "TN")
    found.shares("right").shares("precision", "recall", interval=False)
    for group in groups:
        a = group.agreement
        shares = map(Figure, (a.accuracy, a.precision, a.recall))
        found.row(group.name, a.trials, *a.cells, *shares)
    return found


def verdict_finding(comparison: Comparison, judgement: Judgement) -> FindingTable:
    """Table of successes on the robot, or in the second run, by verdict and body in the way."""
    first, second, suffix = "simulated", "succeeded", selection_suffix(comparison)
    text = "For each simulated outcome: how many of these grasps succeeded"
    if comparison.kind == "runs":
        first, second = "first run", "success in the second"
        text = "For each outcome in the first run: how many of these grasps succeeded in the second"
    found = FindingTable(
        title=f"Outcomes for each verdict{suffix}",
        page_title=f"How each verdict turned out{suffix}",
        text=f"{text}, with 95 % intervals.",
        style="groups",
        max_rows=20,
        max_page_rows=30,
    )
    found.texts(first).names("body in the way").elements("stage").numbers("trials").shares(second)
    for row in judgement.stopped:
        name = outcome_label(row.outcome)
        found.row(name, row.blocker, row.stage, row.trials, Figure(row.successes))
    return found


def margin_finding(
    comparison: Comparison, calibrations: Sequence[MarginCalibration]
) -> FindingTable:
    """Table of how well each margin with an AUROC ranks success above failure."""
    weighted = any(c.auroc_weighted is not None for c in calibrations)
    trials = "grasps, each trial standing for its share," if weighted else "trials"
    success = success_description(comparison)
    found = FindingTable(
        title=f"How margins predict {success}",
        page_title=f"Do margins predict {success}?",
        caption=(
            "AUROC: how often the better margin is that of the success, of a success and a failure;"
            " 0.5 means no information"
        ),
        text=(
            "AUROC: how often, of a grasp that succeeded and one that failed, the one that"
            " succeeded has the better margin; 0.5 means that the"
            f" margin tells nothing. Dots: share of successes among {trials} in bins of about"
            " equally many trials, with Wilson's intervals. Line: the monotone curve that"
            " fits best; dashes: the share of all."
        ),
        style="figures",
    )
    found.texts("margin", "better").numbers("trials")
    found.figures("AUROC, selected trials" if weighted else "AUROC")
    if weighted:
        found.figures("AUROC, all grasps", interval=False)
    for c in calibrations:
        areas = [c.auroc, c.auroc_weighted or Estimate.undefined("")][: 1 + weighted]
        better = "smaller" if c.smaller_is_better else "larger"
        figures = (Figure(area, percent=False) for area in areas)
        found.row(margin_title(c.name)[0], better, c.trials, *figures)
    return found


def run_agreement_finding(
    head: str, groups: Sequence[FactorGroup], page_title: str = "", text: str = ""
) -> FindingTable:
    """Table of the agreement of two runs on holding, by object or confidence."""
    found = FindingTable(
        title=f"Agreement on holding, by {head}",
        page_title=page_title,
        text=text,
        style="groups",
        max_rows=20,
        max_page_rows=60,
    )
    found.names(head).numbers("grasps").shares("alike").numbers("kappa")
    for group in groups:
        a = group.agreement
        kappa = estimate_text(a.kappa, percent=False)
        found.row(group.name, a.trials, Figure(a.accuracy), kappa)
    return found


def confidence_finding(groups: Sequence[FactorGroup]) -> FindingTable:
    """Table of agreement by the confidence of the first run's verdicts."""
    text = (
        "Share of grasps on which the runs agree (both hold the object, or neither"
        f" does), by the confidence of the first run's verdict. Below {CONTESTED_CONFIDENCE:g} a"
        " verdict is contested."
    )
    title = "Do the runs disagree on contested grasps?"
    return run_agreement_finding("confidence of the first run", groups, title, text)


def deciding_stages(counts: Mapping[str, Mapping[str, int]]) -> list[str]:
    """Names of the stages that decided in the second run, in the order of the stages."""
    return [stage.value for stage in Stage if any(stage.value in row for row in counts.values())]


def _stage_table(apart: Mapping[str, Mapping[str, int]]) -> TextTable:
    """Table of grasps that only one run holds by deciding stage; the page counts all grasps."""
    columns = deciding_stages(apart)
    table = TextTable("Stages that decided the grasps which only one of the runs holds")
    table.texts("first run").numbers(*(f"{name} in the second" for name in columns))
    for stage, row in apart.items():
        table.row(stage, *(format_count(row.get(name, 0)) for name in columns))
    return table


def parted_finding(parted: Sequence[PartedGrasp]) -> FindingTable:
    """Table of the first grasps that only one run holds, with both outcomes; the JSON has all."""
    max_rows = 10  # Grasps in a terminal.
    more = len(parted) - max_rows
    found = FindingTable(
        title="Grasps that only one of the runs holds",
        caption=f"{format_count(more)} more in the JSON" if more > 0 else "",
        text=(
            f"{format_count(len(parted))} grasps. The commands show each one in the first and in"
            " the second run."
        ),
        style="cases",
        max_rows=max_rows,
        max_page_rows=50,
    )
    several_scenes = len({one.scene for one in parted}) > 1
    found.names(*(["scene"] if several_scenes else []), "grasp").texts("first run", "second run")
    found.numbers("confidence of the first").elements("replay")
    for one in parted:
        found.row(
            *([one.scene] if several_scenes else []),
            one.grasp,
            outcome_label(one.first),
            outcome_label(one.second),
            MISSING_NUMBER if one.confidence is None else f"{one.confidence:.3f}",
            join(*(command(line) for line in one.replays)),
        )
    return found


def _margin_bin_table(margins: Sequence[MarginCalibration]) -> TextTable:
    """Table of the share of alike grasps by bins of the first run's margins."""
    table = TextTable("Agreement on holding, along the margins of the first run").texts("margin")
    table.numbers("grasps").texts("from", "alike in each bin [%]", "to")
    for c in margins:
        title, unit, size = margin_title(c.name)
        low, high = (
            f"{format_number(size * end)} {unit}".rstrip()
            for end in (c.bins[0].low, c.bins[-1].high)
        )
        shares = " ".join(f"{100 * (one.share.value or 0.0):.0f}" for one in c.bins)
        table.row(title, format_count(c.trials), low, shares, high)
    table.caption = (
        "each bin has about equally many grasps, from the smallest margin to the"
        " largest; the JSON and the page have bounds and intervals"
    )
    return table


def margin_difference_finding(differences: Sequence[MarginDifference]) -> FindingTable:
    """Table of margin differences of grasps that both runs executed."""
    found = FindingTable(
        title="Margins of grasps that both runs executed: second run minus first",
        page_title="How much margins differ",
        text=(
            "Second run minus first run, for grasps that both executed; sizes are absolute"
            " differences."
        ),
        style="figures",
    )
    found.texts("margin").numbers("grasps", "median", "median size", "90 % within").texts("unit")
    for one in differences:
        title, unit, size = margin_title(one.name)
        values = (format_number(size * v) for v in (one.median, one.median_size, one.within))
        found.row(title, one.grasps, *values, unit)
    return found
