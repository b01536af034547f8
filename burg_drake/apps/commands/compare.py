"""`burg-drake compare`: simulated outcomes against real ones, or against another simulation."""

from __future__ import annotations

import argparse
from pathlib import Path

from burg_drake import core, experiment
from burg_drake.apps import options

TRIALS_SUFFIXES = (".yaml", ".yml")  # Suffixes of trials files.


def add_rejudge_options(parser: options.Parser) -> None:
    """Adds the options for judging trials again."""
    group = parser.add_argument_group("evaluate again")
    group.add_argument(
        "--rejudge",
        metavar="FOLDER",
        nargs="?",
        const="",
        help="evaluate each trial with objects where they were measured, to separate placement"
        " from physics; results are kept in FOLDER (default: beside the trials file)",
    )
    workers_group = group.add_mutually_exclusive_group()
    options.add_workers(workers_group, "worker processes (default: one for each core)")
    options.add_cluster(workers_group)
    group.add_argument("--quiet", action="store_true", help="do not show progress")


def rejudge_trials(arguments: argparse.Namespace) -> experiment.Rejudging | None:
    """Judges trials again as --rejudge requests; None without that option.

    Args:
        arguments: parsed arguments of `compare`.

    Raises:
        InvalidInputError: there are no trials; see also `rejudge`.
    """
    if arguments.rejudge is None:
        return None
    path = Path(arguments.others[-1])
    if path.suffix not in TRIALS_SUFFIXES:
        raise core.InvalidInputError(
            "--rejudge judges real trials again; give a trials file (.yaml), or leave it out"
        )
    from burg_drake.evaluation import LocalExecutor, load_runs

    sheet, run = experiment.load_trials(path), Path(arguments.run_folder)
    folder = arguments.rejudge or path.with_name(f"{path.stem}_rejudged_{run.resolve().name}")
    with options.cluster_from_options(arguments) as cluster:
        return experiment.rejudge(
            sheet,
            path,
            folder,
            runs=experiment.match_runs_to_sources(sheet, load_runs(run)),
            success=arguments.success,
            executor=cluster or LocalExecutor(arguments.workers or core.default_workers()),
            progress=not arguments.quiet,
        )


def add_compare_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake compare`."""
    parser.epilog = options.examples_text(
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
        choices=experiment.SUCCESS_CRITERIA,
        help="what counts as success; held includes turned objects and moved neighbours (default:"
        " as planned, else lifted)",
    )
    parser.add_argument(
        "--placement-limit-mm",
        metavar="MM",
        type=options.not_negative,
        default=experiment.PLACEMENT_LIMIT_MM,
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
        type=options.seed,
        default=0,
        help="random seed of the intervals (default: %(default)s)",
    )
    parser.add_argument("--html", metavar="FILE", help="page to write (.html)")
    parser.add_argument("--json", action="store_true", help="print JSON")
    add_rejudge_options(parser)


def run_compare(arguments: argparse.Namespace) -> int:
    """Compares a run with trials or with another run."""
    second, trials = _split_compared_paths(arguments.run_folder, arguments.others)
    if arguments.html is not None:
        core.require_writable(arguments.html)
    comparison = experiment.compare(
        arguments.run_folder,
        second,
        trials,
        success=arguments.success,
        placement_limit_mm=arguments.placement_limit_mm,
        robustness=arguments.robustness,
        seed=arguments.seed,
    )
    rejudging = rejudge_trials(arguments)
    if arguments.html is not None:
        additions = [] if rejudging is None else [experiment.rejudged_section(rejudging)]
        page = experiment.comparison_page(
            comparison, Path(arguments.html), arguments.command_line, additions
        )
        core.atomic_write(arguments.html, page)
    _print_comparison(comparison, rejudging, arguments)
    return 0


def _print_comparison(
    comparison: experiment.Comparison,
    rejudging: experiment.Rejudging | None,
    arguments: argparse.Namespace,
) -> None:
    if arguments.json:
        additions = {} if rejudging is None else {"rejudged": experiment.rejudging_json(rejudging)}
        print(experiment.comparison_json(comparison, additions), end="")
        return
    from rich.console import Console

    console = Console(markup=False, highlight=False)
    for part in experiment.comparison_tables(comparison):
        console.print(part, crop=False)
        if not isinstance(part, str) or not part.startswith(("differs", "note")):
            console.print()
    if rejudging is not None:
        experiment.rejudged_view(rejudging).show()
        print(f"again   {rejudging.path}")
    if arguments.html is not None:
        print(f"page    {arguments.html}")


def _split_compared_paths(first: str, paths: list[str]) -> tuple[str, str | None]:
    """Path to compare the run with; if that is another run, also the path of the trials."""
    if len(paths) > 2:
        raise core.InvalidInputError(
            f"{len(paths) + 1} things to compare; give RUN TRIALS, RUN RUN, or RUN RUN TRIALS"
        )
    if Path(first).suffix in TRIALS_SUFFIXES and Path(first).is_file():
        raise core.InvalidInputError(
            f"{core.shorten_text(first)} is not a run; give the run first, then the trials"
        )
    kinds = [Path(path).suffix in TRIALS_SUFFIXES for path in paths]
    shown = [core.shorten_text(path) for path in paths]
    if kinds == [True, False]:
        raise core.InvalidInputError(f"{shown[0]} is before {shown[1]}; give the trials file last")
    if len(paths) == 2 and kinds != [False, True]:
        raise core.InvalidInputError(
            f"{shown[0]} and {shown[1]} are of the same kind; give another run, then a trials file"
            " (.yaml)"
        )
    return paths[0], paths[1] if len(paths) == 2 else None
