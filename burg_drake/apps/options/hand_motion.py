"""Options that say how the hand goes to a grasp and away from it."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from burg_drake.apps.options.arguments import Parser, number
from burg_drake.core import FieldError, InvalidInputError, shown

if TYPE_CHECKING:
    from burg_drake.station.document import GraspMotion, Station

# Kept in step with station.grasp_motion, which imports too much for a help text; a test compares
# them.
LONGEST_MM = {"standoff": 1000.0, "retreat": 1000.0, "lift_height": 2000.0, "least_lift": 2000.0}
NAMES = {
    "standoff": "standoff_mm",
    "retreat": "retreat_mm",
    "lift_height": "lift_mm",
    "least_lift": "least_lift_mm",
    "lift_direction": "lift_direction",
}
"""Arguments by field of `GraspMotion`."""


def add_motion(parser: Parser) -> None:
    """Adds the options."""
    group = parser.add_argument_group(
        "motion of the hand",
        "What is left out is as the station's document says, or else as usual:\n"
        "100 mm straight in, and 300 mm straight up.",
    )
    for name, text in (
        ("standoff", "straight approach, from the pregrasp to the grasp"),
        ("retreat", "way back along the approach with the object, before the lift"),
        ("lift_height", "length of the lift"),
        (
            "least_lift",
            "lift as far as there is room, at most by --lift-mm and at least by this; the column"
            " lift_height tells how far",
        ),
    ):
        option = f"--{NAMES[name].replace('_', '-')}"
        group.add_argument(option, metavar="MM", type=_length(LONGEST_MM[name]), help=text)
    group.add_argument(
        "--lift-direction",
        metavar=("X", "Y", "Z"),
        nargs=3,
        type=number,
        help="of the lift in the world, of any length; 0 0 1 is up",
    )


def chosen_motion(arguments: argparse.Namespace, station: Station) -> GraspMotion:
    """The motion that options ask for, where the station's is another.

    Raises:
        InvalidInputError: they do not go together; names the option.
    """
    given: dict[str, object] = {}
    for field, name in NAMES.items():
        if (value := getattr(arguments, name)) is not None:
            given[field] = tuple(value) if field == "lift_direction" else value / 1000.0
    try:
        return replace(station.document.motion, **given)  # type: ignore[arg-type]
    except FieldError as error:
        options = ", ".join(f"--{NAMES[field].replace('_', '-')}" for field in given)
        raise InvalidInputError(f"{options}: {error}") from error


def require_standoff_of_arm(arguments: argparse.Namespace, mode: str) -> None:
    """Refuses a standoff where no arm is asked.

    Raises:
        InvalidInputError: it is given, and the hand begins at the grasp.
    """
    if mode == "hand" and arguments.standoff_mm is not None:
        raise InvalidInputError(
            "--standoff-mm is about the arm's way to the grasp; in mode 'hand' the hand begins at"
            " the grasp: leave it out, or give --mode reach or arm"
        )


def _length(most: float) -> Callable[[str], float]:
    """What takes a length from 0 to the longest [mm]."""

    def length(text: str) -> float:
        value = number(text)
        if not 0.0 <= value <= most:
            raise argparse.ArgumentTypeError(f"{shown(text)} is not a length from 0 to {most:g} mm")
        return value

    return length
