"""`burg-drake camera locate`: where a fixed camera stands, as lines for the station document."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from burg_drake.apps.options import (
    Parser,
    add_intrinsics,
    add_measured_board,
    add_scene,
    add_station,
    add_verb,
    print_scale,
)


def add_to(group: Any) -> None:
    """Adds the verb to the group `camera`."""
    add_verb(
        group,
        "locate",
        run_locate,
        "find the pose of a fixed camera from photos of the board",
        "burg-drake camera locate tabletop_six photo.png --intrinsics K.yaml --station my.yaml",
        "burg-drake camera locate tabletop_six photos/ --intrinsics K.yaml --name top",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    add_scene(parser)
    parser.add_argument(
        "photos",
        metavar="PHOTO",
        nargs="+",
        help="photos of the board from the same place, or a folder of them",
    )
    add_intrinsics(parser, required=True)
    add_measured_board(parser)
    add_station(parser)
    parser.add_argument(
        "--name", metavar="NAME", default="board", help="name of the camera (default: %(default)s)"
    )


def run_locate(arguments: argparse.Namespace) -> int:
    """Prints the camera's lines, and to stderr how far they can be trusted."""
    import numpy as np

    from burg_drake.cameras.optics import load_intrinsics
    from burg_drake.cameras.pose import BoardPose, locate_camera
    from burg_drake.cameras.sources import image_paths, read_image
    from burg_drake.core.documents import dump_document
    from burg_drake.scene.document import load_scene
    from burg_drake.station.document import load_station

    scene, station = load_scene(arguments.scene), load_station(arguments.station)
    intrinsics = load_intrinsics(arguments.intrinsics)
    scene.require_markers()
    pose = BoardPose(scene.board, intrinsics, print_scale(arguments))
    estimates = []
    for photo in image_paths(arguments.photos):
        image = read_image(photo)
        intrinsics.require_size(image.shape[1], image.shape[0], str(photo))
        estimate = pose.estimate(image)
        estimates.append(estimate)
        figures = f"{len(estimate.ids)} markers, {estimate.reprojection_error:.2f} pixels"
        notes = [figures] if estimate.valid else []
        print(f"{photo}: {', '.join([*notes, *filter(None, [estimate.reason])])}", file=sys.stderr)
    located = locate_camera(station, estimates, intrinsics)
    if sum(e.valid for e in estimates) > 1:
        distance, angle = located.apart
        print(
            f"single images are within {1e3 * distance:.2f} mm and {np.rad2deg(angle):.3f} degrees"
            " of the mean",
            file=sys.stderr,
        )
    if not intrinsics.is_pinhole:
        print("a station's camera has no lens distortion: undistort its images", file=sys.stderr)
    print(dump_document({"cameras": {arguments.name: located.camera}}), end="")
    return 0
