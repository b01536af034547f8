"""Tables of what two runs have in common, for a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from burg_drake.core.grasps import Stage, outcome_label
from burg_drake.core.terminal import MISSING, TextTable, format_count, format_number
from burg_drake.experiment.comparison.groups import FactorGroup
from burg_drake.experiment.comparison.parted_grasps import PartedGrasp
from burg_drake.experiment.comparison.run_agreement import MarginDifference, RunAgreement
from burg_drake.experiment.comparison.wording import interval, margin_title, number
from burg_drake.experiment.statistics import MarginCalibration

MOST_ROWS = 20
MOST_PARTED = 10
"""Grasps that are named; the JSON has all."""
CONFIDENCE = "confidence of the first run"


def agreement_tables(found: RunAgreement) -> Iterator[TextTable]:
    """What is alike by object, where the runs part by stage, and how far apart margins are; what
    there is nothing of is left out."""
    if len(found.objects) > 1:
        yield alike_table("object", found.objects)
    if found.apart:
        yield stage_table(found.apart)
    if found.parted:
        yield parted_table(found.parted)
    if found.confidence:
        yield alike_table(CONFIDENCE, found.confidence)
    if found.margins:
        yield bin_table(found.margins)
    if found.differences:
        yield difference_table(found.differences)


def alike_table(head: str, groups: Sequence[FactorGroup]) -> TextTable:
    """Held alike by what grasps have in common, such as their object."""
    table = TextTable(f"Agreement on holding, by {head}").names(head)
    table.numbers("grasps", "alike", "95 % CI", "kappa")
    for group in groups[:MOST_ROWS]:
        a = group.agreement
        table.row(
            group.name,
            format_count(a.trials),
            number(a.accuracy, percent=True),
            interval(a.accuracy, percent=True) or MISSING,
            number(a.kappa, percent=False),
        )
    if len(groups) > MOST_ROWS:
        table.caption = f"the first {MOST_ROWS} of {len(groups)}; the JSON has all"
    return table


def stage_table(apart: Mapping[str, Mapping[str, int]]) -> TextTable:
    """Grasps that only one run holds, by the stages that decided."""
    columns = stage_columns(apart)
    table = TextTable("Stages that decided the grasps which only one of the runs holds")
    table.texts("first run").numbers(*(f"{name} in the second" for name in columns))
    for stage, row in apart.items():
        table.row(stage, *(format_count(row.get(name, 0)) for name in columns))
    return table


def parted_table(parted: Sequence[PartedGrasp]) -> TextTable:
    """The first grasps that only one run holds, with their outcomes in both."""
    table = TextTable("Grasps that only one of the runs holds")
    scenes = len({one.scene for one in parted}) > 1
    if scenes:
        table.names("scene")
    table.names("grasp").texts("first run", "second run").numbers("confidence of the first")
    for one in parted[:MOST_PARTED]:
        sure = MISSING if one.confidence is None else f"{one.confidence:.3f}"
        outcomes = outcome_label(one.first), outcome_label(one.second)
        table.row(*([one.scene] if scenes else []), one.grasp, *outcomes, sure)
    if len(parted) > MOST_PARTED:
        table.caption = f"{format_count(len(parted) - MOST_PARTED)} more in the JSON"
    return table


def stage_columns(counts: Mapping[str, Mapping[str, int]]) -> list[str]:
    """The stages of the second run that occur, in their order."""
    return [stage.value for stage in Stage if any(stage.value in row for row in counts.values())]


def bin_table(margins: Sequence[MarginCalibration]) -> TextTable:
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


def difference_table(differences: Sequence[MarginDifference]) -> TextTable:
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
