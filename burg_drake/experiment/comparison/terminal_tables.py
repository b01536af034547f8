"""Tables of a comparison for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from burg_drake.core import (
    MISSING_NUMBER,
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
    Comparison,
    agreement_sentence,
    bias_sentence,
    have_identical_rows,
    headline_sentence,
    margin_title,
    no_outliers_sentence,
    outcome_counts_text,
    outlier_name,
    population_difference_sentence,
    selection_suffix,
    success_description,
    too_few_trials_sentence,
    unpredictable_sentence,
)
from burg_drake.experiment.comparison.estimates import AGREEMENT_MEASURES
from burg_drake.experiment.comparison.figure_tables import (
    CONFIDENCE_HEADING,
    Figure,
    deciding_stages,
    group_table,
    measure_table,
    named_agreements,
    placement_groups,
    run_agreement_table,
    unpredictable_table,
    verdict_table,
)
from burg_drake.experiment.comparison.group_agreement import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement, PlacementAgreement
from burg_drake.experiment.comparison.margin_calibration import MarginCalibration


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
        yield from _judgement_tables(c, judged, name)
    yield coverage_sentences(c)
    yield from (f"differs: {text}" for text in c.settings)
    yield from (f"note: {text}" for text in c.notes)


def _named_judgements(comparison: Comparison) -> list[tuple[str, Judgement]]:
    if comparison.other is None:
        return [("", comparison.judgement)]
    return [(", first run", comparison.judgement), (", second run", comparison.other)]


def _judgement_tables(c: Comparison, judged: Judgement, name: str) -> Iterator[TextTable | str]:
    """Tables and sentences about one run, whose name titles end with."""
    suffix = selection_suffix(c) + name
    yield matrix_table(c, judged, name)
    yield _measure_table(c, judged, name)
    yield bias_sentence(c, judged)
    if judged.unpredictable is not None:
        yield unpredictable_sentence(judged)
        title = f"With and without outcomes that the hand alone cannot predict{name}"
        yield unpredictable_table(judged).text_table(title)
    if c.kind != "runs":
        yield outlier_table(judged, name)
    for kind, groups in (("object", judged.objects), ("scene", judged.scenes)):
        if len(groups) > 1:
            yield group_table(kind, groups).text_table(f"By {kind}{suffix}")
    yield verdict_table(c, judged).text_table(f"Outcomes for each verdict{suffix}")
    telling = [m for m in judged.calibration if m.auroc.value is not None]
    if telling:
        yield calibration_table(c, telling, name)
    elif words := too_few_trials_sentence(c, judged):
        yield words
    p = judged.placement
    if p is not None and p.within.trials + p.beyond.trials:
        yield _placement_table(p, suffix)


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


def _measure_table(comparison: Comparison, judged: Judgement, name: str) -> TextTable:
    """All measures of the selected trials and of all grasps."""
    table = measure_table(comparison, [("", judged)]).text_table(f"Figures{name}")
    captions = []
    if judged.all_grasps is not None:
        grasps = format_count(round(sum(judged.all_grasps.cells)))
        captions.append(
            f"selected trials: the {judged.selected.trials} that were compared; all grasps: the"
            f" {grasps} that they stand for, each for its share of those that it was chosen from"
        )
    agreements = [found for _, found in named_agreements([("", judged)])]
    reasons = {a.figure(key).reason for key in AGREEMENT_MEASURES for a in agreements} - {""}
    if reasons:
        captions.append(f"-: cannot be calculated ({'; '.join(sorted(reasons))})")
    table.caption = "\n".join(captions)
    return table


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
        cells = [format_count(c.trials), *Figure(c.auroc, percent=False).texts]
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


def _placement_table(placement: PlacementAgreement, suffix: str) -> TextTable:
    """Agreement by placement."""
    within = f"all within {placement.limit_mm:g} mm"
    groups = placement_groups(placement, within, "one farther off")
    title = f"By placement of the objects{suffix}"
    table = group_table("placement", groups).text_table(title)
    area = Figure(placement.largest.auroc, percent=False)
    if area.estimate.value is not None:
        table.caption = f"AUROC of the largest offset for right verdicts: {' '.join(area.texts)}"
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


def agreement_tables(found: RunAgreement) -> Iterator[TextTable]:
    """Agreement by object, disagreements by stage, and differences of margins; empty tables are
    left out."""
    if len(found.objects) > 1:
        yield _run_agreement_table("object", found.objects)
    if found.apart:
        yield stage_table(found.apart)
    if found.parted:
        yield disagreement_table(found.parted)
    if found.confidence:
        yield _run_agreement_table(CONFIDENCE_HEADING, found.confidence)
    if found.margins:
        yield margin_bin_table(found.margins)
    if found.differences:
        yield margin_difference_table(found.differences)


def _run_agreement_table(head: str, groups: Sequence[FactorGroup]) -> TextTable:
    return run_agreement_table(head, groups).text_table(f"Agreement on holding, by {head}")


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
