"""Sections about two runs as two opinions: what they hold alike, where they part, and by how
much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from burg_drake.core.grasps import CONTESTED, outcome_label
from burg_drake.core.terminal import format_count, format_number
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    command,
    element,
    join,
    section,
    table,
)
from burg_drake.experiment.comparison.agreement_tables import CONFIDENCE, stage_columns
from burg_drake.experiment.comparison.comparison import Comparison
from burg_drake.experiment.comparison.groups import FactorGroup
from burg_drake.experiment.comparison.parted_grasps import PartedGrasp
from burg_drake.experiment.comparison.report.figures import share_mark
from burg_drake.experiment.comparison.report.plots import reliability_plot
from burg_drake.experiment.comparison.run_agreement import MarginDifference
from burg_drake.experiment.comparison.wording import alike_words, margin_title, number
from burg_drake.experiment.statistics import MarginCalibration

MOST_ROWS = 60
MOST_PARTED = 50
"""Grasps that are named; the JSON has all."""


def agreement_sections(comparison: Comparison) -> list[Html | None]:
    """All that is known of two runs beside each other; nothing of other comparisons."""
    found = comparison.agreement
    if found is None:
        return []
    return [
        section("Agreement on holding", alike_words(comparison), _alike("object", found.objects)),
        _stages(found.stages, found.apart),
        _parted(found.parted),
        _confidence(found.confidence),
        _margins(found.margins),
        _differences(found.differences),
    ]


def _alike(head: str, groups: Sequence[FactorGroup]) -> Html:
    """Held alike by what grasps have in common, such as their object."""
    rows = [
        element(
            "tr",
            element("th", group.name, scope="row"),
            element(
                "td", format_count(group.agreement.trials), class_="number", data_label="grasps"
            ),
            element(
                "td", share_mark(group.agreement.accuracy), class_="estimate", data_label="alike"
            ),
            element(
                "td",
                number(group.agreement.kappa, percent=False),
                class_="number",
                data_label="kappa",
            ),
        )
        for group in groups[:MOST_ROWS]
    ]
    names = [head, "grasps", "alike, 95 % interval", "Cohen's kappa"]
    return table(names, rows, numbers=(1, 3), style="groups")


def _stages(
    stages: Mapping[str, Mapping[str, int]], apart: Mapping[str, Mapping[str, int]]
) -> Html:
    """All grasps by stage and stage, with those that only one run holds in brackets."""
    columns, rows = stage_columns(stages), []
    for stage, row in stages.items():
        cells = []
        for name in columns:
            count, parted = row.get(name, 0), apart.get(stage, {}).get(name, 0)
            text = f"{format_count(count)} ({format_count(parted)})" if parted else count or "·"
            cells.append(element("td", text, class_="number" if count else "number zero"))
        rows.append(element("tr", element("th", stage, scope="row"), *cells))
    text = (
        "Rows: the stage that decided in the first run. Columns: in the second run. In"
        " brackets: grasps that only one of the runs holds."
    )
    head = ["first run", *(f"{name} in the second" for name in columns)]
    return section("Where the runs disagree", text, table(head, rows, numbers=range(1, len(head))))


def _parted(parted: Sequence[PartedGrasp]) -> Html | None:
    """The first grasps that only one run holds, and how to look at them in either."""
    if not parted:
        return None
    head = ["grasp", "first", "second", "confidence of the first", "replay"]
    rows = []
    for one in parted[:MOST_PARTED]:
        cells: tuple[Child, ...] = (
            one.grasp,
            outcome_label(one.first),
            outcome_label(one.second),
            "-" if one.confidence is None else f"{one.confidence:.3f}",
            join(*(command(line) for line in one.replays)),
        )
        cases = (element("td", c, data_label=h) for h, c in zip(head, cells, strict=True))
        rows.append(element("tr", *cases))
    text = (
        f"{format_count(len(parted))} grasps. The commands show each one in the first and"
        " in the second run."
    )
    if len(parted) > MOST_PARTED:
        text += f" The first {MOST_PARTED}; the JSON has all."
    return section("Grasps that only one of the runs holds", text, table(head, rows, style="cases"))


def _confidence(groups: Sequence[FactorGroup]) -> Html | None:
    if not groups:
        return None
    text = (
        "Share of grasps on which the runs agree (both hold the object, or neither"
        f" does), by the confidence of the first run's verdict. Below {CONTESTED:g} a"
        " verdict is contested."
    )
    return section("Do the runs disagree on contested grasps?", text, _alike(CONFIDENCE, groups))


def _margins(margins: Sequence[MarginCalibration]) -> Html | None:
    if not margins:
        return None
    text = (
        "Share of grasps on which the runs agree, in bins of about equally many grasps"
        " along the first run's margin, with Wilson's intervals. Only grasps whose"
        " margin both runs measured count. Where the share falls, the verdict depends on"
        " the engine. Line: the monotone curve that fits best; dashes: the share of all"
        " grasps."
    )
    plots = (reliability_plot(c, "share on which the runs agree") for c in margins)
    return section(
        "Do the runs disagree at small margins?",
        text,
        element("div", *plots, class_="charts plots"),
    )


def _differences(differences: Sequence[MarginDifference]) -> Html | None:
    if not differences:
        return None
    rows = []
    for one in differences:
        title, unit, size = margin_title(one.name)
        values = (one.median, one.median_size, one.within)
        cells = (f"{format_number(size * value)} {unit}".rstrip() for value in values)
        rows.append(
            element(
                "tr",
                element("th", title, scope="row"),
                element("td", format_count(one.grasps), class_="number"),
                *(element("td", cell, class_="number") for cell in cells),
            )
        )
    head = ["margin", "grasps", "median difference", "median size", "90 % within"]
    return section(
        "How much margins differ",
        "Second run minus first run, for grasps that both executed; sizes are absolute"
        " differences.",
        table(head, rows, numbers=range(1, len(head)), style="figures"),
    )
