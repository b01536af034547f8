"""Sections with matrices and figures: of all trials, by object, by scene, by placement."""

from __future__ import annotations

from collections.abc import Sequence

from burg_drake.core.terminal import format_count, format_number
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    element,
    interval_mark,
    join,
    section,
    table,
)
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.groups import FactorGroup
from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.tables import ABOUT_UNPREDICTABLE, with_and_without
from burg_drake.experiment.comparison.wording import (
    IN_PERCENT,
    cell_name,
    counts_words,
    interval,
    measure_name,
    nothing_stands_out,
    number,
    standing_out_name,
    unpredictable_words,
)
from burg_drake.experiment.statistics import CELLS, MEASURES, Agreement, Estimate

MOST_ROWS = 60
Named = Sequence[tuple[str, Judgement]]
"""What a comparison says of each judge; the name is empty if there is only one."""


def matrix_section(comparison: Comparison, judged: Named) -> Html:
    """Confusion matrices of the trials, and of all grasps that they stand for."""
    title = "Verdicts of both runs" if comparison.kind == "runs" else "Verdicts and outcomes"
    blocks = []
    for name, judgement in judged:
        found = [("selected trials", judgement.selected)]
        if judgement.all_grasps is not None:
            found.append(("all grasps", judgement.all_grasps))
        elif comparison.kind == "runs":
            found = [("grasps", judgement.selected)]
        blocks += [_matrix(comparison, _titled(which, name), a) for which, a in found]
    text = "Rows: what the simulation predicted. Columns: what happened."
    if comparison.kind == "runs":
        text = "Rows: the first run. Columns: the second run."
    if any(j.all_grasps is not None for _, j in judged):
        text += (
            " Each selected trial counts once; for all grasps it counts for all the"
            " grasps that it was chosen from."
        )
    return section(title, text, element("div", *blocks, class_="beside"))


def _titled(title: str, name: str) -> str:
    return f"{title}, {name}" if name else title


def _matrix(comparison: Comparison, title: str, found: Agreement) -> Html:
    runs = comparison.kind == "runs"
    judge, other = ("in the first", "in the second") if runs else ("predicted", "on the robot")

    def cell(name: str, style: str) -> Html:
        value = format_count(round(getattr(found, name)))
        tip = cell_name(comparison, name)
        return element(
            "td", element("b", value), element("small", name.upper()), class_=style, title=tip
        )

    rows = [
        element("tr", element("th", f"success {judge}", scope="row"), *pair)
        for pair in [(cell("tp", "right"), cell("fp", "wrong"))]
    ]
    rows.append(
        element(
            "tr",
            element("th", f"failure {judge}", scope="row"),
            cell("fn", "wrong"),
            cell("tn", "right"),
        )
    )
    head = ["", f"success {other}", f"failure {other}"]
    return element(
        "div", element("h3", title[0].upper() + title[1:]), table(head, rows, style="confusion")
    )


def figure_section(comparison: Comparison, judged: Named) -> Html:
    """All measures with their intervals."""
    columns: list[tuple[str, Agreement]] = []
    for name, judgement in judged:
        columns.append((_titled("selected trials", name), judgement.selected))
        if judgement.all_grasps is not None:
            columns.append((_titled("all grasps", name), judgement.all_grasps))
    if len(columns) == 1:
        columns = [("value", columns[0][1])]
    head = ["figure", *(name for name, _ in columns)]
    rows = []
    for key in MEASURES:
        cells = [figure_cell(a.figure(key), percent=key in IN_PERCENT) for _, a in columns]
        rows.append(
            element("tr", element("th", measure_name(comparison, key), scope="row"), *cells)
        )
    return section(
        "Figures", _how(judged), table(head, rows, numbers=range(1, len(head)), style="figures")
    )


def figure_cell(found: Estimate, *, percent: bool) -> Html:
    """A figure and its interval, below each other where there is little room."""
    if found.value is None:
        return element("td", found.reason, class_="number faint why")
    bounds = element("small", interval(found, percent=percent), class_="bounds")
    return element("td", number(found, percent=percent), " ", bounds, class_="number")


def unpredictable_section(judged: Judgement) -> Html | None:
    """Figures with and without failures that the hand alone does not predict."""
    if judged.unpredictable is None:
        return None
    rows = [
        element(
            "tr",
            element("th", title, scope="row"),
            *(figure_cell(found.figure(key), percent=True) for key in ABOUT_UNPREDICTABLE),
        )
        for title, found in with_and_without(judged)
    ]
    head = ["of", *ABOUT_UNPREDICTABLE]
    return section(
        "What the hand alone cannot predict",
        unpredictable_words(judged),
        table(head, rows, numbers=range(1, len(head)), style="figures"),
    )


def standing_out_section(judged: Judgement) -> Html:
    """Objects and causes whose verdicts are wrong more often than those of others."""
    if not judged.standing_out:
        return section("What stands out", nothing_stands_out(judged))
    rows = []
    for one in judged.standing_out:
        cells: list[Child] = [
            one.kind,
            "success" if one.predicted else "failure",
            f"{one.wrong} of {one.trials}",
            f"{one.other_wrong} of {one.other_trials}",
            counts_words(one.ended),
            format_number(one.corrected),
        ]
        rows.append(
            element(
                "tr",
                element("th", standing_out_name(one), scope="row"),
                *(element("td", c) for c in cells),
            )
        )
    apart = " Failures that the hand alone cannot predict are left out."
    if judged.unpredictable is None:
        apart = ""
    names = [
        "",
        "what",
        "predicted",
        "wrong",
        "others wrong",
        ("how the wrongly predicted ones ended"),
        "p",
    ]
    return section(
        "What stands out",
        "Objects, verdicts and bodies in the way for which predictions were wrong more"
        " often than for others with the same prediction. p: one-sided mid-p of Fisher's"
        f" exact test with Holm's correction for the {judged.tested_groups} tested"
        f" groups: if nothing differs, nothing is named in 19 of 20 experiments.{apart}",
        table(names, rows),
    )


def _how(judged: Named) -> str:
    weighted = any(j.all_grasps is not None for _, j in judged)
    text = "Intervals are 95 % intervals: Wilson's for shares, a Bayesian bootstrap for all others."
    if weighted:
        text = (
            "The grasps were chosen from strata. Figures of the selected trials describe"
            " this experiment. In figures for all grasps each trial stands for its share"
            " of a stratum; they describe what a user of the simulator can expect. 95 %"
            " intervals: Wilson's for shares of the selected trials; a Bayesian"
            " bootstrap within strata for all others."
        )
    return text


def group_section(title: str, text: str, head: str, groups: Sequence[FactorGroup]) -> Html:
    """Counts, and shares with their intervals as dots and lines, by object or scene."""
    names = [head, "trials", "TP", "FP", "FN", "TN", "right", "precision", "recall"]
    rows = [_group_row(group) for group in groups[:MOST_ROWS]]
    if len(groups) > MOST_ROWS:
        text += f" The first {MOST_ROWS} of {len(groups)}."
    return section(title, text, table(names, rows, numbers=range(1, 6), style="groups"))


def _group_row(group: FactorGroup) -> Html:
    a = group.agreement
    counts = [
        element("td", format_count(round(n)), class_="number", data_label=name)
        for name, n in zip(("trials", *map(str.upper, CELLS)), (a.trials, *a.cells), strict=True)
    ]
    shares = [
        element("td", share_mark(found), class_="estimate", data_label=name)
        for name, found in (("right", a.accuracy), ("precision", a.precision), ("recall", a.recall))
    ]
    return element("tr", element("th", group.name, scope="row"), *counts, *shares)


def share_mark(found: Estimate) -> Child:
    """A share as a dot with its interval, and in figures."""
    if found.value is None or found.low is None or found.high is None:
        return element("span", found.reason, class_="faint")
    return join(interval_mark(found.value, found.low, found.high), f" {100 * found.value:.0f} %")
