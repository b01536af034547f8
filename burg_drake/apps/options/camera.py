"""Options about the camera that a verb looks through: its optics, its pictures, their depth."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options.values import input_file, positive
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.cameras.optics import Intrinsics


def add_intrinsics(
    parser: Any, help: str = "intrinsics of the camera", *, required: bool = False
) -> None:
    """The option --intrinsics.

    Args:
        parser: gets it.
        help: what it means to the verb.
        required: the verb can do nothing without.
    """
    parser.add_argument(
        "--intrinsics", metavar="FILE", type=input_file, required=required, help=help
    )


def add_live_camera(parser: Any) -> None:
    """The options --intrinsics and --fps, of verbs that follow what a camera sees."""
    add_intrinsics(
        parser,
        "intrinsics of the camera, by burg-drake camera calibrate; simulated cameras need none",
    )
    parser.add_argument(
        "--fps", type=positive, metavar="N", help="images per second to request from the camera"
    )


def add_depth_unit(parser: Any) -> None:
    """The option --depth-unit, of verbs that take a depth image."""
    parser.add_argument(
        "--depth-unit",
        metavar="M",
        type=positive,
        help="unit of the depth image in metres (default: 0.001 for whole numbers, else 1)",
    )


def chosen_intrinsics(arguments: argparse.Namespace) -> Intrinsics:
    """Those that --intrinsics names, or that the simulated camera of --camera has.

    Raises:
        InvalidInputError: neither.
    """
    from burg_drake.cameras.optics import SIMULATED, load_intrinsics

    if arguments.intrinsics is not None:
        return load_intrinsics(arguments.intrinsics)
    if not arguments.camera.startswith(SIMULATED):
        raise InvalidInputError(
            f"camera {arguments.camera} needs --intrinsics FILE; burg-drake camera calibrate makes"
            " one"
        )
    return load_intrinsics(arguments.camera)
