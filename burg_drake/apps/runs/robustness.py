"""`burg-drake robustness`: how hard lifted grasps can be tugged, how much goes wrong with noise."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    Parser,
    add_only,
    add_options,
    add_quiet,
    add_retry_failed,
    add_verb,
    add_workers,
    how_to_retry,
    positive_int,
    seed,
    settings_from,
)
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.evaluation.robustness import RobustnessSettings


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "robustness",
        run_robustness,
        "test lifted grasps: tug, shake, friction, noise",
        "burg-drake robustness runs/first",
        "burg-drake robustness runs/first --best 5 --only mug --tests tug,noise --repeats 50",
        "burg-drake robustness runs/first --grasp mug-0123456789 --translation-mm 2",
        "",
        "The same command continues where an interrupted one stopped. The table keeps earlier"
        " results.",
        options=_add_options,
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")


def _add_options(parser: Parser) -> None:
    from burg_drake.evaluation.robustness import DEFAULT_BEST, TESTS, RobustnessSettings
    from burg_drake.simulation.robustness import Noise

    parser.add_argument("run_folder", metavar="RUN", help="folder of a run")
    which = parser.add_mutually_exclusive_group()
    which.add_argument(
        "--grasp",
        metavar="ID",
        nargs="+",
        action="extend",
        help="ids of lifted grasps, from the table of results",
    )
    which.add_argument(
        "--best",
        metavar="N",
        type=positive_int,
        default=DEFAULT_BEST,
        help="the N lifted grasps of each object with the most room around the hand (default:"
        " %(default)d)",
    )
    add_only(parser, "only grasps")
    parser.add_argument(
        "--tests",
        metavar="LIST",
        type=_tests,
        default=TESTS,
        help=f"some of {','.join(TESTS)} (default: all)",
    )
    noise = parser.add_argument_group("noise (standard deviations)")
    add_options(noise, RobustnessSettings, "repeats")
    add_options(noise, Noise)
    noise.add_argument("--seed", metavar="N", type=seed, help="random seed (default: the run's)")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FILE",
        help="table to write (default: robustness.csv in the run's folder)",
    )
    add_workers(parser)
    add_retry_failed(parser, "tests")
    add_quiet(parser)


def run_robustness(arguments: argparse.Namespace) -> int:
    """Tests; 1 if something could not be simulated."""
    from pathlib import Path

    from rich.console import Console

    from burg_drake.evaluation.records import require_table

    if arguments.output is not None:
        require_table(Path(arguments.output))
    from burg_drake.evaluation.robustness import assess_robustness, robustness_view
    from burg_drake.evaluation.store import load_run

    if arguments.only and arguments.grasp:
        raise InvalidInputError("--only is for the best grasps; leave out either it or --grasp")
    run = load_run(arguments.run_folder)
    settings = _settings(arguments, run.document.seed)
    found = assess_robustness(
        run,
        grasps=arguments.grasp,
        best=arguments.best,
        only=arguments.only,
        settings=settings,
        out=arguments.output,
        workers=arguments.workers,
        retry_failed=arguments.retry_failed,
        progress=not arguments.quiet,
    )
    Console().print(robustness_view(found.grasps, settings))
    print(f"table   {found.table_path}")
    if found.failures:
        id, reason = next(iter(found.failures.items()))
        print(
            f"burg-drake: {len(found.failures)} tests could not be simulated, such as {id}:"
            f" {reason}; {how_to_retry(found.interrupted, len(found.failures))}",
            file=sys.stderr,
        )
        return 1
    return 0


def _settings(arguments: argparse.Namespace, seed: int) -> RobustnessSettings:
    from burg_drake.evaluation.robustness import RobustnessSettings
    from burg_drake.simulation.robustness import Noise

    return settings_from(
        arguments,
        RobustnessSettings,
        tests=arguments.tests,
        noise=settings_from(arguments, Noise),
        seed=seed if arguments.seed is None else arguments.seed,
    )


def _tests(text: str) -> tuple[str, ...]:
    """Names of tests, each once, in the usual order."""
    from burg_drake.evaluation.robustness import TESTS

    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in TESTS:
            raise argparse.ArgumentTypeError(
                f"{name!r} is not a test; tests are {', '.join(TESTS)}"
            )
    return tuple(test for test in TESTS if test in names)
