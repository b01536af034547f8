"""Options about grasp files that several verbs have, and the gripper that they tell."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options.arguments import DEFAULT_STATION, Parser, add_station
from burg_drake.apps.options.values import input_file

if TYPE_CHECKING:
    from burg_drake.formats.common import Gripper
    from burg_drake.station.document import Station

DEFAULT_HAND = "panda_hand"
OTHER_CORRECTIONS = (
    " (degrees about x, y or z), forward:103.4 (mm along the approach), inverse, transposed, wxyz,"
    " xyzw, y_up, z_up, millimetres, half_widths"
)
"""After the first one, in a help text."""

FRAMES = {"object": "object", "scene": "world", "camera": "camera"}
"""What `formats` calls the choices of options about frames."""


def add_file_options(parser: Parser, *, in_full: bool = False) -> None:
    """The options --from, --gripper-link and --correction, by which a file is read."""
    parser.add_argument(
        "--from", dest="source", metavar="FORMAT", help="format to read (default: recognised)"
    )
    add_reading(parser, in_full=in_full)


def add_reading(parser: Any, *, in_full: bool = False) -> None:
    """The options --gripper-link and --correction."""
    parser.add_argument(
        "--gripper-link",
        metavar="NAME",
        help="hand's link in isaac_grasp files (default: its own)",
    )
    parser.add_argument(
        "--correction",
        metavar="NAME,...",
        type=lambda text: tuple(text.split(",")),
        default=(),
        help="correct poses, such as turn:z90"
        + (OTHER_CORRECTIONS if in_full else " (see burg-drake grasps convert --help)"),
    )


def add_hand(parser: Parser, default: str | None = DEFAULT_HAND) -> None:
    """The option --hand, of verbs that have no station; without a default the file is asked."""
    parser.add_argument(
        "--hand",
        metavar="HAND",
        default=default,
        help="hand file or built-in name (default:"
        f" {default or f'that of the file, else {DEFAULT_HAND}'})",
    )


def add_camera_options(group: Any) -> None:
    """The options --camera-pose, --object-ids and --scene-id, of files about a scene."""
    group.add_argument(
        "--camera-pose",
        metavar="FILE",
        type=input_file,
        nargs="+",
        default=[],
        help="pose of the camera in the scene: 4x4 .npy, FILE:INDEX, or YAML; several are"
        " multiplied",
    )
    group.add_argument(
        "--object-ids",
        metavar="ID=NAME,...",
        type=numbering,
        default={},
        help="instances by object id (default: the object between the fingers)",
    )
    group.add_argument("--scene-id", metavar="ID", help="scene to read from a file of several")


def numbering(text: str) -> dict[int, str]:
    """`ID=NAME,ID=NAME`."""
    names: dict[int, str] = {}
    for part in text.split(","):
        number, _, name = part.partition("=")
        if not number.strip().isdecimal() or not name.strip():
            raise argparse.ArgumentTypeError(f"{part!r} is not ID=NAME, such as 5=mug")
        names[int(number)] = name.strip()
    return names


def gripper_for(
    arguments: argparse.Namespace, station: Station | None = None, path: str | None = None
) -> Gripper:
    """The hand of a station, or else the one that --hand or a file names, with the link of
    --gripper-link."""
    if station is None:
        gripper = named_gripper(arguments.hand) if arguments.hand else _gripper_of_file(path)
    else:
        from burg_drake.station.world import station_gripper

        gripper = station_gripper(station)
    return replace(gripper, body=arguments.gripper_link) if arguments.gripper_link else gripper


def add_file_station(parser: Parser) -> None:
    """The option --station, of verbs whose files may name one."""
    add_station(
        parser,
        f"station file or built-in name (default: that of the file, else {DEFAULT_STATION})",
        default=None,
    )


def station_for(arguments: argparse.Namespace, path: str) -> Station:
    """The station that --station names, or else a file or a run, or else the default.

    Raises:
        UnknownNameError: it is not there.
    """
    from burg_drake.core import UnknownNameError
    from burg_drake.core.paths import is_resolved
    from burg_drake.evaluation.grasp_sets import station_reference
    from burg_drake.station.document import load_station

    if arguments.station is not None:
        return load_station(arguments.station)
    reference = station_reference(path)
    if reference is not None and not is_resolved(reference, "stations"):
        raise UnknownNameError(
            f"{path} names a station that is not there: {reference}; give --station"
        )
    try:
        return load_station(reference or DEFAULT_STATION)
    except UnknownNameError as error:
        raise UnknownNameError(f"{path} names a station: {error}; give --station") from error


def named_gripper(hand: str) -> Gripper:
    """What formats know of a hand; of the Panda's without a look into its model."""
    from burg_drake.formats.common import PANDA

    if hand == DEFAULT_HAND:
        return PANDA
    from burg_drake.station.document import locate_hand
    from burg_drake.station.world import gripper_of

    return gripper_of(*locate_hand(hand))


def _gripper_of_file(path: str | None) -> Gripper:
    """The hand that a file or a run says its grasps are for, else the default."""
    from burg_drake.core import BurgError, UnknownNameError
    from burg_drake.evaluation.grasp_sets import hand_reference

    reference = None if path is None else hand_reference(path)
    if reference is None:
        return named_gripper(DEFAULT_HAND)
    try:
        return named_gripper(reference)
    except BurgError as error:
        raise UnknownNameError(
            f"the hand that {path} names cannot be used; give another (--hand): {error}"
        ) from error
