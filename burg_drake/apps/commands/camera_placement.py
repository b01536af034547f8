"""`burg-drake camera locate` and `placement`: the pose of a camera; errors of object placement."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

from burg_drake import cameras, core
from burg_drake.apps import options
from burg_drake.apps.terminal import print_warning

if TYPE_CHECKING:
    from burg_drake.scene import Scene


def add_camera_locate_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake camera locate`."""
    parser.epilog = options.examples_text(
        "burg-drake camera locate tabletop_six photo.png --intrinsics K.yaml --station my.yaml",
        "burg-drake camera locate tabletop_six photos/ --intrinsics K.yaml --name top",
    )
    options.add_scene(parser)
    parser.add_argument(
        "photos",
        metavar="PHOTO",
        nargs="+",
        help="photos of the board from the same place, or a folder of them",
    )
    options.add_intrinsics(parser, required=True)
    options.add_measured_board(parser)
    options.add_station(parser)
    parser.add_argument(
        "--name", metavar="NAME", default="board", help="name of the camera (default: %(default)s)"
    )


def run_camera_locate(arguments: argparse.Namespace) -> int:
    """Prints the camera's pose as document lines, and warnings about its accuracy to stderr."""
    import numpy as np

    from burg_drake.scene import load_scene
    from burg_drake.station import load_station

    scene, station = load_scene(arguments.scene), load_station(arguments.station)
    intrinsics = cameras.load_intrinsics(arguments.intrinsics)
    scene.require_markers()
    pose = cameras.BoardPose(scene.board, intrinsics, options.print_scale_from_options(arguments))
    estimates = []
    for photo in cameras.image_paths(arguments.photos):
        image = cameras.read_image(photo)
        intrinsics.require_size(image.shape[1], image.shape[0], str(photo))
        estimate = pose.estimate(image)
        estimates.append(estimate)
        figures = f"{len(estimate.ids)} markers, {estimate.reprojection_error:.2f} pixels"
        notes = [figures] if estimate.valid else []
        print(f"{photo}: {', '.join([*notes, *filter(None, [estimate.reason])])}", file=sys.stderr)
    located = cameras.locate_camera(station, estimates, intrinsics)
    if sum(e.valid for e in estimates) > 1:
        distance, angle = located.apart
        print(
            f"single images are within {1e3 * distance:.2f} mm and {np.rad2deg(angle):.3f} degrees"
            " of the mean",
            file=sys.stderr,
        )
    if not intrinsics.is_pinhole:
        print("a station's camera has no lens distortion: undistort its images", file=sys.stderr)
    print(core.dump_document({"cameras": {arguments.name: located.camera}}), end="")
    return 0


def add_camera_placement_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake camera placement`."""
    parser.epilog = options.examples_text(
        "burg-drake camera placement tabletop_six photo.png --intrinsics K.yaml",
        "burg-drake camera placement scene.yaml photo.png --intrinsics K.yaml -o placement.yaml",
        "burg-drake camera placement scene.yaml left.png right.png --intrinsics K.yaml",
        "burg-drake camera placement scene.yaml photo.png --intrinsics K.yaml --depth depth.png",
        "",
        "Exit code 1 if an object is not seen, a measurement is doubtful, or something else"
        " stands there; 2 if a photo does not show the board.",
    )
    options.add_scene(parser)
    parser.add_argument(
        "photo",
        metavar="PHOTO",
        nargs="+",
        help="photo of the scene on its board; several are measured together",
    )
    options.add_intrinsics(parser, required=True)
    options.add_measured_board(parser)
    parser.add_argument(
        "--depth", metavar="FILE", help="depth image of the same camera (16-bit .png, or .npy)"
    )
    options.add_depth_unit(parser)
    options.add_output(parser, "FILE", "placement file to write (.yaml)", required=False)
    parser.add_argument(
        "--overlay", metavar="FILE", help="picture to write: the photo with targets and errors"
    )


def run_camera_placement(arguments: argparse.Namespace) -> int:
    """Measures placement errors, prints one line per object, and writes the outputs."""
    from burg_drake.scene import load_scene

    for path in filter(None, (arguments.output, arguments.overlay)):
        core.require_writable(path)
    if arguments.overlay:
        cameras.require_image_format(arguments.overlay)
    if arguments.depth and len(arguments.photo) > 1:
        raise core.InvalidInputError("--depth belongs to one photo; give one alone")
    scene, intrinsics = load_scene(arguments.scene), cameras.load_intrinsics(arguments.intrinsics)
    scene.require_markers()
    checks = [_check_photo(path, scene, intrinsics, arguments) for path in arguments.photo]
    check = cameras.combine_checks(checks) if len(checks) > 1 else checks[0]
    placement_table(check.instances).show()
    for extra in check.extra:
        print(extra_object_line(extra))
    if arguments.output:
        cameras.save_placement(check, arguments.output)
        print(f"wrote {arguments.output}")
    if arguments.overlay:
        assert check.camera is not None
        overlay = cameras.Overlay(scene, check.intrinsics, cameras.OverlayStyle(opacity=0.15))
        photo, X_SC = cameras.read_image(arguments.photo[0]), check.camera.X_SC.matrix()
        cameras.write_image(arguments.overlay, overlay.draw(photo, X_SC, placement=check))
        print(f"wrote {arguments.overlay}")
    whole = all(p.status == "measured" for p in check.instances.values())
    return 0 if whole and not check.extra else 1


def _check_photo(
    path: str, scene: Scene, intrinsics: cameras.Intrinsics, arguments: argparse.Namespace
) -> cameras.PlacementCheck:
    """The placement check of one photo."""
    photo = cameras.read_image(path)
    intrinsics.require_size(photo.shape[1], photo.shape[0], path)
    depth = None
    if arguments.depth:
        depth = cameras.read_depth(arguments.depth, arguments.depth_unit)
        intrinsics.require_size(depth.shape[1], depth.shape[0], arguments.depth)
    scale = options.print_scale_from_options(arguments)
    estimate = cameras.BoardPose(scene.board, intrinsics, scale).estimate(photo, depth=depth)
    check = cameras.check_placement(
        scene,
        photo,
        intrinsics,
        depth=depth,
        estimate=estimate,
        scale=scale,
        image_source=cameras.describe_image_file(path),
        depth_source=cameras.describe_image_file(arguments.depth) if arguments.depth else None,
    )
    if check.reason:
        raise core.InvalidInputError(f"{path}: {check.reason}")
    if estimate.reason:
        print_warning(f"{path}: {estimate.reason}")
    seen, markers = len(estimate.ids), len(scene.board.layout.ids)
    if seen < 4:  # the camera's pose may be wrong
        print_warning(f"{path}: only {seen} of {markers} markers are seen; show more of them")
    return check


def placement_table(placements: Mapping[str, cameras.Placement]) -> core.TextTable:
    """Table of placement errors, one row per object."""
    table = core.TextTable().names("object")
    table.numbers("off by\n[mm]", "x\n[mm]", "y\n[mm]", "±\n[mm]", "turned\n[deg]", "±\n[deg]")
    table.texts("remark")
    table.caption = "x, y: along the board's edges (scene frame S); ±: standard deviation"
    for name, placement in placements.items():
        table.row(name, *_placement_cells(placement))
    return table


def extra_object_line(extra: cameras.ExtraObject) -> str:
    """Advice on something on the board that is not an object of the scene."""
    x, y = (1e3 * c for c in extra.position)
    return (
        f"something stands at x {x:.0f} mm, y {y:.0f} mm, {1e3 * extra.width:.0f} mm wide, that is"
        " no object of the scene"
    )


def _placement_cells(placement: cameras.Placement) -> list[str]:
    """Table cells of a placement, in millimetres and degrees."""
    if placement.displacement is None or placement.displacement_sd is None:
        return ["-"] * 6 + [f"not seen: {placement.reason}"]
    x, y = (1e3 * d for d in placement.displacement)
    distances = [core.format_number(value, 1) for value in (math.hypot(x, y), x, y)]
    turn = [None if a is None else math.degrees(a) for a in (placement.angle, placement.angle_sd)]
    deviation = core.format_number(1e3 * max(placement.displacement_sd), 1)
    remark = f"uncertain: {placement.reason}" if placement.reason else ""
    return [*distances, deviation, *(core.format_number(value, 1) for value in turn), remark]
