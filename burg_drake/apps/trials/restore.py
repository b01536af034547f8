"""`burg-drake trials restore`: enters again what an editor has overwritten."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake.apps.options import add_verb, positive_int
from burg_drake.apps.trials.arguments import add_sheet, print_damage


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "restore",
        run_restore,
        ("restore recorded outcomes that the file has lost"),
        "burg-drake trials restore trials.yaml",
        "burg-drake trials restore trials.yaml --number 17",
        "burg-drake trials restore trials.yaml --number 17 --keep",
        "",
        "Values that were edited by hand stay.",
    )
    add_sheet(parser)
    parser.add_argument(
        "--number",
        metavar="N",
        type=positive_int,
        action="append",
        help="number of a trial (default: all); repeatable",
    )
    parser.add_argument(
        "--keep", action="store_true", help="keep the file as it is; it is right, not the journal"
    )


def run_restore(arguments: argparse.Namespace) -> int:
    """Restores, and says what; 1 if the journal is damaged."""
    from burg_drake.experiment.trials import TrialBook

    book = TrialBook(arguments.trials)
    for number in arguments.number or ():
        book.trial(number)
    done = (book.keep if arguments.keep else book.restore)(arguments.number)
    what = "kept as it is in the file" if arguments.keep else "restored"
    for trial in done:
        outcome = "no outcome" if trial.outcome is None else trial.outcome.value
        print(f"trial {trial.number}: {what}, {outcome}")
    if not done:
        print("nothing to restore")
    return 1 if print_damage(book) else 0
