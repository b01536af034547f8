"""`burg-drake trials show`: how far the trials are, and what the file lacks of its journal."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import add_verb
from burg_drake.apps.trials.arguments import add_sheet, add_show_simulated, print_damage

if TYPE_CHECKING:
    from burg_drake.experiment.trials import MissingValues, RealTrial, TrialSheet


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "show",
        run_show,
        "print the progress of the trials",
        "burg-drake trials show trials.yaml",
        "burg-drake trials show trials.yaml --all",
        "",
        "Exit code 1 if the file lacks entries of its journal, as after an editor saved an old"
        " version: `trials restore` brings them back.",
    )
    add_sheet(parser)
    parser.add_argument("--all", action="store_true", help="also print a line for each trial")
    add_show_simulated(parser, " and the notes on the selection")


def run_show(arguments: argparse.Namespace) -> int:
    """Prints; 1 if entries are missing, or the journal is damaged."""
    from burg_drake.experiment.trials import TrialBook

    book = TrialBook(arguments.trials)
    sheet = book.sheet()
    for key, run in sheet.runs.items():
        print(f"run {key}: {run.hash}, scene {run.scene.name}, mode {run.mode}, in {run.path}")
    if arguments.all:
        _print_trials(sheet.trials, arguments.show_simulated)
    _print_progress(sheet, arguments.show_simulated)
    begun = any(trial.carried_out for trial in sheet.trials)
    for note in () if begun or not arguments.show_simulated else sheet.notes:
        print(f"note: {note}")
    if sheet.next is not None:
        print(f"next is {sheet.next.number}: {sheet.next.grasp}")
    lacking = book.missing_values()
    _print_lacking(arguments.trials, lacking)
    damage = print_damage(book)
    return 1 if damage or any(found.values for found in lacking) else 0


def _print_progress(sheet: TrialSheet, simulated: bool) -> None:
    """How many trials of each object are done, and how they ended."""
    from burg_drake.core.terminal import TextTable
    from burg_drake.experiment.trials import succeeded

    table = TextTable().names("object")
    table.numbers("trials", "done", "tried")
    table.numbers(*(["success\nin simulation"] if simulated else []), "success\non the robot")
    success = sheet.selection.success

    def row(name: str, trials: Sequence[RealTrial], *, bold: bool = False) -> None:
        outcomes = [t.outcome for t in trials if t.outcome is not None]
        counts = (
            len(trials),
            len(outcomes),
            sum(outcome.attempted for outcome in outcomes),
            *([sum(succeeded(t.simulated, success) for t in trials)] if simulated else []),
            sum(succeeded(outcome, success) for outcome in outcomes),
        )
        table.row(name, *map(str, counts), bold=bold)

    for name in sorted({trial.object for trial in sheet.trials}):
        row(name, [trial for trial in sheet.trials if trial.object == name])
    row("all", sheet.trials, bold=True)
    table.show()


def _print_trials(trials: Sequence[RealTrial], simulated: bool) -> None:
    from burg_drake.core.terminal import TextTable

    table = TextTable().numbers("trial", "block").texts("grasp", "outcome", "note")
    table.texts(*(["simulated"] if simulated else []))
    for trial in trials:
        outcome = "" if trial.outcome is None else trial.outcome.value
        cells = [str(trial.number), str(trial.block), trial.grasp, outcome, trial.note]
        table.row(*cells, *([trial.simulated.value] if simulated else []))
    table.show()


def _print_lacking(path: str, lacking: Sequence[MissingValues]) -> None:
    """What the journal has and the file has not."""
    for found in lacking:
        if found.values:
            text = ", ".join(
                f"{name} {value}" if isinstance(value, str) else name
                for name, value in found.values.items()
            )
            print(
                f"burg-drake: trial {found.number} lacks what was recorded: {text}", file=sys.stderr
            )
        if found.edited:
            print(f"trial {found.number}: {', '.join(found.edited)} edited by hand since recorded")
    if any(found.values for found in lacking):
        print(
            f"burg-drake: `burg-drake trials restore {path}` brings it back; with --keep the file"
            " stays as it is",
            file=sys.stderr,
        )
