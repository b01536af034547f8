"""`burg-drake trials plan`: chooses grasps of runs for the robot, and says what they will tell."""

from __future__ import annotations

import argparse
from collections import Counter
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import Parser, add_options, add_verb, settings_from
from burg_drake.core.files import require_writable

if TYPE_CHECKING:
    from burg_drake.experiment.trials import TrialSheet


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "plan",
        run_plan,
        "choose grasps to try on the robot, in random order",
        "burg-drake trials plan runs/first --per-object 10 -o trials.yaml",
        "burg-drake trials plan runs/many --scenes 5 --balance margin:clearance -o t.yaml",
        "burg-drake trials plan runs/a runs/b --balance stage --among clear --seed 7 -o t.yaml",
        "",
        "A grasp that several runs evaluated is tried once.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.experiment.planning import SelectionSettings

    parser.add_argument("runs", metavar="RUN", nargs="+", help="folder of a run")
    choice = ("per_object", "balance", "bins", "among", "success", "scenes", "blocks")
    add_options(parser, SelectionSettings, *choice)
    parser.add_argument(
        "--robustness",
        metavar="TABLE",
        help="table of robustness (default: robustness.csv in the run's folder)",
    )
    add_options(parser, SelectionSettings, "seed")
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="trials file to write (.yaml)"
    )


def run_plan(arguments: argparse.Namespace) -> int:
    """Chooses, writes, and prints what was chosen and what it will tell."""
    from burg_drake.experiment.planning import (
        SelectionSettings,
        difference_text,
        plan_trials,
        power_table,
    )

    require_writable(arguments.output)
    sheet = plan_trials(
        arguments.runs,
        settings=settings_from(arguments, SelectionSettings),
        robustness=arguments.robustness,
        out=arguments.output,
    )
    _print_choice(sheet)
    power_table(sheet).show()
    print(difference_text(len(sheet.trials)))
    for note in sheet.notes:
        print(f"note: {note}")
    print(f"wrote {len(sheet.trials)} trials to {arguments.output}")
    return 0


def _print_choice(sheet: TrialSheet) -> None:
    """Chosen grasps by object and stratum, summed over the runs."""
    from burg_drake.core.terminal import TextTable

    chosen: Counter[tuple[str, str]] = Counter()
    there: Counter[tuple[str, str]] = Counter()
    for stratum in sheet.strata.values():
        chosen[stratum.object, stratum.label] += stratum.selected
        there[stratum.object, stratum.label] += stratum.population
    table = TextTable("Chosen for the robot").names("object").texts("stratum")
    table.numbers("chosen", "there are")
    for held, label in sorted(there):
        counts = (chosen[held, label], there[held, label])
        table.row(held, label, *map(str, counts))
    table.row("all", "", str(chosen.total()), str(there.total()), bold=True)
    table.show()
