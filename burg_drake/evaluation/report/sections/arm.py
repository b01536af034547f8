"""Sections of the report about the arm: what hindered it, and how it executed its plans."""

from __future__ import annotations

from collections import Counter

import numpy as np

from burg_drake.core.grasps import Outcome, Stage, shown_unit
from burg_drake.core.terminal import format_percent
from burg_drake.evaluation.records import Columns
from burg_drake.evaluation.report.elements import (
    Child,
    Html,
    element,
    folded,
    section,
    table,
)
from burg_drake.evaluation.results import Summary

OF_ARM = tuple(o for o in Outcome if o.stage in (Stage.REACHABLE, Stage.PLANNED))
"""What can be between a grasp at which the hand is clear and its trial."""
BLOCKERS = 3
"""Most frequent bodies that are listed for each outcome."""


def arm_section(summary: Summary, columns: Columns) -> Html | None:
    """What hindered the arm, and what was in its way; nothing if it was not asked."""
    if summary.mode == "hand":
        return None
    clear, planned = summary.total.clear, summary.total.planned
    rows = []
    for outcome in OF_ARM:
        count = summary.total.outcomes[outcome]
        if count:
            cells = [
                element("td", cell, class_="number")
                for cell in (count, format_percent(count / clear))
            ]
            name = element("th", outcome.value.replace("_", " "), scope="row")
            blockers = element("td", _blockers(columns, outcome))
            rows.append(element("tr", name, *cells, element("td", outcome.meaning), blockers))
    share = f" ({format_percent(planned / clear)})" if clear else ""
    text = (
        f"The open hand is clear at {clear} grasps. The arm can execute {planned} of them"
        f"{share}: it has a collision-free path from home to the pregrasp, and can follow"
        " the straight approach and the lift. Each of the other grasps is listed under"
        " the first thing that fails."
    )
    head = ["outcome", "grasps", "of clear", "what it means", "main obstacles"]
    return folded("What stopped the arm", text, table(head, rows, numbers=(1, 2)) if rows else "")


def _blockers(columns: Columns, outcome: Outcome) -> str:
    named = columns["blocker"][(columns["outcome"] == outcome) & (columns["blocker"] != "")]
    found = Counter(named.tolist()).most_common(BLOCKERS)
    return ", ".join(f"{name} ({count})" for name, count in found)


def execution_section(summary: Summary, columns: Columns) -> Html | None:
    """How the arm executed its plans; nothing where it did not."""
    if "tracking_error" not in columns or not np.isfinite(columns["tracking_error"]).any():
        return None
    rows = []
    for name, label in (
        ("duration", "duration of the motion"),
        ("tracking_error", "largest joint error"),
        ("tracking_distance", "largest error of the grasp frame"),
        ("pushed", "largest push before the hand closed"),
    ):
        unit, factor = shown_unit(name)
        values = columns[name][np.isfinite(columns[name])] * factor
        if len(values):
            figures = (np.median(values), np.quantile(values, 0.95), values.max())
            cells: list[Child] = [len(values), *(f"{figure:.3g} {unit}" for figure in figures)]
            numbers = [element("td", cell, class_="number") for cell in cells]
            rows.append(element("tr", element("th", label, scope="row"), *numbers))
    touches = Counter(t for t in columns["touched"].tolist() if t)
    text = "How closely the simulated arm followed its plans within its torque limits."
    text += f" {summary.pushes}" if summary.pushes else ""
    if touches:
        found = ", ".join(f"{name} ({count})" for name, count in touches.most_common(BLOCKERS))
        text += (
            f" In {sum(touches.values())} trials the robot touched something that was not"
            f" planned: {found}."
        )
    head = ["", "trials", "median", "95 %", "most"]
    return section("Execution by the arm", text, table(head, rows, numbers=(1, 2, 3, 4)))
