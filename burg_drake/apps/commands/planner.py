"""`burg-drake planner`: lists planners, checks their frames, and serves one."""

from __future__ import annotations

import argparse
import contextlib
import math
from typing import TYPE_CHECKING

from burg_drake import benchmark, core
from burg_drake.apps import options
from burg_drake.apps.terminal import sigterm_as_interrupt

if TYPE_CHECKING:
    from burg_drake.benchmark import GraspPlanner, PlannerCheck


def add_planner_list_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake planner list`."""
    parser.epilog = options.examples_text("burg-drake planner list")


def run_planner_list(arguments: argparse.Namespace) -> int:
    """Prints the built-in planners, and how to refer to others."""
    table = core.TextTable().texts("planner", "uses", "grasps")
    for name, planner in benchmark.BUILTIN_PLANNERS.items():
        table.row(name, planner.uses, planner.summary)
    table.show()
    print()
    others = core.TextTable().texts("your own, for example", "is a")
    for example, meaning in benchmark.REFERENCE_FORMS.items():
        others.row(example, meaning)
    others.show()
    return 0


def add_planner_check_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake planner check`."""
    parser.epilog = options.examples_text(
        "burg-drake planner check antipodal",
        "burg-drake planner check my_module:plan",
        "burg-drake planner check ws://127.0.0.1:9000 --station panda_wsg",
        "",
        "The planner is asked for grasps of a carton and a can, in up to three images. A problem is"
        " printed with the line of Python that corrects it. The exit code is 1 if there are"
        " problems, or if the grasps do not tell whether the frames are right. What the planner"
        " prints is shown on standard error.",
    )
    _add_planner(parser)
    options.add_station(parser)


def run_planner_check(arguments: argparse.Namespace) -> int:
    """Prints what the grasps of a planner show; returns 1 if there are problems."""
    with _open_planner(arguments) as planner:
        found = benchmark.check_planner(planner.ask, arguments.station)
    _print_check(arguments.planner, found)
    return 1 if found.problems or found.unclear else 0


def _add_planner(parser: options.Parser) -> None:
    parser.add_argument(
        "planner", metavar="PLANNER", help="name or reference (burg-drake planner list)"
    )
    parser.add_argument(
        "--time-limit",
        type=options.positive,
        metavar="S",
        default=60.0,
        help="time for each answer [s] (default: 60)",
    )


def _open_planner(arguments: argparse.Namespace) -> GraspPlanner:
    return benchmark.open_planner(
        arguments.planner,
        time_limit=arguments.time_limit,
        limit_source="the limit of --time-limit",
        show_output=True,
    )


def _print_check(name: str, found: PlannerCheck) -> None:
    took = f", {core.format_duration(found.time)} in all" if math.isfinite(found.time) else ""
    fitting, tried = found.fits
    grasps = f"{core.count_with_noun(found.count, 'grasp')} in " if found.count else ""
    images = core.count_with_noun(found.images, "image")
    print(f"{name}: {grasps}{images} of a carton and a can{took}")
    if tried and not found.problems:
        print(
            f"  {fitting} of {tried} fit as returned: the open hand is clear of the object, and its"
            " pads close on it"
        )
    options.print_notes([*found.notes, *found.unclear])
    for problem in found.problems:
        print(f"problem: {problem}")
    if not found.problems and not found.unclear:
        print("  no problem found")


def add_planner_serve_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake planner serve`."""
    parser.epilog = options.examples_text(
        "burg-drake planner serve antipodal",
        "burg-drake planner serve my_module:plan --port 9001",
        "burg-drake planner serve my_module:plan --host 0.0.0.0",
        "",
        "Other programs ask it as ws://127.0.0.1:9000. A planner that lives in another environment"
        " needs no burg_drake to be served: copy burg_planner.py there. What the planner prints is"
        " shown on standard error.",
    )
    _add_planner(parser)
    parser.add_argument(
        "--port",
        type=options.port,
        metavar="N",
        default=9000,
        help="port to listen on (default: %(default)s)",
    )
    parser.add_argument(
        "--host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="address to listen on (default: 127.0.0.1, this computer alone); with 0.0.0.0 every"
        " computer in the network can ask the planner",
    )


def run_planner_serve(arguments: argparse.Namespace) -> int:
    """Serves a planner until Ctrl-C."""
    benchmark.require_websocket_packages()
    with (
        sigterm_as_interrupt(),
        _open_planner(arguments) as planner,
        contextlib.suppress(KeyboardInterrupt),
    ):
        benchmark.serve_planner(planner, arguments.port, arguments.host)
    return 0
