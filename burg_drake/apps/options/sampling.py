"""Options of all verbs that sample grasps: the same ones mean the same grasps everywhere."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options.arguments import Parser, add_only
from burg_drake.apps.options.declared import add_options
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
    from burg_drake.evaluation.records import EvaluationSettings

    add_options(
        which or parser, EvaluationSettings, "grasps_per_object", unset=True, shown_default=default
    )
    parser.set_defaults(default_grasps=default)
    add_options(parser, EvaluationSettings, "blind")
    add_only(parser, "grasps")
    add_options(parser, EvaluationSettings, "approach_angle_deg", unset=True)
    add_options(parser, EvaluationSettings, "seed")


def grasps_per_object(arguments: argparse.Namespace) -> int:
    """How many grasps are asked for."""
    return int(arguments.grasps_per_object or arguments.default_grasps)


def require_sampled(arguments: argparse.Namespace) -> None:
    """Refuses an option about sampling where grasps come from a file.

    Raises:
        InvalidInputError: names the option.
    """
    for name in ("blind", "approach_angle", "until_balanced"):
        if getattr(arguments, name, None) and arguments.grasps is not None:
            raise InvalidInputError(
                f"--{name.replace('_', '-')} is for sampled grasps; leave out either it or --grasps"
            )


def print_shortfalls(sampled: Mapping[str, GraspSet], asked: int) -> None:
    """A line for each object with fewer grasps than asked, that says why."""
    from burg_drake.evaluation.candidates import shortfall

    for name, grasps in sampled.items():
        note = shortfall(name, asked, grasps.provenance, len(grasps))
        if note:
            print(f"note: {note}")
