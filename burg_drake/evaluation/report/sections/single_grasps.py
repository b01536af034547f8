"""Sections of the report about single grasps: the best ones, and failed simulations."""

from __future__ import annotations

import math
import shlex

from burg_drake.evaluation.report.elements import Html, command, element, folded, table
from burg_drake.evaluation.store import Run

BEST = 3
"""Rows for each object in the table of best grasps."""
FAILURES = 50
"""Rows of the table of failures."""


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
    return folded(
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
    return folded("Failures", text, table(["grasp", "stage", "reason"], rows))
