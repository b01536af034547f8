"""`burg-drake trials export`: the timed motion of each trial, for the robot."""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from typing import TYPE_CHECKING, Any, get_args

from burg_drake.apps.options import (
    Parser,
    add_quiet,
    add_retry_failed,
    add_station,
    add_verb,
    add_workers,
)
from burg_drake.apps.trials.arguments import add_moved, add_sheet
from burg_drake.core import shown

if TYPE_CHECKING:
    from burg_drake.experiment.trials import ExportedMotion


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "export",
        run_export,
        "write the robot motion of each trial to a file",
        "burg-drake trials export trials.yaml -o plans/",
        "burg-drake trials export trials.yaml -o plans/ --format csv --station my_cell.yaml",
        "",
        "The file index.csv lists all trials and what stops the arm. The same command continues"
        " where an interrupted one stopped. Exit code 1 if a trial could not be planned.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.evaluation.store import PlanFormat

    add_sheet(parser)
    parser.add_argument(
        "-o",
        "--output",
        metavar="DIR",
        required=True,
        help="folder to write, 1.5 MB per motion",
    )
    parser.add_argument(
        "--format",
        choices=get_args(PlanFormat),
        default="json",
        help="JSON like ROS's JointTrajectory, or CSV tables (default: %(default)s)",
    )
    add_station(parser, "station with the arm (default: that of each run)", default=None)
    add_moved(parser)
    add_workers(parser)
    add_retry_failed(parser, "trials")
    add_quiet(parser)
    parser.set_defaults(after_interrupt="; run the same command to continue")


def run_export(arguments: argparse.Namespace) -> int:
    """Plans and writes; 1 if a trial could not be judged."""
    from burg_drake.experiment.trials import INDEX_FILE, export_trials

    rows = export_trials(
        arguments.trials,
        arguments.output,
        format=arguments.format,
        station=arguments.station,
        moved=dict(arguments.moved),
        retry_failed=arguments.retry_failed,
        workers=arguments.workers,
        progress=not arguments.quiet,
    )
    _print_hindered(rows)
    written = sum(bool(row.file) for row in rows)
    print(f"{written} of {len(rows)} motions are in {arguments.output}, listed in {INDEX_FILE}")
    failed = [row for row in rows if row.reason and not row.file]
    if failed:
        first = failed[0]
        print(
            f"burg-drake: {len(failed)} trials have no motion because a computation failed, such"
            f" as {first.number}: {shown(first.reason, 200)}",
            file=sys.stderr,
        )
    return 1 if failed else 0


def _print_hindered(rows: list[ExportedMotion]) -> None:
    """Trials that the arm cannot execute, and why."""
    from burg_drake.core.terminal import TextTable

    hindered = [row for row in rows if not row.file and not row.reason]
    if not hindered:
        return
    table = TextTable("The arm cannot execute").numbers("trial").texts("grasp", "because of")
    for row in hindered:
        table.row(str(row.number), row.grasp, f"{row.answer} {row.blocker}".strip())
    counts = Counter(row.answer for row in hindered)
    text = ", ".join(f"{count} {answer}" for answer, count in counts.most_common())
    table.caption = f"{text}; record them as such, or plan with --among reachable or executed"
    table.show()
