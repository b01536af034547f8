"""`burg-drake compare`: simulated outcomes against real ones, or against another simulation."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.comparison.rejudge import (
    add_rejudge,
    rejudge_for,
    rejudge_words,
    show_rejudged,
)
from burg_drake.apps.options import Parser, add_verb, not_negative, seed
from burg_drake.core import InvalidInputError, shown

if TYPE_CHECKING:
    from burg_drake.experiment.comparison import Comparison
    from burg_drake.experiment.gap import Rejudging

TRIALS = (".yaml", ".yml")
"""Suffixes of trials files."""


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    add_verb(
        verbs,
        "compare",
        run_compare,
        "compare a run with trials on the robot, or another run",
        "burg-drake compare runs/first trials.yaml --html compare.html",
        "burg-drake compare runs/first trials.yaml --json",
        "burg-drake compare runs/first trials.yaml --rejudge --html compare.html",
        "burg-drake compare runs/screening runs/standard",
        "burg-drake compare runs/screening runs/standard trials.yaml",
        "",
        "With two runs, the second takes the place of the robot. With trials as well, both runs"
        " are compared with them, and McNemar's test says whether one is right more often.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.experiment.comparison import LIMIT_MM, SUCCESSES

    parser.add_argument("run_folder", metavar="RUN", help="folder of a run")
    parser.add_argument(
        "others",
        metavar="RUN|TRIALS",
        nargs="+",
        help="trials file (.yaml), or folder of another run of the same grasps",
    )
    parser.add_argument(
        "--success",
        choices=SUCCESSES,
        help="what counts as success; held includes turned objects and moved neighbours (default:"
        " as planned, else lifted)",
    )
    parser.add_argument(
        "--placement-limit-mm",
        metavar="MM",
        type=not_negative,
        default=LIMIT_MM,
        help=(
            "largest distance of objects from their targets in well placed trials (default:"
            " %(default)g)"
        ),
    )
    parser.add_argument(
        "--robustness",
        metavar="FILE",
        help="table of robustness with predicted probabilities (default: robustness.csv in RUN)",
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=seed,
        default=0,
        help="random seed of the intervals (default: %(default)s)",
    )
    parser.add_argument("--html", metavar="FILE", help="page to write (.html)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_rejudge(parser)


def run_compare(arguments: argparse.Namespace) -> int:
    """Compares."""
    from burg_drake.core.files import atomic_write, require_writable
    from burg_drake.experiment.comparison import compare

    second, trials = _others(arguments.run_folder, arguments.others)
    if arguments.html is not None:
        require_writable(arguments.html)
    found = compare(
        arguments.run_folder,
        second,
        trials,
        success=arguments.success,
        placement_limit_mm=arguments.placement_limit_mm,
        robustness=arguments.robustness,
        seed=arguments.seed,
    )
    again = rejudge_for(arguments)
    if arguments.html is not None:
        from burg_drake.experiment.comparison.report import comparison_page
        from burg_drake.experiment.gap.report import rejudged_section

        more = [] if again is None else [rejudged_section(again)]
        page = comparison_page(found, Path(arguments.html), command_line(arguments), more)
        atomic_write(arguments.html, page)
    _print(found, again, arguments)
    return 0


def command_line(arguments: argparse.Namespace) -> str:
    """The command that makes this comparison again."""
    import shlex

    from burg_drake.experiment.comparison import LIMIT_MM

    words = ["burg-drake", "compare", arguments.run_folder, *arguments.others]
    words += [] if arguments.success is None else ["--success", arguments.success]
    if arguments.placement_limit_mm != LIMIT_MM:
        words += ["--placement-limit-mm", f"{arguments.placement_limit_mm:g}"]
    words += [] if arguments.robustness is None else ["--robustness", arguments.robustness]
    words += [] if arguments.seed == 0 else ["--seed", str(arguments.seed)]
    words += rejudge_words(arguments)
    return shlex.join([*words, "--html", arguments.html])


def _print(found: Comparison, again: Rejudging | None, arguments: argparse.Namespace) -> None:
    if arguments.json:
        from burg_drake.experiment.comparison import comparison_json
        from burg_drake.experiment.gap import rejudging_json

        more = {} if again is None else {"rejudged": rejudging_json(again)}
        print(comparison_json(found, more), end="")
        return
    from rich.console import Console

    from burg_drake.experiment.comparison import comparison_tables

    console = Console(markup=False, highlight=False)
    for part in comparison_tables(found):
        console.print(part, crop=False)
        if not isinstance(part, str) or not part.startswith(("differs", "note")):
            console.print()
    show_rejudged(again)
    if arguments.html is not None:
        print(f"page    {arguments.html}")


def _others(first: str, paths: list[str]) -> tuple[str, str | None]:
    """What the run is compared with, and the trials if that is another run."""
    if len(paths) > 2:
        raise InvalidInputError(
            f"{len(paths) + 1} things to compare; give RUN TRIALS, RUN RUN, or RUN RUN TRIALS"
        )
    if Path(first).suffix in TRIALS and Path(first).is_file():
        raise InvalidInputError(f"{shown(first)} is not a run; give the run first, then the trials")
    kinds = [Path(path).suffix in TRIALS for path in paths]
    if kinds == [True, False]:
        raise InvalidInputError(
            f"{shown(paths[0])} is before {shown(paths[1])}; give the trials file last"
        )
    if len(paths) == 2 and kinds != [False, True]:
        raise InvalidInputError(
            f"{shown(paths[0])} and {shown(paths[1])} are of the same kind; give another run, then"
            " a trials file (.yaml)"
        )
    return paths[0], paths[1] if len(paths) == 2 else None
