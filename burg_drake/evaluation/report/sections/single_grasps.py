"""Sections of the report about single grasps: the best ones, and failed simulations."""

from __future__ import annotations

import shlex

from burg_drake.core.grasps import shown_number, shown_title
from burg_drake.evaluation.report.elements import Html, command, element, folded, table
from burg_drake.evaluation.store import Run

BEST = 3
"""Rows for each object in the table of best grasps."""
BEST_MARGINS = {
    "clearance": 1,
    "slip": 2,
    "tilt": 2,
    "pad_force": 1,
    "patch_area": 0,
    "others_moved": 2,
}
"""Columns of that table, by which grasps compare, with decimals that tell best ones apart."""
FAILURES = 50
"""Rows of the table of failures."""


def best_section(run: Run) -> Html | None:
    """The best grasps and how to watch them; nothing where none was lifted."""
    best = run.best(BEST, each=True)
    if not best:
        return None
    head = ["grasp", "object", *map(shown_title, BEST_MARGINS)]
    rows = []
    for row in map(run.row, best):
        cells = [shown_number(name, row[name], digits) for name, digits in BEST_MARGINS.items()]
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
        f"The {BEST} best grasps of each object: lifted, with the most room around the"
        " open hand (clearance), and so most likely to succeed when pose, mass and"
        " friction differ from the model. Among grasps with the same clearance (to 0.5"
        " mm) those with less slip, tilt and movement of other objects come first, then"
        " those with the larger contact patch. To watch a grasp, give its id:",
        command(line),
        table(head, rows, numbers=range(2, len(head))),
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
