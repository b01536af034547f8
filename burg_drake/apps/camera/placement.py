"""`burg-drake camera placement`: how far each object stands from its place."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    Parser,
    add_depth_unit,
    add_intrinsics,
    add_measured_board,
    add_scene,
    add_verb,
    print_scale,
)
from burg_drake.core.terminal import TextTable, format_number

if TYPE_CHECKING:
    from burg_drake.cameras.optics import Intrinsics
    from burg_drake.cameras.placement import ExtraObject, Placement, PlacementCheck
    from burg_drake.cameras.pose import BoardEstimate
    from burg_drake.scene.document import Scene

FEW_MARKERS = 4
"""With fewer in sight, the camera's place is doubtful."""


def add_to(group: Any) -> None:
    """Adds the verb to the group `camera`."""
    add_verb(
        group,
        "placement",
        run_placement,
        "measure on a photo how far objects stand from their targets",
        "burg-drake camera placement tabletop_six photo.png --intrinsics K.yaml",
        "burg-drake camera placement scene.yaml photo.png --intrinsics K.yaml -o placement.yaml",
        "burg-drake camera placement scene.yaml left.png right.png --intrinsics K.yaml",
        "burg-drake camera placement scene.yaml photo.png --intrinsics K.yaml --depth depth.png",
        "",
        "Exit code 1 if an object is not seen, a measurement is doubtful, or something else"
        " stands there; 2 if a photo does not show the board.",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    add_scene(parser)
    parser.add_argument(
        "photo",
        metavar="PHOTO",
        nargs="+",
        help="photo of the scene on its board; several are measured together",
    )
    add_intrinsics(parser, required=True)
    add_measured_board(parser)
    parser.add_argument(
        "--depth",
        metavar="FILE",
        help="depth image of the same camera (16-bit .png, or .npy)",
    )
    add_depth_unit(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="placement file to write (.yaml)")
    parser.add_argument(
        "--overlay", metavar="FILE", help="picture to write: the photo with targets and errors"
    )


def run_placement(arguments: argparse.Namespace) -> int:
    """Measures, prints a line an object, and writes what is asked for."""
    from burg_drake.cameras.optics import load_intrinsics
    from burg_drake.cameras.placement import combine_checks, save_placement
    from burg_drake.cameras.sources import read_image, require_image_format
    from burg_drake.core import InvalidInputError
    from burg_drake.core.files import require_writable
    from burg_drake.scene.document import load_scene

    for path in filter(None, (arguments.output, arguments.overlay)):
        require_writable(path)
    if arguments.overlay:
        require_image_format(arguments.overlay)
    if arguments.depth and len(arguments.photo) > 1:
        raise InvalidInputError("--depth belongs to one photo; give one alone")
    scene, intrinsics = load_scene(arguments.scene), load_intrinsics(arguments.intrinsics)
    scene.require_markers()
    checks = [_checked(path, scene, intrinsics, arguments) for path in arguments.photo]
    check = combine_checks(checks) if len(checks) > 1 else checks[0]
    placement_table(check.instances).show()
    for extra in check.extra:
        print(extra_line(extra))
    if arguments.output:
        save_placement(check, arguments.output)
        print(f"wrote {arguments.output}")
    if arguments.overlay:
        _write_overlay(arguments.overlay, check, scene, read_image(arguments.photo[0]))
        print(f"wrote {arguments.overlay}")
    whole = all(p.status == "measured" for p in check.instances.values())
    return 0 if whole and not check.extra else 1


def _checked(
    path: str, scene: Scene, intrinsics: Intrinsics, arguments: argparse.Namespace
) -> PlacementCheck:
    """The check of one photo."""
    from burg_drake.cameras.placement import check_placement, image_of_file
    from burg_drake.cameras.pose import BoardPose
    from burg_drake.cameras.sources import read_depth, read_image
    from burg_drake.core import InvalidInputError

    photo = read_image(path)
    intrinsics.require_size(photo.shape[1], photo.shape[0], path)
    depth = None
    if arguments.depth:
        depth = read_depth(arguments.depth, arguments.depth_unit)
        intrinsics.require_size(depth.shape[1], depth.shape[0], arguments.depth)
    scale = print_scale(arguments)
    estimate = BoardPose(scene.board, intrinsics, scale).estimate(photo, depth=depth)
    check = check_placement(
        scene,
        photo,
        intrinsics,
        depth=depth,
        estimate=estimate,
        scale=scale,
        image_source=image_of_file(path),
        depth_source=image_of_file(arguments.depth) if arguments.depth else None,
    )
    if check.reason:
        raise InvalidInputError(f"{path}: {check.reason}")
    for warning in _doubts(estimate, len(scene.board.layout.ids)):
        print(f"burg-drake: warning: {path}: {warning}", file=sys.stderr)
    return check


def _doubts(estimate: BoardEstimate, markers: int) -> list[str]:
    """What to doubt about the camera's place, a line each."""
    doubts = [estimate.reason] if estimate.reason else []
    if len(estimate.ids) < FEW_MARKERS:
        doubts.append(f"only {len(estimate.ids)} of {markers} markers are seen; show more of them")
    return doubts


def placement_table(placements: Mapping[str, Placement]) -> TextTable:
    """How far each object is off, a row an object."""
    table = TextTable().names("object")
    table.numbers("off by\n[mm]", "x\n[mm]", "y\n[mm]", "±\n[mm]", "turned\n[deg]", "±\n[deg]")
    table.texts("remark")
    table.caption = "x, y: along the board's edges (scene frame S); ±: standard deviation"
    for name, placement in placements.items():
        table.row(name, *_cells(placement))
    return table


def extra_line(extra: ExtraObject) -> str:
    """What to do about something that is no object of the scene."""
    x, y = (1e3 * c for c in extra.position)
    return (
        f"something stands at x {x:.0f} mm, y {y:.0f} mm, {1e3 * extra.width:.0f} mm wide, that is"
        " no object of the scene"
    )


def _cells(placement: Placement) -> list[str]:
    """What a placement says, in millimetres and degrees."""
    if placement.displacement is None or placement.displacement_sd is None:
        return ["-"] * 6 + [f"not seen: {placement.reason}"]
    x, y = (1e3 * d for d in placement.displacement)
    distances = [format_number(value, 1) for value in (math.hypot(x, y), x, y)]
    turn = [None if a is None else math.degrees(a) for a in (placement.angle, placement.angle_sd)]
    deviation = format_number(1e3 * max(placement.displacement_sd), 1)
    remark = f"uncertain: {placement.reason}" if placement.reason else ""
    return [*distances, deviation, *(format_number(value, 1) for value in turn), remark]


def _write_overlay(path: str, check: PlacementCheck, scene: Any, photo: Any) -> None:
    """The photo with each object's target, and what is left to do."""
    from burg_drake.cameras.overlay import Overlay, OverlayStyle
    from burg_drake.cameras.sources import write_image

    assert check.camera is not None
    overlay = Overlay(scene, check.intrinsics, OverlayStyle(opacity=0.15))
    X_SC = check.camera.X_SC.matrix()
    write_image(path, overlay.draw(photo, X_SC, placement=check))
