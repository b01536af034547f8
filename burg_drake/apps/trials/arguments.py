"""Arguments that verbs of `burg-drake trials` share."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from burg_drake.apps.options import Parser
from burg_drake.core import quoted

if TYPE_CHECKING:
    from burg_drake.experiment.trials import TrialBook


def add_sheet(parser: Parser) -> None:
    """The argument TRIALS."""
    parser.add_argument("trials", metavar="TRIALS", help="trials file of `trials plan`")


def add_moved(parser: Parser) -> None:
    """The option --run, for folders that have moved."""
    parser.add_argument(
        "--run",
        dest="moved",
        metavar="KEY=FOLDER",
        type=_moved,
        action="append",
        default=[],
        help="folder of a run, if it has moved",
    )


def add_show_simulated(parser: Parser, more: str = "") -> None:
    """The option --show-simulated, of verbs that operators look at.

    Args:
        parser: gets it.
        more: is hidden, too, after "the simulated outcomes".
    """
    parser.add_argument(
        "--show-simulated",
        action="store_true",
        help=f"show the simulated outcomes{more}; hidden to keep operators blind",
    )


def print_damage(book: TrialBook) -> bool:
    """Prints damaged lines of the journal to standard error. Returns True if there are any."""
    damage = book.damage()
    if damage:
        print(f"burg-drake: {damage}", file=sys.stderr)
    return bool(damage)


def _moved(text: str) -> tuple[str, str]:
    key, equals, folder = text.partition("=")
    if not key or not equals or not folder:
        raise argparse.ArgumentTypeError(f"{quoted(text)} is not KEY=FOLDER")
    return key, folder
