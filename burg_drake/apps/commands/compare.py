"""`burg-drake compare`: simulated outcomes against real ones, or against another simulation."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.apps.options.arguments import (
    Parser,
    add_cluster,
    add_workers,
    cluster_from_options,
    examples_text,
)
from burg_drake.apps.options.values import not_negative, seed
from burg_drake.core import InvalidInputError, shorten_text

if TYPE_CHECKING:
    from burg_drake.experiment import Comparison, Rejudging


def add_rejudge_options(parser: Parser) -> None:
    """Adds the options."""
    group = parser.add_argument_group("evaluate again")
    group.add_argument(
        "--rejudge",
        metavar="FOLDER",
        nargs="?",
        const="",
        help="evaluate each trial with objects where they were measured, to separate placement"
        " from physics; results are kept in FOLDER (default: beside the trials file)",
    )
    who = group.add_mutually_exclusive_group()
    add_workers(who, "worker processes (default: one for each core)")
    add_cluster(who)
    group.add_argument("--quiet", action="store_true", help="do not show progress")


def rejudge_trials(arguments: argparse.Namespace) -> Rejudging | None:
    """Judges again what --rejudge asks for; nothing if it does not.

    Args:
        arguments: those of `compare`.

    Raises:
        InvalidInputError: there are no trials; and see `rejudge`.
    """
    if arguments.rejudge is None:
        return None
    trials = arguments.others[-1]
    if Path(trials).suffix not in (".yaml", ".yml"):
        raise InvalidInputError(
            "--rejudge judges real trials again; give a trials file (.yaml), or leave it out"
        )
    run = arguments.run_folder
    from burg_drake.core import default_workers
    from burg_drake.evaluation import LocalExecutor, load_runs
    from burg_drake.experiment import load_trials, match_runs_to_sources, rejudge

    sheet, path = load_trials(trials), Path(trials)
    folder = arguments.rejudge or path.with_name(f"{path.stem}_rejudged_{Path(run).resolve().name}")
    with cluster_from_options(arguments) as cluster:
        return rejudge(
            sheet,
            path,
            folder,
            runs=match_runs_to_sources(sheet, load_runs(run)),
            success=arguments.success,
            executor=cluster or LocalExecutor(arguments.workers or default_workers()),
            progress=not arguments.quiet,
        )


def rejudge_command_words(arguments: argparse.Namespace) -> list[str]:
    """The options of a command line that asks for the same."""
    if arguments.rejudge is None:
        return []
    return ["--rejudge", *([arguments.rejudge] if arguments.rejudge else [])]


def print_rejudged(found: Rejudging | None) -> None:
    """Prints what came of it."""
    if found is None:
        return
    from burg_drake.experiment import rejudged_view

    rejudged_view(found).show()
    print(f"again   {found.path}")


def add_compare_options(parser: Parser) -> None:
    """Adds the options of `burg-drake compare`."""
    from burg_drake.experiment import PLACEMENT_LIMIT_MM, SUCCESS_CRITERIA

    parser.epilog = examples_text(
        "burg-drake compare runs/first trials.yaml --html compare.html",
        "burg-drake compare runs/first trials.yaml --json",
        "burg-drake compare runs/first trials.yaml --rejudge --html compare.html",
        "burg-drake compare runs/screening runs/standard",
        "burg-drake compare runs/screening runs/standard trials.yaml",
        "",
        "With two runs, the second takes the place of the robot. With trials as well, both runs"
        " are compared with them, and McNemar's test says whether one is right more often.",
    )
    parser.add_argument("run_folder", metavar="RUN", help="folder of a run")
    parser.add_argument(
        "others",
        metavar="RUN|TRIALS",
        nargs="+",
        help="trials file (.yaml), or folder of another run of the same grasps",
    )
    parser.add_argument(
        "--success",
        choices=SUCCESS_CRITERIA,
        help="what counts as success; held includes turned objects and moved neighbours (default:"
        " as planned, else lifted)",
    )
    parser.add_argument(
        "--placement-limit-mm",
        metavar="MM",
        type=not_negative,
        default=PLACEMENT_LIMIT_MM,
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
    add_rejudge_options(parser)


def run_compare(arguments: argparse.Namespace) -> int:
    """Compares."""
    from burg_drake.core import atomic_write, require_writable
    from burg_drake.experiment import compare

    second, trials = _split_compared_paths(arguments.run_folder, arguments.others)
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
    again = rejudge_trials(arguments)
    if arguments.html is not None:
        from burg_drake.experiment import comparison_page, rejudged_section

        more = [] if again is None else [rejudged_section(again)]
        page = comparison_page(found, Path(arguments.html), compare_command_line(arguments), more)
        atomic_write(arguments.html, page)
    _print_comparison(found, again, arguments)
    return 0


def compare_command_line(arguments: argparse.Namespace) -> str:
    """The command that makes this comparison again."""
    import shlex

    from burg_drake.experiment import PLACEMENT_LIMIT_MM

    words = ["burg-drake", "compare", arguments.run_folder, *arguments.others]
    words += [] if arguments.success is None else ["--success", arguments.success]
    if arguments.placement_limit_mm != PLACEMENT_LIMIT_MM:
        words += ["--placement-limit-mm", f"{arguments.placement_limit_mm:g}"]
    words += [] if arguments.robustness is None else ["--robustness", arguments.robustness]
    words += [] if arguments.seed == 0 else ["--seed", str(arguments.seed)]
    words += rejudge_command_words(arguments)
    return shlex.join([*words, "--html", arguments.html])


def _print_comparison(
    found: Comparison, again: Rejudging | None, arguments: argparse.Namespace
) -> None:
    if arguments.json:
        from burg_drake.experiment import comparison_json, rejudging_json

        more = {} if again is None else {"rejudged": rejudging_json(again)}
        print(comparison_json(found, more), end="")
        return
    from rich.console import Console

    from burg_drake.experiment import comparison_tables

    console = Console(markup=False, highlight=False)
    for part in comparison_tables(found):
        console.print(part, crop=False)
        if not isinstance(part, str) or not part.startswith(("differs", "note")):
            console.print()
    print_rejudged(again)
    if arguments.html is not None:
        print(f"page    {arguments.html}")


def _split_compared_paths(first: str, paths: list[str]) -> tuple[str, str | None]:
    """What the run is compared with, and the trials if that is another run."""
    trials_suffixes = (".yaml", ".yml")  # Suffixes of trials files.
    if len(paths) > 2:
        raise InvalidInputError(
            f"{len(paths) + 1} things to compare; give RUN TRIALS, RUN RUN, or RUN RUN TRIALS"
        )
    if Path(first).suffix in trials_suffixes and Path(first).is_file():
        raise InvalidInputError(
            f"{shorten_text(first)} is not a run; give the run first, then the trials"
        )
    kinds = [Path(path).suffix in trials_suffixes for path in paths]
    if kinds == [True, False]:
        raise InvalidInputError(
            f"{shorten_text(paths[0])} is before {shorten_text(paths[1])}; give the trials file"
            " last"
        )
    if len(paths) == 2 and kinds != [False, True]:
        raise InvalidInputError(
            f"{shorten_text(paths[0])} and {shorten_text(paths[1])} are of the same kind; give"
            " another run, then a trials file (.yaml)"
        )
    return paths[0], paths[1] if len(paths) == 2 else None
