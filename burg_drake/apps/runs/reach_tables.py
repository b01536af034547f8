"""Tables of `burg-drake reach`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from burg_drake.core.terminal import TextTable

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet, Outcome
    from burg_drake.station.document import GraspMotion

BLOCKERS = 3
"""Most frequent bodies that are listed for each outcome."""


def print_tables(
    grasps: GraspSet, asked: Iterable[str], motion: GraspMotion, *, given: bool = False
) -> None:
    """Counts by object and by outcome, what was in the way, objects without a clear or reachable
    grasp, and how fast that was found out.

    Args:
        grasps: as `reach` has judged them.
        asked: objects that it was asked about, of which some may have no grasp.
        motion: of the hand.
        given: whether the grasps are the user's own.
    """
    from burg_drake.core.grasps import Outcome, Stage
    from burg_drake.core.terminal import format_number
    from burg_drake.evaluation.results import unclear_notes, unmoved_notes

    outcomes = [Outcome(text) for text in grasps.column("outcome").tolist()]
    by_object: dict[str, Counter[Outcome]] = {name: Counter() for name in asked}
    for name, outcome in zip(grasps.object.tolist(), outcomes, strict=True):
        by_object.setdefault(name, Counter())[outcome] += 1
    total = Counter(outcomes)
    reach_table(by_object, total).show()
    outcome_table(grasps, by_object, total).show()
    ended, blocker = grasps.column("outcome"), grasps.column("blocker")
    notes = unclear_notes(grasps.object, ended, blocker, given=given)
    for note in (*notes, *unmoved_notes(grasps.object, ended, blocker, motion)):
        print(f"note: {note}")
    clear = sum(n for o, n in total.items() if o.stage is not Stage.CLEAR)
    seconds = float(grasps.column("cpu").sum())
    if clear and seconds > 0.0:
        rate = f"{format_number(clear / seconds)} clear grasps per CPU second"
        print(f"{rate}; {format_number(seconds)} CPU seconds without set-up")


def reach_table(by_object: Mapping[str, Counter[Outcome]], total: Counter[Outcome]) -> TextTable:
    """How many grasps of each object the arm can execute."""
    from burg_drake.core.grasps import Outcome, Stage
    from burg_drake.core.terminal import format_count, format_percent

    table = TextTable("Grasps that the arm can execute").names("object")
    table.numbers("grasps", "clear", "reachable", "of clear")
    rows = {**by_object, "all": total} if len(by_object) != 1 else by_object
    for name, counts in rows.items():
        if name == "all":
            table.gap()
        clear = sum(n for o, n in counts.items() if o.stage is not Stage.CLEAR)
        good = counts[Outcome.REACHABLE]
        share = format_percent(good / clear) if clear else "-"
        table.row(
            name, format_count(counts.total()), format_count(clear), format_count(good), share
        )
    table.caption = (
        "clear: the open hand collides with nothing at the grasp\n"
        "reachable: hand and arm can go there, in and up again without a collision"
    )
    return table


def outcome_table(
    grasps: GraspSet, by_object: Mapping[str, Counter[Outcome]], total: Counter[Outcome]
) -> TextTable:
    """Outcomes by object where they fit, with what was mostly in the way."""
    from rich.console import Console

    from burg_drake.core.grasps import Outcome
    from burg_drake.core.terminal import format_count, format_percent

    room = Console().width - 70
    names = [name for name in by_object if len(by_object) > 1]
    names = names if sum(len(name) + 2 for name in names) <= room else []
    table = TextTable("Outcomes").texts("outcome")
    table.numbers(*names, "all", "share").texts("mostly in the way")
    order = [Outcome.REACHABLE, *Outcome]
    for outcome in sorted(total, key=order.index):
        mask = (grasps.column("outcome") == outcome) & (grasps.column("blocker") != "")
        blockers = Counter(grasps.column("blocker")[mask].tolist()).most_common(BLOCKERS)
        counts = [format_count(n) if (n := by_object[name][outcome]) else "·" for name in names]
        share = format_percent(total[outcome] / len(grasps))
        in_the_way = ", ".join(f"{name} ({format_count(n)})" for name, n in blockers)
        table.row(outcome.value, *counts, format_count(total[outcome]), share, in_the_way)
    failed = [one for one in Outcome if one in total and one is not Outcome.REACHABLE]
    table.caption = "\n".join(f"{outcome}: {outcome.meaning}" for outcome in failed)
    return table
