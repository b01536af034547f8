"""The report's section on failures by cause, each with a typical grasp to watch."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import Array
from burg_drake.core.grasps import Outcome
from burg_drake.core.terminal import format_count, format_percent
from burg_drake.evaluation.records import Columns
from burg_drake.evaluation.report.elements import STYLES, Html, command, element, section
from burg_drake.evaluation.report.sections.outcomes import label
from burg_drake.evaluation.store import Texts, member_codes, texts_of
from burg_drake.visualization.style import group_of

NO_FAILURE = (Outcome.LIFTED, Outcome.REACHABLE)
"""Outcomes without a cause to look for."""
TYPICAL_BY = (
    ("overlap", ("collision_",)),
    ("joint_excess", ("joint_limit",)),
    ("arm_clearance", ("arm_collision", "hand_collision_")),
    ("others_moved", ("lifted_disturbed",)),
    ("tilt", ("lifted_turned",)),
    ("slip", ("slipped", "dropped")),
    ("lift", ("blocked",)),
)
"""Which margin tells a weak case of an outcome from a strong one; by beginnings of outcomes."""
MARGINS_ASKED = tuple(name for name, _ in TYPICAL_BY)
NAMED = 3
"""Most frequent objects and blockers that are listed for each outcome."""


@dataclass(frozen=True, eq=False)
class CauseRows:
    """What is asked about the grasps of one run or of many.

    Attributes:
        outcomes: (N,) places in `Outcome`.
        objects, blockers: what each grasp is on, and what was in its way.
        margins: (N,) by name of `MARGINS_ASKED`; those that the runs have.
        replay: the command that shows the grasp of a row.
    """

    outcomes: NDArray[np.int8]
    objects: Texts
    blockers: Texts
    margins: Mapping[str, Array]
    replay: Callable[[int], str]


@dataclass(frozen=True)
class Cause:
    """Grasps that ended alike.

    Attributes:
        outcome: how.
        number: of grasps.
        objects, blockers: what they are on and what was in their way, with how often, most frequent
            first.
        typical: row of the median one.
    """

    outcome: Outcome
    number: int
    objects: tuple[tuple[str, int], ...]
    blockers: tuple[tuple[str, int], ...]
    typical: int


def rows_of_run(columns: Columns, path: str) -> CauseRows:
    """Those of a run in a folder."""
    ids = columns["id"]

    def replay(row: int) -> str:
        return shlex.join(["burg-drake", "replay", path, "--grasp", str(ids[row])])

    return CauseRows(
        outcomes=member_codes(columns["outcome"], tuple(Outcome)),
        objects=texts_of(columns["object"]),
        blockers=texts_of(columns["blocker"]),
        margins={name: columns[name] for name in MARGINS_ASKED if name in columns},
        replay=replay,
    )


def causes_of(rows: CauseRows) -> list[Cause]:
    """Why grasps did not succeed, the most frequent cause first."""
    found = []
    for place, outcome in enumerate(Outcome):
        mine = np.flatnonzero(rows.outcomes == place).astype(np.int64)
        if len(mine) and outcome not in NO_FAILURE:
            objects = rows.objects.most_common(mine, NAMED)
            blockers = rows.blockers.most_common(mine, NAMED)
            typical = typical_row(rows.margins, mine, outcome)
            found.append(Cause(outcome, len(mine), objects, blockers, typical))
    return sorted(found, key=lambda cause: -cause.number)


def typical_row(margins: Mapping[str, Array], rows: NDArray[np.int64], outcome: Outcome) -> int:
    """The median row of those with an outcome: by the margin that tells how strong a case it is,
    and by their order among equal ones; half of the cases are weaker, and half are stronger."""
    name = next((m for m, starts in TYPICAL_BY if outcome.value.startswith(starts)), "")
    values = margins[name][rows] if name in margins else np.zeros(len(rows))
    known = np.isfinite(values)
    if known.any():
        rows, values = rows[known], values[known]
    order = np.argsort(values, kind="stable")
    return int(rows[order[(len(rows) - 1) // 2]])


def causes_section(rows: CauseRows) -> Html | None:
    """Each cause with its meaning, how often, where, and the command that shows a typical grasp;
    nothing where all grasps were lifted."""
    causes = causes_of(rows)
    if not causes:
        return None
    entries = (_entry(cause, len(rows.outcomes), rows.replay(cause.typical)) for cause in causes)
    return section(
        "Why grasps fail",
        "The most frequent cause comes first. The command shows a typical case: half of"
        " the others are milder, half are worse.",
        element("div", *entries, class_="causes"),
    )


def _entry(cause: Cause, whole: int, replay: str) -> Html:
    style = STYLES[group_of(cause.outcome).name]
    where = [f"on {_listed(cause.objects)}"]
    if cause.blockers:
        where.append(f"in the way: {_listed(cause.blockers)}")
    return element(
        "article",
        element(
            "h3",
            element("i", class_=style, aria_hidden="true"),
            label(cause.outcome),
            element(
                "span", f"{format_count(cause.number)} ({format_percent(cause.number / whole)})"
            ),
        ),
        element("p", f"{cause.outcome.meaning}; {'; '.join(where)}"),
        command(replay),
    )


def _listed(named: tuple[tuple[str, int], ...]) -> str:
    return ", ".join(f"{name} ({format_count(number)})" for name, number in named)
