"""`burg-drake robustness`: the pull that lifted grasps withstand, and their success under noise."""

from __future__ import annotations

import argparse

from burg_drake import evaluation
from burg_drake.apps import options
from burg_drake.apps.terminal import print_remark
from burg_drake.core import InvalidInputError


def add_robustness_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake robustness`."""
    from burg_drake.simulation import Noise

    parser.epilog = options.examples_text(
        "burg-drake robustness runs/first",
        "burg-drake robustness runs/first --best 5 --only mug --tests tug,noise --repeats 50",
        "burg-drake robustness runs/first --grasp mug-0123456789 --translation-mm 2",
        "",
        "The same command continues where an interrupted one stopped. The table keeps earlier"
        " results.",
    )
    parser.set_defaults(after_interrupt="; run the same command to continue")
    parser.add_argument("run_folder", metavar="RUN", help="folder of a run")
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument(
        "--grasp",
        metavar="ID",
        nargs="+",
        action="extend",
        help="ids of lifted grasps, from the table of results",
    )
    choice.add_argument(
        "--best",
        metavar="N",
        type=options.positive_int,
        default=evaluation.DEFAULT_BEST_COUNT,
        help="the N lifted grasps of each object with the most room around the hand (default:"
        " %(default)d)",
    )
    options.add_only(parser, "only grasps")
    parser.add_argument(
        "--tests",
        metavar="LIST",
        type=lambda text: tuple(options.known_names(text, evaluation.ROBUSTNESS_TESTS, "a test")),
        default=evaluation.ROBUSTNESS_TESTS,
        help=f"some of {','.join(evaluation.ROBUSTNESS_TESTS)} (default: all)",
    )
    noise = parser.add_argument_group("noise (standard deviations)")
    options.add_settings_options(noise, evaluation.RobustnessSettings, "repeats")
    options.add_settings_options(noise, Noise)
    noise.add_argument(
        "--seed", metavar="N", type=options.seed, help="random seed (default: the run's)"
    )
    options.add_output(
        parser,
        "FILE",
        "table to write (default: robustness.csv in the run's folder)",
        required=False,
    )
    options.add_workers(parser)
    options.add_retry_failed(parser, "tests")
    options.add_quiet(parser)


def run_robustness(arguments: argparse.Namespace) -> int:
    """Tests the robustness of grasps; returns 1 if something could not be simulated."""
    from pathlib import Path

    from rich.console import Console

    if arguments.output is not None:
        evaluation.require_table(Path(arguments.output))

    if arguments.only and arguments.grasp:
        raise InvalidInputError("--only is for the best grasps; leave out either it or --grasp")
    run = evaluation.load_run(arguments.run_folder)
    settings = _robustness_settings(arguments, run.document.seed)
    found = evaluation.assess_robustness(
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
    Console().print(evaluation.robustness_view(found.grasps, settings))
    print(f"table   {found.table_path}")
    if found.failures:
        id, reason = next(iter(found.failures.items()))
        print_remark(
            f"{len(found.failures)} tests could not be simulated, such as {id}:"
            f" {reason}; {options.retry_advice(found.interrupted, len(found.failures))}"
        )
        return 1
    return 0


def _robustness_settings(arguments: argparse.Namespace, seed: int) -> evaluation.RobustnessSettings:
    from burg_drake.simulation import Noise

    return options.settings_from(
        arguments,
        evaluation.RobustnessSettings,
        tests=arguments.tests,
        noise=options.settings_from(arguments, Noise),
        seed=seed if arguments.seed is None else arguments.seed,
    )
