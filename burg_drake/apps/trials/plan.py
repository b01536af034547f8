"""`burg-drake trials plan`: chooses grasps of runs for the robot, and says what they will tell."""

from __future__ import annotations

import argparse
from collections import Counter
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import add_verb, positive_int, seed
from burg_drake.core.files import require_writable

if TYPE_CHECKING:
    from burg_drake.experiment.trials import TrialSheet

# Kept in step with experiment.trials.sheet, which imports too much for a help text; a test compares
# them.
AMONG = ("clear", "reachable", "executed")
SUCCESS = ("lifted", "held")


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "plan",
        run_plan,
        "choose grasps of runs for trials on the robot, in a random order",
        "burg-drake trials plan runs/first --per-object 10 -o trials.yaml",
        "burg-drake trials plan runs/many --scenes 5 --balance margin:clearance -o t.yaml",
        "burg-drake trials plan runs/a runs/b --balance stage --among clear --seed 7 -o t.yaml",
        "",
        "The same grasps are chosen whatever the order of the runs. A grasp that several runs have",
        "judged on the same scene and station is tried once.",
    )
    parser.add_argument("runs", metavar="RUN", nargs="+", help="folder of a run")
    parser.add_argument(
        "--per-object",
        metavar="N",
        type=positive_int,
        default=10,
        help="grasps of each object of a run, if there are as many (default: %(default)s)",
    )
    parser.add_argument(
        "--balance",
        metavar="BY",
        default="outcome",
        help="what the grasps of an object are balanced by, as far as there are enough: outcome"
        " (success and failure in simulation), stage (each outcome by itself), margin:NAME,"
        " probability (success under noise, of `robustness`) or none (default: %(default)s)",
    )
    parser.add_argument(
        "--bins",
        metavar="N",
        type=positive_int,
        default=4,
        help="of a margin or a probability, with as many grasps each (default: %(default)s)",
    )
    parser.add_argument(
        "--among",
        choices=AMONG,
        default="executed",
        help="choose among grasps at which the hand is clear, that the arm can be at, or that were"
        " tried in simulation (default: %(default)s; without an arm that is the same as clear)",
    )
    parser.add_argument(
        "--success",
        choices=SUCCESS,
        default="lifted",
        help="what counts: lifted, or held, also where another object was moved"
        " (default: %(default)s)",
    )
    parser.add_argument(
        "--scenes", metavar="N", type=positive_int, default=0, help="draw N scenes (default: all)"
    )
    parser.add_argument(
        "--blocks",
        metavar="N",
        type=positive_int,
        default=1,
        help="blocks for the trials of a scene; each scene has one before any has its second"
        " (default: %(default)s)",
    )
    parser.add_argument(
        "--robustness",
        metavar="TABLE",
        help="table with the probabilities (default: robustness.csv in the run's folder)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=seed, default=0, help="of choice and order (default: 0)"
    )
    parser.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="trials file to write (.yaml)"
    )


def run_plan(arguments: argparse.Namespace) -> int:
    """Chooses, writes, and prints what was chosen and what it will tell."""
    from burg_drake.experiment.planning import difference_text, plan_trials, power_table

    require_writable(arguments.output)
    sheet = plan_trials(
        arguments.runs,
        per_object=arguments.per_object,
        balance=arguments.balance,
        bins=arguments.bins,
        among=arguments.among,
        success=arguments.success,
        scenes=arguments.scenes,
        blocks=arguments.blocks,
        seed=arguments.seed,
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
