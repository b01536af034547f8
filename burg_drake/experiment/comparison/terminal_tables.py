"""Tables of a comparison for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from burg_drake.core import (
    MISSING_NUMBER,
    Stage,
    TextTable,
    format_count,
    format_number,
    outcome_label,
)
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
    bracketed_interval,
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
from burg_drake.experiment.comparison.confusion_matrix import Agreement
from burg_drake.experiment.comparison.estimates import AGREEMENT_MEASURES
from burg_drake.experiment.comparison.group_agreement import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.margin_calibration import MarginCalibration

MAX_TABLE_ROWS = 20  # Rows of a table in a terminal.
PREDICTION_MEASURES = ("precision", "recall", "accuracy")
"""Measures with and without unpredictable outcomes."""


def comparison_tables(comparison: Comparison) -> Iterator[TextTable | str]:
    """Tables and sentences, the most important first."""
    c = comparison
    yield headline_sentence(c)
    if c.agreement is not None and not have_identical_rows(c):
        yield agreement_sentence(c)
        yield from agreement_tables(c.agreement)
    if words := population_difference_sentence(c):
        yield words
    for name, judged in [] if have_identical_rows(c) else _named_judgements(c):
        of = selection_suffix(c) + name
        yield matrix_table(c, judged, name)
        yield figure_table(c, judged, name)
        yield bias_sentence(c, judged)
        if judged.unpredictable is not None:
            yield unpredictable_sentence(judged)
            yield unpredictable_table(judged, name)
        if c.kind != "runs":
            yield outlier_table(judged, name)
        if len(judged.objects) > 1:
            yield group_table(f"By object{of}", "object", judged.objects)
        if len(judged.scenes) > 1:
            yield group_table(f"By scene{of}", "scene", judged.scenes)
        yield stopped_table(c, judged, of)
        telling = [m for m in judged.calibration if m.auroc.value is not None]
        if telling:
            yield calibration_table(c, telling, name)
        elif words := too_few_trials_sentence(c, judged):
            yield words
        p = judged.placement
        if p is not None and p.within.trials + p.beyond.trials:
            yield placement_table(judged, of)
    yield coverage_sentences(c)
    yield from (f"differs: {text}" for text in c.settings)
    yield from (f"note: {text}" for text in c.notes)


def _named_judgements(comparison: Comparison) -> list[tuple[str, Judgement]]:
    if comparison.other is None:
        return [("", comparison.judgement)]
    return [(", first run", comparison.judgement), (", second run", comparison.other)]


def matrix_table(comparison: Comparison, judged: Judgement, name: str = "") -> TextTable:
    """The confusion matrix."""
    runs = comparison.kind == "runs"
    title = "Verdicts of both runs" if runs else f"Verdicts and outcomes, selected trials{name}"
    other = "in the second" if runs else "on the robot"
    table = TextTable(title).texts("in the first" if runs else "predicted")
    table.numbers(f"success {other}", f"failure {other}")
    found = judged.selected
    table.row("success", format_count(int(found.tp)), format_count(int(found.fp)))
    table.row("failure", format_count(int(found.fn)), format_count(int(found.tn)))
    return table


def figure_table(comparison: Comparison, judged: Judgement, name: str = "") -> TextTable:
    """All figures, of the selected trials and of all grasps."""
    table = TextTable(f"Figures{name}").texts("figure")
    found: list[Agreement] = [judged.selected]
    if judged.all_grasps is None:
        table.numbers("value", "95 % CI")
    else:
        found.append(judged.all_grasps)
        table.numbers("selected trials", "95 % CI", "all grasps", "95 % CI")
        grasps = format_count(round(sum(judged.all_grasps.cells)))
        table.caption = (
            f"selected trials: the {found[0].trials} that were compared; all grasps: the {grasps}"
            " that they stand for, each for its share of those that it was chosen from"
        )
    for key in AGREEMENT_MEASURES:
        cells = []
        for agreement in found:
            f, percent = agreement.figure(key), key in PERCENT_MEASURES
            cells += [
                estimate_text(f, percent=percent),
                bracketed_interval(f, percent=percent) or "-",
            ]
        table.row(measure_name(comparison, key), *cells)
    reasons = {
        f.reason for a in found for f in (a.figure(k) for k in AGREEMENT_MEASURES) if f.reason
    }
    if reasons:
        undefined = f"-: cannot be calculated ({'; '.join(sorted(reasons))})"
        table.caption = f"{table.caption}\n{undefined}" if table.caption else undefined
    return table


def unpredictable_table(judged: Judgement, name: str = "") -> TextTable:
    """Figures with and without failures that the hand alone does not predict."""
    table = TextTable(f"With and without outcomes that the hand alone cannot predict{name}")
    table.texts("of")
    for key in PREDICTION_MEASURES:
        table.numbers(key, "95 % CI")
    for title, found in rows_without_unpredictable(judged):
        cells = []
        for f in map(found.figure, PREDICTION_MEASURES):
            cells += [estimate_text(f, percent=True), bracketed_interval(f, percent=True) or "-"]
        table.row(title, *cells)
    return table


def rows_without_unpredictable(judged: Judgement) -> list[tuple[str, Agreement]]:
    """Figures with and without what cannot be predicted, of trials and of all grasps."""
    assert judged.unpredictable is not None
    pairs = [("trials", judged.selected, judged.unpredictable.selected)]
    if judged.all_grasps is not None and judged.unpredictable.all_grasps is not None:
        pairs = [("selected trials", *pairs[0][1:])]
        pairs.append(("all grasps", judged.all_grasps, judged.unpredictable.all_grasps))
    return [
        (title, found)
        for of, every, without in pairs
        for title, found in ((f"{of}, with", every), (f"{of}, without", without))
    ]


def outlier_table(judged: Judgement, name: str = "") -> TextTable | str:
    """Objects and causes whose verdicts are wrong more often than those of others."""
    if not judged.standing_out:
        return no_outliers_sentence(judged)
    table = TextTable(f"What stands out{name}").names("what", "").texts("predicted")
    table.numbers("wrong", "others wrong").texts("ended").numbers("p corrected")
    for one in judged.standing_out:
        table.row(
            one.kind,
            outlier_name(one),
            "success" if one.predicted else "failure",
            f"{one.wrong} of {one.trials}",
            f"{one.other_wrong} of {one.other_trials}",
            outcome_counts_text(one.ended),
            format_number(one.corrected),
        )
    table.caption = (
        "wrong more often than others with the same prediction: Fisher's exact test, one-sided"
        f" mid-p, corrected by Holm's method for {judged.tested_groups} groups"
    )
    if judged.unpredictable is not None:
        table.caption += "; without what the hand alone cannot predict"
    return table


def group_table(title: str, head: str, groups: Sequence[FactorGroup]) -> TextTable:
    """Counts and shares by object or scene."""
    table = TextTable(title).names(head).numbers("trials", "TP", "FP", "FN", "TN")
    table.numbers("right", "95 % CI", "precision", "recall")
    for group in groups[:MAX_TABLE_ROWS]:
        a = group.agreement
        table.row(
            group.name,
            *(format_count(int(n)) for n in (a.trials, *a.cells)),
            estimate_text(a.accuracy, percent=True),
            bracketed_interval(a.accuracy, percent=True) or "-",
            estimate_text(a.precision, percent=True),
            estimate_text(a.recall, percent=True),
        )
    if len(groups) > MAX_TABLE_ROWS:
        table.caption = f"the first {MAX_TABLE_ROWS} of {len(groups)}; the JSON has all"
    return table


def stopped_table(comparison: Comparison, judged: Judgement, name: str = "") -> TextTable:
    """Outcomes on the robot, or in the second run, by verdict."""
    table = TextTable(f"Outcomes for each verdict{name}")
    runs = comparison.kind == "runs"
    table.texts("first run" if runs else "simulated").names("body in the way")
    table.numbers("trials", "success in the second" if runs else "succeeded", "95 % CI")
    for row in judged.stopped[:MAX_TABLE_ROWS]:
        table.row(
            outcome_label(row.outcome),
            row.blocker,
            format_count(row.trials),
            estimate_text(row.successes, percent=True),
            bracketed_interval(row.successes, percent=True) or "-",
        )
    if len(judged.stopped) > MAX_TABLE_ROWS:
        table.caption = f"the first {MAX_TABLE_ROWS} of {len(judged.stopped)}; the JSON has all"
    return table


def calibration_table(
    comparison: Comparison, found: Sequence[MarginCalibration], name: str = ""
) -> TextTable:
    """How well each margin ranks success above failure."""
    weighted = any(c.auroc_weighted is not None for c in found)
    table = TextTable(f"How margins predict {success_description(comparison)}{name}").texts(
        "margin", "better"
    )
    table.numbers("trials", "AUROC, selected trials" if weighted else "AUROC", "95 % CI")
    if weighted:
        table.numbers("AUROC, all grasps")
    for c in found:
        cells = [format_count(c.trials), estimate_text(c.auroc, percent=False)]
        cells.append(bracketed_interval(c.auroc, percent=False) or "-")
        if weighted:
            cells.append(
                "-" if c.auroc_weighted is None else format_number(c.auroc_weighted.value, 3)
            )
        better = "smaller" if c.smaller_is_better else "larger"
        table.row(margin_title(c.name)[0], better, *cells)
    table.caption = (
        "AUROC: how often the better margin is that of the success, of a success and a failure;"
        " 0.5 means no information"
    )
    return table


def placement_table(judged: Judgement, name: str = "") -> TextTable:
    """Agreement by placement."""
    p = judged.placement
    assert p is not None
    limit = f"{p.limit_mm:g} mm"
    groups = [
        FactorGroup(name=f"all within {limit}", agreement=p.within),
        FactorGroup(name="one farther off", agreement=p.beyond),
        FactorGroup(name="not all measured", agreement=p.unmeasured),
    ]
    table = group_table(f"By placement of the objects{name}", "placement", groups)
    if p.largest.auroc.value is not None:
        table.caption = (
            "AUROC of the largest offset for right verdicts:"
            f" {estimate_text(p.largest.auroc, percent=False)} {bracketed_interval(p.largest.auroc, percent=False)}"
        )
    return table


def coverage_sentences(comparison: Comparison) -> str:
    """Which grasps were compared and which were not."""
    v = comparison.coverage
    what = "grasps" if comparison.kind == "runs" else "trials"
    parts = [f"{v.compared:,} {what} compared"]
    if v.only_first or v.only_second:
        parts.append(f"{v.only_first:,} only in the first, {v.only_second:,} only in the second")
    if v.other_content:
        parts.append(f"{v.other_content:,} with the same id but another pose or width")
    parts += [f"{n:,} left out: {reason.replace('_', ' ')}" for reason, n in v.left_out.items()]
    return "; ".join(parts)


CONFIDENCE_HEADING = "confidence of the first run"  # Heading of groups by confidence.


def agreement_tables(found: RunAgreement) -> Iterator[TextTable]:
    """What is alike by object, where the runs part by stage, and how far apart margins are; what
    there is nothing of is left out."""
    if len(found.objects) > 1:
        yield group_agreement_table("object", found.objects)
    if found.apart:
        yield stage_table(found.apart)
    if found.parted:
        yield disagreement_table(found.parted)
    if found.confidence:
        yield group_agreement_table(CONFIDENCE_HEADING, found.confidence)
    if found.margins:
        yield margin_bin_table(found.margins)
    if found.differences:
        yield margin_difference_table(found.differences)


def group_agreement_table(head: str, groups: Sequence[FactorGroup]) -> TextTable:
    """Held alike by what grasps have in common, such as their object."""
    max_rows = 20  # Groups in the table; the JSON has all.
    table = TextTable(f"Agreement on holding, by {head}").names(head)
    table.numbers("grasps", "alike", "95 % CI", "kappa")
    for group in groups[:max_rows]:
        a = group.agreement
        table.row(
            group.name,
            format_count(a.trials),
            estimate_text(a.accuracy, percent=True),
            bracketed_interval(a.accuracy, percent=True) or MISSING_NUMBER,
            estimate_text(a.kappa, percent=False),
        )
    if len(groups) > max_rows:
        table.caption = f"the first {max_rows} of {len(groups)}; the JSON has all"
    return table


def stage_table(apart: Mapping[str, Mapping[str, int]]) -> TextTable:
    """Grasps that only one run holds, by the stages that decided."""
    columns = deciding_stages(apart)
    table = TextTable("Stages that decided the grasps which only one of the runs holds")
    table.texts("first run").numbers(*(f"{name} in the second" for name in columns))
    for stage, row in apart.items():
        table.row(stage, *(format_count(row.get(name, 0)) for name in columns))
    return table


def disagreement_table(parted: Sequence[PartedGrasp]) -> TextTable:
    """The first grasps that only one run holds, with their outcomes in both."""
    max_rows = 10  # Grasps in the table; the JSON has all.
    table = TextTable("Grasps that only one of the runs holds")
    scenes = len({one.scene for one in parted}) > 1
    if scenes:
        table.names("scene")
    table.names("grasp").texts("first run", "second run").numbers("confidence of the first")
    for one in parted[:max_rows]:
        sure = MISSING_NUMBER if one.confidence is None else f"{one.confidence:.3f}"
        outcomes = outcome_label(one.first), outcome_label(one.second)
        table.row(*([one.scene] if scenes else []), one.grasp, *outcomes, sure)
    if len(parted) > max_rows:
        table.caption = f"{format_count(len(parted) - max_rows)} more in the JSON"
    return table


def deciding_stages(counts: Mapping[str, Mapping[str, int]]) -> list[str]:
    """The stages of the second run that occur, in their order."""
    return [stage.value for stage in Stage if any(stage.value in row for row in counts.values())]


def margin_bin_table(margins: Sequence[MarginCalibration]) -> TextTable:
    """Share of alike grasps along the first run's margins."""
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


def margin_difference_table(differences: Sequence[MarginDifference]) -> TextTable:
    """How far apart margins are where both executed."""
    table = TextTable("Margins of grasps that both runs executed: second run minus first").texts(
        "margin"
    )
    table.numbers("grasps", "median", "median size", "90 % within").texts("unit")
    for one in differences:
        title, unit, size = margin_title(one.name)
        values = (one.median, one.median_size, one.within)
        table.row(title, format_count(one.grasps), *(format_number(size * v) for v in values), unit)
    return table
