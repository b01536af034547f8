"""The report's section on failures by cause, each with a typical grasp to watch."""

from __future__ import annotations

import shlex
from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.figures import count, percent
from burg_drake.core.outcome import Outcome
from burg_drake.evaluation.report.markup import Html, command, element, section
from burg_drake.evaluation.report.outcomes import label
from burg_drake.evaluation.report.style import STYLES
from burg_drake.evaluation.table import Columns
from burg_drake.visualization.palette import group_of

MEANING = {
    Outcome.COLLISION_TARGET: "at the grasp the open hand is in the object itself",
    Outcome.COLLISION_TABLE: "at the grasp the open hand is in the table",
    Outcome.COLLISION_CLUTTER: "at the grasp the open hand is in another object",
    Outcome.COLLISION_BACKGROUND: "at the grasp the open hand is in something fixed",
    Outcome.HAND_COLLISION_APPROACH: "on the straight way in, the open hand meets something",
    Outcome.HAND_COLLISION_RETREAT: "on the straight way back, the hand or the object in it does",
    Outcome.HAND_COLLISION_LIFT: "on the lift, the hand or the object in it does",
    Outcome.NO_IK: "no arm configuration puts the hand there, whatever the joint limits",
    Outcome.JOINT_LIMIT: "there are such configurations, but all are beyond a joint limit",
    Outcome.ARM_COLLISION: "within the limits, in each that was found the arm collides",
    Outcome.APPROACH_LINE: "the arm can be at both ends of the way in, but not take the hand"
    " straight along it",
    Outcome.RETREAT_LINE: "the arm cannot take the hand straight back",
    Outcome.LIFT_LINE: "the arm cannot take the hand along the lift",
    Outcome.NO_PATH: "no way from the home posture to the pregrasp was found",
    Outcome.NO_CONTACT: "the fingers closed and never touched the object",
    Outcome.ONE_FINGER: "the fingers stopped with only one of them on the object",
    Outcome.CLOSED_EMPTY: "the object was touched, but escaped while the fingers closed",
    Outcome.SLIPPED: "both fingers held the object, and lost it during the lift",
    Outcome.BLOCKED: "on its way up the hand met something fixed",
    Outcome.DROPPED: "the object was lifted, and lost while it was held",
    Outcome.LIFTED_DISTURBED: "the object is held to the end, but another one was moved",
    Outcome.SIMULATION_FAILED: "the trial could not be simulated; the results have the reason",
}
"""Every outcome but success, in a few words."""
TYPICAL_BY = (
    ("overlap", ("collision_",)),
    ("joint_excess", ("joint_limit",)),
    ("arm_clearance", ("arm_collision", "hand_collision_")),
    ("others_moved", ("lifted_disturbed",)),
    ("slip", ("slipped", "dropped")),
    ("lift", ("blocked",)),
)
"""Which margin tells a weak case of an outcome from a strong one; by beginnings of outcomes."""
NAMED = 3
"""Most frequent objects and blockers that are listed for each outcome."""


@dataclass(frozen=True)
class Cause:
    """Grasps that ended alike.

    Attributes:
        outcome: how.
        number: of grasps.
        objects, blockers: what they are on and what was in their way, with how often, most frequent
            first.
        typical: id of the median one.
    """

    outcome: Outcome
    number: int
    objects: tuple[tuple[str, int], ...]
    blockers: tuple[tuple[str, int], ...]
    typical: str


def causes_of(columns: Columns) -> list[Cause]:
    """Why grasps did not succeed, the most frequent cause first."""
    found = []
    for outcome in MEANING:
        rows = np.flatnonzero(columns["outcome"] == outcome.value)
        if len(rows):
            objects = Counter(columns["object"][rows].tolist()).most_common(NAMED)
            named = columns["blocker"][rows].tolist()
            blockers = Counter(body for body in named if body).most_common(NAMED)
            typical = str(columns["id"][typical_row(columns, rows, outcome)])
            found.append(Cause(outcome, len(rows), tuple(objects), tuple(blockers), typical))
    return sorted(found, key=lambda cause: -cause.number)


def typical_row(columns: Columns, rows: NDArray[np.int64], outcome: Outcome) -> int:
    """The median row of those with an outcome: by the margin that tells how strong a case it is,
    and by id among equal ones; half of the cases are weaker, and half are stronger."""
    name = next((m for m, starts in TYPICAL_BY if outcome.value.startswith(starts)), "")
    values = columns[name][rows] if name in columns else np.full(len(rows), np.nan)
    known = rows[np.isfinite(values)]
    rows, values = (known, values[np.isfinite(values)]) if len(known) else (rows, 0.0 * rows)
    order = np.lexsort((columns["id"][rows], values))
    return int(rows[order[(len(rows) - 1) // 2]])


def causes_section(columns: Columns, path: str) -> Html | None:
    """Each cause with its meaning, how often, where, and the command that shows a typical grasp;
    nothing where all grasps were lifted.

    Args:
        columns: the results.
        path: of the run, for the commands.
    """
    causes = causes_of(columns)
    if not causes:
        return None
    whole = len(columns["outcome"])
    return section(
        "Why grasps fail",
        "By cause, the most frequent one first. The command shows a typical case: the median one,"
        " with as many milder as worse ones.",
        element("div", *(_entry(cause, whole, path) for cause in causes), class_="causes"),
    )


def _entry(cause: Cause, whole: int, path: str) -> Html:
    style = STYLES[group_of(cause.outcome).name]
    where = [f"on {_listed(cause.objects)}"]
    if cause.blockers:
        where.append(f"in the way: {_listed(cause.blockers)}")
    line = shlex.join(["burg-drake", "replay", path, "--grasp", cause.typical])
    return element(
        "article",
        element(
            "h3",
            element("i", class_=style, aria_hidden="true"),
            label(cause.outcome),
            element("span", f"{count(cause.number)} ({percent(cause.number / whole)})"),
        ),
        element("p", f"{MEANING[cause.outcome]}; {'; '.join(where)}"),
        command(line),
    )


def _listed(named: tuple[tuple[str, int], ...]) -> str:
    return ", ".join(f"{name} ({count(number)})" for name, number in named)
