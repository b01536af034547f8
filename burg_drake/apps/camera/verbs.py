"""`burg-drake camera`: which cameras there are, and files of intrinsics.

`target` and `calibrate` make these; `placement` and `locate` look at photos of the board.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

from burg_drake.apps.camera import calibrate, locate, placement, target
from burg_drake.apps.camera.intrinsics_text import print_intrinsics
from burg_drake.apps.options import add_group, add_verb, input_file


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "camera", "find, calibrate and locate cameras; measure photos")
    add_verb(
        group,
        "list",
        run_list,
        "list the cameras of this machine that give images",
        "burg-drake camera list",
    )
    target.add_to(group)
    calibrate.add_to(group)
    _add_show(group)
    _add_convert(group)
    locate.add_to(group)
    placement.add_to(group)


def _add_show(group: Any) -> None:
    show = add_verb(
        group,
        "show",
        run_show,
        "print intrinsics, field of view and distortion",
        "burg-drake camera show K.yaml",
        "burg-drake camera show sim:panda_tabletop/board",
    )
    _add_intrinsics(show)


def _add_convert(group: Any) -> None:
    convert = add_verb(
        group,
        "convert",
        run_convert,
        "convert intrinsics to or from ROS and OpenCV",
        "burg-drake camera convert K.yaml --to ros -o camera_info.yaml",
        "burg-drake camera convert camera_info.yaml -o K.yaml",
        "burg-drake camera convert opencv_calibration.yml -o K.yaml",
    )
    _add_intrinsics(convert)
    convert.add_argument(
        "--to",
        choices=("burg", "ros"),
        default="burg",
        help="format to write (default: %(default)s)",
    )
    convert.add_argument("-o", "--output", metavar="FILE", required=True, help="file to write")


def _add_intrinsics(parser: Any) -> None:
    parser.add_argument(
        "intrinsics",
        metavar="INTRINSICS",
        type=input_file,
        help="intrinsics file (ours, ROS's camera_info, OpenCV's), or sim:STATION/CAMERA",
    )


def run_list(arguments: argparse.Namespace) -> int:
    """Prints the cameras that open; 1 if there are none."""
    from burg_drake.cameras.sources import open_devices

    found = 0
    for name, (width, height) in open_devices():
        print(f"camera {name}: {width} x {height} pixels")
        found += 1
    if not found:
        print(
            "burg-drake: no camera gives images; is one plugged in and not in use, and do you have"
            " permission to read it?",
            file=sys.stderr,
        )
    return 0 if found else 1


def run_show(arguments: argparse.Namespace) -> int:
    """Prints intrinsics."""
    from burg_drake.cameras.optics import load_intrinsics

    print_intrinsics(load_intrinsics(arguments.intrinsics))
    return 0


def run_convert(arguments: argparse.Namespace) -> int:
    """Writes intrinsics in another format."""
    from burg_drake.cameras.optics import (
        load_intrinsics,
        save_camera_info,
        save_intrinsics,
    )

    intrinsics = load_intrinsics(arguments.intrinsics)
    save = save_camera_info if arguments.to == "ros" else save_intrinsics
    save(intrinsics, arguments.output)
    print(f"wrote {arguments.output}")
    return 0
