"""`burg-drake robustness`: the pull that lifted grasps withstand, and their success under noise."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from burg_drake.apps.options.arguments import (
    Parser,
    add_only,
    add_output,
    add_quiet,
    add_retry_failed,
    add_workers,
    examples_text,
    retry_advice,
)
from burg_drake.apps.options.settings_options import add_settings_options, settings_from
from burg_drake.apps.options.values import positive_int, seed
from burg_drake.apps.terminal import print_remark
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.evaluation import RobustnessSettings


def add_robustness_options(parser: Parser) -> None:
    """Adds the options of `burg-drake robustness`."""
    from burg_drake.evaluation import DEFAULT_BEST_COUNT, ROBUSTNESS_TESTS, RobustnessSettings
    from burg_drake.simulation import Noise

    parser.epilog = examples_text(
        "burg-drake robustness runs/first",
        "burg-drake robustness runs/first --best 5 --only mug --tests tug,noise --repeats 50",
        "burg-drake robustness runs/first --grasp mug-0123456789 --translation-mm 2",
        "",
        "The same command continues where an interrupted one stopped. The table keeps earlier"
        " results.",
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")
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
        default=DEFAULT_BEST_COUNT,
        help="the N lifted grasps of each object with the most room around the hand (default:"
        " %(default)d)",
    )
    add_only(parser, "only grasps")
    parser.add_argument(
        "--tests",
        metavar="LIST",
        type=_parse_tests,
        default=ROBUSTNESS_TESTS,
        help=f"some of {','.join(ROBUSTNESS_TESTS)} (default: all)",
    )
    noise = parser.add_argument_group("noise (standard deviations)")
    add_settings_options(noise, RobustnessSettings, "repeats")
    add_settings_options(noise, Noise)
    noise.add_argument("--seed", metavar="N", type=seed, help="random seed (default: the run's)")
    add_output(
        parser,
        "FILE",
        "table to write (default: robustness.csv in the run's folder)",
        required=False,
    )
    add_workers(parser)
    add_retry_failed(parser, "tests")
    add_quiet(parser)


def run_robustness(arguments: argparse.Namespace) -> int:
    """Tests; 1 if something could not be simulated."""
    from pathlib import Path

    from rich.console import Console

    from burg_drake.evaluation import require_table

    if arguments.output is not None:
        require_table(Path(arguments.output))
    from burg_drake.evaluation import assess_robustness, load_run, robustness_view

    if arguments.only and arguments.grasp:
        raise InvalidInputError("--only is for the best grasps; leave out either it or --grasp")
    run = load_run(arguments.run_folder)
    settings = _robustness_settings(arguments, run.document.seed)
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
        print_remark(
            f"{len(found.failures)} tests could not be simulated, such as {id}:"
            f" {reason}; {retry_advice(found.interrupted, len(found.failures))}"
        )
        return 1
    return 0


def _robustness_settings(arguments: argparse.Namespace, seed: int) -> RobustnessSettings:
    from burg_drake.evaluation import RobustnessSettings
    from burg_drake.simulation import Noise

    return settings_from(
        arguments,
        RobustnessSettings,
        tests=arguments.tests,
        noise=settings_from(arguments, Noise),
        seed=seed if arguments.seed is None else arguments.seed,
    )


def _parse_tests(text: str) -> tuple[str, ...]:
    """Names of tests, each once, in the usual order."""
    from burg_drake.evaluation import ROBUSTNESS_TESTS

    names = [name.strip() for name in text.split(",")]
    for name in names:
        if name not in ROBUSTNESS_TESTS:
            raise argparse.ArgumentTypeError(
                f"{name!r} is not a test; tests are {', '.join(ROBUSTNESS_TESTS)}"
            )
    return tuple(test for test in ROBUSTNESS_TESTS if test in names)
