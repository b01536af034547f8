"""Options that say how the hand goes to a grasp and away from it."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from burg_drake.apps.options.arguments import Parser
from burg_drake.apps.options.declared import add_options, given_fields
from burg_drake.core import FieldError, InvalidInputError, option_of

if TYPE_CHECKING:
    from burg_drake.station.document import GraspMotion, Station


def add_motion(parser: Parser) -> None:
    """Adds the options."""
    from burg_drake.station.document import GraspMotion

    group = parser.add_argument_group(
        "motion of the hand",
        "Default: what the station says, else 100 mm approach and 300 mm lift.",
    )
    add_options(group, GraspMotion, unset=True)


def given_motion(arguments: argparse.Namespace) -> dict[str, object]:
    """The fields of `GraspMotion` that options give."""
    from burg_drake.station.document import GraspMotion

    return given_fields(arguments, GraspMotion)


def chosen_motion(arguments: argparse.Namespace, station: Station) -> GraspMotion:
    """The motion that options ask for, where the station's is another.

    Raises:
        InvalidInputError: they do not go together; names the option.
    """
    given = given_motion(arguments)
    try:
        return replace(station.document.motion, **given)  # type: ignore[arg-type]
    except FieldError as error:
        options = ", ".join(motion_option(field) for field in given)
        raise InvalidInputError(f"{error} ({options})") from error


def motion_option(field: str) -> str:
    """The option of a field of `GraspMotion`."""
    from burg_drake.station.document import GraspMotion

    return option_of(GraspMotion, field)


def require_standoff_of_arm(arguments: argparse.Namespace, mode: str) -> None:
    """Refuses a standoff where no arm is asked.

    Raises:
        InvalidInputError: it is given, and the hand begins at the grasp.
    """
    approaches = mode != "hand" or getattr(arguments, "approach", False)
    if not approaches and arguments.standoff_mm is not None:
        raise InvalidInputError(
            "--standoff-mm is the length of the approach; in mode 'hand' the trial begins at the"
            " grasp: leave it out, or give --approach, or --mode reach or arm"
        )
