"""A comparison as tables for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from burg_drake.core.grasps import outcome_label
from burg_drake.core.terminal import TextTable, format_count, format_number
from burg_drake.experiment.comparison.agreement_tables import agreement_tables
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.groups import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.wording import (
    IN_PERCENT,
    alike_words,
    bias_words,
    counts_words,
    difference_of_all_words,
    have_same_rows,
    headline,
    interval,
    margin_title,
    measure_name,
    nothing_stands_out,
    number,
    of_selected,
    standing_out_name,
    success_of,
    too_few_for_margins,
    unpredictable_words,
)
from burg_drake.experiment.statistics import MEASURES, Agreement, MarginCalibration

MOST_ROWS = 20
ABOUT_UNPREDICTABLE = ("precision", "recall", "accuracy")
"""Figures that are given with and without outcomes that cannot be predicted."""


def comparison_tables(comparison: Comparison) -> Iterator[TextTable | str]:
    """Tables and sentences, the most important first."""
    c = comparison
    yield headline(c)
    if c.agreement is not None and not have_same_rows(c):
        yield alike_words(c)
        yield from agreement_tables(c.agreement)
    if words := difference_of_all_words(c):
        yield words
    for name, judged in [] if have_same_rows(c) else _judgements(c):
        of = of_selected(c) + name
        yield matrix_table(c, judged, name)
        yield figure_table(c, judged, name)
        yield bias_words(c, judged)
        if judged.unpredictable is not None:
            yield unpredictable_words(judged)
            yield unpredictable_table(judged, name)
        if c.kind != "runs":
            yield standing_out_table(judged, name)
        if len(judged.objects) > 1:
            yield group_table(f"By object{of}", "object", judged.objects)
        if len(judged.scenes) > 1:
            yield group_table(f"By scene{of}", "scene", judged.scenes)
        yield stopped_table(c, judged, of)
        telling = [m for m in judged.calibration if m.auroc.value is not None]
        if telling:
            yield calibration_table(c, telling, name)
        elif words := too_few_for_margins(c, judged):
            yield words
        p = judged.placement
        if p is not None and p.within.trials + p.beyond.trials:
            yield placement_table(judged, of)
    yield coverage_words(c)
    yield from (f"differs: {text}" for text in c.settings)
    yield from (f"note: {text}" for text in c.notes)


def _judgements(comparison: Comparison) -> list[tuple[str, Judgement]]:
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
    for key in MEASURES:
        cells = []
        for agreement in found:
            f, percent = agreement.figure(key), key in IN_PERCENT
            cells += [number(f, percent=percent), interval(f, percent=percent) or "-"]
        table.row(measure_name(comparison, key), *cells)
    reasons = {f.reason for a in found for f in (a.figure(k) for k in MEASURES) if f.reason}
    if reasons:
        undefined = f"-: cannot be calculated ({'; '.join(sorted(reasons))})"
        table.caption = f"{table.caption}\n{undefined}" if table.caption else undefined
    return table


def unpredictable_table(judged: Judgement, name: str = "") -> TextTable:
    """Figures with and without failures that the hand alone does not predict."""
    table = TextTable(f"With and without outcomes that the hand alone cannot predict{name}")
    table.texts("of")
    for key in ABOUT_UNPREDICTABLE:
        table.numbers(key, "95 % CI")
    for title, found in with_and_without(judged):
        cells = []
        for f in map(found.figure, ABOUT_UNPREDICTABLE):
            cells += [number(f, percent=True), interval(f, percent=True) or "-"]
        table.row(title, *cells)
    return table


def with_and_without(judged: Judgement) -> list[tuple[str, Agreement]]:
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


def standing_out_table(judged: Judgement, name: str = "") -> TextTable | str:
    """Objects and causes whose verdicts are wrong more often than those of others."""
    if not judged.standing_out:
        return nothing_stands_out(judged)
    table = TextTable(f"What stands out{name}").names("what", "").texts("predicted")
    table.numbers("wrong", "others wrong").texts("ended").numbers("p corrected")
    for one in judged.standing_out:
        table.row(
            one.kind,
            standing_out_name(one),
            "success" if one.predicted else "failure",
            f"{one.wrong} of {one.trials}",
            f"{one.other_wrong} of {one.other_trials}",
            counts_words(one.ended),
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
    for group in groups[:MOST_ROWS]:
        a = group.agreement
        table.row(
            group.name,
            *(format_count(int(n)) for n in (a.trials, *a.cells)),
            number(a.accuracy, percent=True),
            interval(a.accuracy, percent=True) or "-",
            number(a.precision, percent=True),
            number(a.recall, percent=True),
        )
    if len(groups) > MOST_ROWS:
        table.caption = f"the first {MOST_ROWS} of {len(groups)}; the JSON has all"
    return table


def stopped_table(comparison: Comparison, judged: Judgement, name: str = "") -> TextTable:
    """Outcomes on the robot, or in the second run, by verdict."""
    table = TextTable(f"Outcomes for each verdict{name}")
    runs = comparison.kind == "runs"
    table.texts("first run" if runs else "simulated").names("body in the way")
    table.numbers("trials", "success in the second" if runs else "succeeded", "95 % CI")
    for row in judged.stopped[:MOST_ROWS]:
        table.row(
            outcome_label(row.outcome),
            row.blocker,
            format_count(row.trials),
            number(row.successes, percent=True),
            interval(row.successes, percent=True) or "-",
        )
    if len(judged.stopped) > MOST_ROWS:
        table.caption = f"the first {MOST_ROWS} of {len(judged.stopped)}; the JSON has all"
    return table


def calibration_table(
    comparison: Comparison, found: Sequence[MarginCalibration], name: str = ""
) -> TextTable:
    """How well each margin ranks success above failure."""
    weighted = any(c.auroc_weighted is not None for c in found)
    table = TextTable(f"How margins predict {success_of(comparison)}{name}").texts(
        "margin", "better"
    )
    table.numbers("trials", "AUROC, selected trials" if weighted else "AUROC", "95 % CI")
    if weighted:
        table.numbers("AUROC, all grasps")
    for c in found:
        cells = [format_count(c.trials), number(c.auroc, percent=False)]
        cells.append(interval(c.auroc, percent=False) or "-")
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
            f" {number(p.largest.auroc, percent=False)} {interval(p.largest.auroc, percent=False)}"
        )
    return table


def coverage_words(comparison: Comparison) -> str:
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
