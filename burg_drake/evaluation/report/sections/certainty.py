"""How sure the verdicts are: lifted, failed and contested grasps of each object."""

from __future__ import annotations

from collections.abc import Sequence

from burg_drake.core.grasps import CONTESTED
from burg_drake.core.terminal import format_count as number
from burg_drake.evaluation.report.elements import (
    STYLES,
    BarPart,
    Html,
    element,
    join,
    legend,
    section,
    stacked_bar,
    table,
)
from burg_drake.evaluation.results import OutcomeCounts, Summary

LIFTED, LOST, OPEN = STYLES["lifted"], STYLES["lost during lift or hold"], "contested"
"""CSS classes."""
NAMED = 12
"""So many contested grasps are named."""


def certainty_section(summary: Summary, contested: Sequence[str] = ()) -> Html | None:
    """A bar an object of its executed grasps; nothing where no verdict has a confidence.

    Args:
        summary: of a run.
        contested: ids of the contested grasps, if they are to be named.
    """
    if not summary.knows_confidence or not summary.total.executed:
        return None
    settled = summary.total.settled
    head = ["object", "executed", "verdicts", "contested", *(["settled"] if settled else [])]
    width = len(head)
    tried = [group for group in summary.objects if group.executed]
    rows = [_row(group, bool(settled)) for group in tried]
    if len(tried) > 1:
        rows.append(_row(summary.total, bool(settled), "total"))
    text = (
        f"A verdict is contested if its confidence is below {CONTESTED:g}: with slightly"
        " different friction, pose, shape or lifting speed, the object may be held"
        " instead of lost, or lost instead of held. The margins below show how close"
        " other verdicts are to a limit."
    )
    if settled:
        text += f" Judged again by {', '.join(summary.settled_by)}, whose verdicts count:"
        text += f" {number(settled)}."
    keys = [(LIFTED, "lifted"), (OPEN, "contested"), (LOST, "failed")]
    return section(
        "How sure the verdicts are",
        text,
        table(head, rows, numbers=(1, *range(3, width)), style="stacking"),
        legend(keys),
        _named(contested),
    )


def _named(contested: Sequence[str]) -> Html | None:
    """Which grasps are contested, as far as there is room."""
    if not contested:
        return None
    ids = [join(", " if k else "", element("code", id)) for k, id in enumerate(contested[:NAMED])]
    more = len(contested) - NAMED
    return element("p", "Contested: ", *ids, f" and {more} more" if more > 0 else "", class_="note")


def _row(group: OutcomeCounts, settled: bool, style: str = "") -> Html:
    lifts, losses = group.contested_lifts, group.contested - group.contested_lifts
    parts = [
        BarPart(group.surely_lifted, LIFTED, f"lifted: {group.surely_lifted}"),
        BarPart(group.contested, OPEN, f"contested: {lifts} lifted, {losses} failed"),
        BarPart(group.surely_lost, LOST, f"failed: {group.surely_lost}"),
    ]
    cells = [
        element("td", number(group.executed), class_="number"),
        element("td", stacked_bar(parts, group.executed), class_="wide"),
        element("td", number(group.contested), class_="number"),
    ]
    if settled:
        cells.append(element("td", number(group.settled), class_="number"))
    return element("tr", element("th", group.name, scope="row"), *cells, class_=style or None)
