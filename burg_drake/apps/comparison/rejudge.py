"""The option by which `compare` judges real trials again where their objects stood."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.apps.options import Parser, add_cluster, add_workers, chosen_cluster
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.experiment.gap import Rejudging


def add_rejudge(parser: Parser) -> None:
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


def rejudge_for(arguments: argparse.Namespace) -> Rejudging | None:
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
    from burg_drake.core.workers import default_workers
    from burg_drake.evaluation.store import load_runs
    from burg_drake.evaluation.workers import LocalExecutor
    from burg_drake.experiment.gap import rejudge, runs_for
    from burg_drake.experiment.trials import load_trials

    sheet, path = load_trials(trials), Path(trials)
    folder = arguments.rejudge or path.with_name(f"{path.stem}_rejudged_{Path(run).resolve().name}")
    with chosen_cluster(arguments) as cluster:
        return rejudge(
            sheet,
            path,
            folder,
            runs=runs_for(sheet, load_runs(run)),
            success=arguments.success,
            executor=cluster or LocalExecutor(arguments.workers or default_workers()),
            progress=not arguments.quiet,
        )


def rejudge_words(arguments: argparse.Namespace) -> list[str]:
    """The options of a command line that asks for the same."""
    if arguments.rejudge is None:
        return []
    return ["--rejudge", *([arguments.rejudge] if arguments.rejudge else [])]


def show_rejudged(found: Rejudging | None) -> None:
    """Prints what came of it."""
    if found is None:
        return
    from burg_drake.experiment.gap.report import rejudged_view

    rejudged_view(found).show()
    print(f"again   {found.path}")
