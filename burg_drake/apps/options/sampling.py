"""Options of all verbs that sample grasps: the same ones mean the same grasps everywhere."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options.arguments import (
    DEFAULT_APPROACH_ANGLE,
    Parser,
    add_only,
    approach_angle,
    positive_int,
    seed,
)
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet


def add_sampling(parser: Parser, default: int, which: Any = None) -> None:
    """Adds the options.

    Args:
        parser: gets them.
        default: number of grasps for each object.
        which: group in which the number of grasps is an alternative, such as to grasps of a file.
    """
    (which or parser).add_argument(
        "-n",
        "--grasps-per-object",
        metavar="N",
        type=positive_int,
        help="number of grasps to sample on each object; only those at which the open hand collides"
        " with nothing, and its pads meet the object within the friction cones"
        f" (default: {default})",
    )
    parser.set_defaults(default_grasps=default)
    parser.add_argument(
        "--blind",
        action="store_true",
        help="sample without regard to the hand, by points of contact alone, as in the literature",
    )
    add_only(parser, "grasps")
    parser.add_argument(
        "--approach-angle",
        metavar="DEG",
        type=approach_angle,
        help="in a scene, sample grasps within this angle of straight down"
        f" (default: {DEFAULT_APPROACH_ANGLE:g}; 180: any)",
    )
    parser.add_argument(
        "--seed", metavar="N", type=seed, default=0, help="of the sampling (default: %(default)s)"
    )


def grasps_per_object(arguments: argparse.Namespace) -> int:
    """How many grasps are asked for."""
    return int(arguments.grasps_per_object or arguments.default_grasps)


def require_sampled(arguments: argparse.Namespace) -> None:
    """Refuses an option about sampling where grasps come from a file.

    Raises:
        InvalidInputError: names the option.
    """
    for name in ("blind", "approach_angle"):
        if getattr(arguments, name) and arguments.grasps is not None:
            raise InvalidInputError(
                f"--{name.replace('_', '-')} is about sampled grasps; leave it or --grasps away"
            )


def print_shortfalls(sampled: Mapping[str, GraspSet], asked: int) -> None:
    """A line for each object with fewer grasps than asked, that says why."""
    from burg_drake.evaluation.candidates import shortfall

    for name, grasps in sampled.items():
        note = shortfall(name, asked, grasps.provenance, len(grasps))
        if note:
            print(f"note: {note}")
