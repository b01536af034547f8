"""Sections of the report about single grasps: margins, the best ones, failures."""

from __future__ import annotations

import math
import shlex

import numpy as np

from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.report.charts import Series, histogram, legend
from burg_drake.evaluation.report.markup import Html, command, element, section, table
from burg_drake.evaluation.report.style import STYLES
from burg_drake.evaluation.run_store import Run
from burg_drake.evaluation.table import Columns
from burg_drake.visualization.palette import GROUPS, group_of

BEST = 3
"""Rows for each object in the table of best grasps."""
FAILURES = 50
"""Rows of the table of failures."""


def margin_section(columns: Columns) -> Html | None:
    """Histograms of slip, tilt, force and patch; nothing where no grasp was held."""
    lifted = columns["outcome"] == Outcome.LIFTED
    if not np.isfinite(columns["slip"]).any():
        return None
    charts = [
        _margin_chart(columns, lifted, name, title, unit, factor)
        for name, title, unit, factor in (
            ("slip", "slip in the hand [mm]", "mm", 1e3),
            ("tilt", "tilt in the hand [°]", "°", 180 / math.pi),
            ("pad_force", "normal force of the weaker pad [N]", "N", 1.0),
            ("patch_area", "contact patch of the weaker pad [mm²]", "mm²", 1e6),
        )
    ]
    groups = [g for g in GROUPS if _in_group(columns, g.name, "slip").any()]
    return section(
        "Margins",
        "Of all grasps that both fingers held once: movement of the object in the hand since the"
        " grip, force and contact patch, when the outcome was decided. The last bar counts all"
        " beyond the axis.",
        element("div", *charts, class_="charts"),
        legend([(STYLES[g.name], g.name) for g in groups]),
    )


def _margin_chart(
    columns: Columns, lifted: np.ndarray, name: str, title: str, unit: str, factor: float
) -> Html:
    values = columns[name] * factor
    series = [
        Series(values[_in_group(columns, g.name, name)], STYLES[g.name], g.name) for g in GROUPS
    ]
    finite = np.isfinite(values)
    focus = values[finite & lifted] if (finite & lifted).any() else values[finite]
    return histogram(series, title=title, unit=unit, focus=focus)


def _in_group(columns: Columns, group: str, margin: str) -> np.ndarray:
    groups = np.array([group_of(Outcome(o)).name for o in columns["outcome"]], dtype=str)
    return (groups == group) & np.isfinite(columns[margin])


def best_section(run: Run) -> Html | None:
    """The best grasps and how to watch them; nothing where none was lifted."""
    best = run.best(BEST, each=True)
    if not best:
        return None
    head = [
        "grasp",
        "object",
        "clearance",
        "slip",
        "tilt",
        "pad force",
        "patch",
        "others moved",
    ]
    rows = []
    for row in map(run.row, best):
        cells = [
            f"{row['clearance'] * 1e3:.1f} mm",
            f"{row['slip'] * 1e3:.2f} mm",
            f"{math.degrees(row['tilt']):.2f}°",
            f"{row['pad_force']:.1f} N",
            "-" if math.isnan(row["patch_area"]) else f"{row['patch_area'] * 1e6:.0f} mm²",
            f"{row['others_moved'] * 1e3:.2f} mm",
        ]
        rows.append(
            element(
                "tr",
                element("td", element("code", row["id"], class_="copy")),
                element("td", row["object"]),
                *(element("td", cell, class_="number") for cell in cells),
            )
        )
    line = shlex.join(["burg-drake", "replay", str(run.path), "--grasp", best[0]])
    return section(
        "Best grasps",
        f"Of each object the {BEST} best. Best means: lifted, with the most room around the open"
        " hand (clearance), and so most likely lifted again when pose, mass and friction are not"
        " quite what they are taken for; among equal ones, to 0.5 mm, those that slipped, tilted"
        " and pushed others least, then those with the larger contact patch. Any grasp can be"
        " watched by its id, from here or from its row of the table alone:",
        command(line),
        table(head, rows, numbers=(2, 3, 4, 5, 6, 7)),
    )


def failure_section(run: Run) -> Html | None:
    """What could not be simulated and why; nothing if all could."""
    failures = run.failures
    if not failures:
        return None
    rows = [
        element(
            "tr",
            element("td", element("code", row["id"])),
            element("td", row["stage"]),
            element("td", row["reason"]),
        )
        for row in map(run.row, failures[:FAILURES])
    ]
    more = f" The first {FAILURES} are listed." if len(failures) > FAILURES else ""
    text = f"{len(failures)} grasps could not be simulated; they count as not executed.{more}"
    return section("Failures", text, table(["grasp", "stage", "reason"], rows))
