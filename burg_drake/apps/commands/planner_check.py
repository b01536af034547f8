"""`burg-drake planner check`: whether the grasps of a planner have the right frames and units."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from burg_drake import benchmark, core
from burg_drake.apps import options

if TYPE_CHECKING:
    from burg_drake.benchmark import PlannerCheck


def add_planner_check_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake planner check`."""
    parser.epilog = options.examples_text(
        "burg-drake planner check antipodal",
        "burg-drake planner check my_module:plan",
        "burg-drake planner check ws://127.0.0.1:9000 --station panda_wsg",
        "",
        "The planner is asked for grasps of a carton and a can. A problem is printed with the line"
        " of Python that corrects it. The exit code is 1 if there are problems.",
    )
    parser.add_argument(
        "planner", metavar="PLANNER", help="name or reference (burg-drake planner list)"
    )
    options.add_station(parser)
    parser.add_argument(
        "--time-limit",
        type=options.positive,
        metavar="S",
        default=60.0,
        help="time for the answer [s] (default: 60)",
    )


def run_planner_check(arguments: argparse.Namespace) -> int:
    """Prints what the grasps of a planner show; returns 1 if there are problems."""
    with benchmark.open_planner(arguments.planner, time_limit=arguments.time_limit) as planner:
        found = benchmark.check_planner(planner.ask, arguments.station)
    _print_check(arguments.planner, found)
    return 1 if found.problems else 0


def _print_check(name: str, found: PlannerCheck) -> None:
    took = f" in {core.format_duration(found.time)}" if math.isfinite(found.time) else ""
    fitting, tried = found.fits
    print(f"{name}: {core.count_with_noun(found.count, 'grasp')} of a carton and a can{took}")
    if tried:
        print(
            f"  {fitting} of {tried} fit as returned: the open hand is clear of the object, and its"
            " pads close on it"
        )
    options.print_notes(found.notes)
    for problem in found.problems:
        print(f"problem: {problem}")
    if not found.problems and not found.notes:
        print("  no problem found")
