"""`burg-drake camera calibrate`: intrinsics from photos of a ChArUco board, or live."""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING, Any

from burg_drake.apps.camera.intrinsics_text import print_intrinsics
from burg_drake.apps.camera.target import add_board, given_target
from burg_drake.apps.options import Parser, add_verb, positive_int, two_numbers

if TYPE_CHECKING:
    from burg_drake.cameras.calibration import Calibration, CharucoTarget, CharucoView
    from burg_drake.cameras.sources import FrameSource

MODELS = ("auto", "pinhole", "radial4", "radial", "rational", "fisheye")
DEFAULT_VIEWS = 20


def add_to(group: Any) -> None:
    """Adds the verb to the group `camera`."""
    add_verb(
        group,
        "calibrate",
        run_calibrate,
        "find the intrinsics of a camera, from photos or live",
        "burg-drake camera calibrate photos/*.jpg -o K.yaml --report calibration.html",
        "burg-drake camera calibrate --camera 0 --size 1280x720 -o K.yaml",
        "burg-drake camera calibrate photos --squares 5x7 --square-mm 30 --marker-mm 22 -o K.yaml",
        "",
        "Exit code 1 if the photos do not determine the camera well; the file is then written"
        " only with --keep.",
        options=_add_options,
    )


def _add_options(calibrate: Parser) -> None:
    calibrate.add_argument(
        "images",
        metavar="IMAGE",
        nargs="*",
        help="photos of the calibration board, folders of them, or a video",
    )
    calibrate.add_argument(
        "--camera",
        metavar="CAMERA",
        help="take the views live: 0, /dev/video0, rtsp://...",
    )
    calibrate.add_argument(
        "--size", metavar="WxH", type=two_numbers, help="image size of the live camera"
    )
    calibrate.add_argument(
        "--views",
        metavar="N",
        type=positive_int,
        default=DEFAULT_VIEWS,
        help="number of live views (default: %(default)s); Ctrl-C ends earlier",
    )
    calibrate.add_argument("--save-views", metavar="FOLDER", help="save the live images here")
    calibrate.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="intrinsics file to write (.yaml)"
    )
    calibrate.add_argument(
        "--report", metavar="FILE", help="page with all residuals to write (.html)"
    )
    calibrate.add_argument(
        "--model",
        choices=MODELS,
        default="auto",
        help="lens model: pinhole (no distortion), radial4 (k1 k2 p1 p2), radial (also k3),"
        " rational (also k4 k5 k6), fisheye; auto chooses by the residuals (default:"
        " %(default)s)",
    )
    calibrate.add_argument("--name", default="", help="name of the camera, for the file")
    calibrate.add_argument(
        "--keep", action="store_true", help="write the file even if the result is uncertain"
    )
    add_board(calibrate)


def run_calibrate(arguments: argparse.Namespace) -> int:
    """Calibrates; 1 if the result is of little use."""
    from burg_drake.cameras.calibration import advice, calibrate_views, is_useless
    from burg_drake.cameras.sources import open_source
    from burg_drake.core import InvalidInputError
    from burg_drake.core.files import require_writable

    if bool(arguments.images) == bool(arguments.camera):
        raise InvalidInputError("give images of the target, or --camera; not both")
    for output in (arguments.output, arguments.report):
        if output:
            require_writable(output)
    target = given_target(arguments)
    with open_source(arguments.camera or arguments.images, size=arguments.size) as source:
        views, rejected = (
            _take(source, target, arguments) if arguments.camera else _look(source, target)
        )
    calibration = calibrate_views(views, target, model=arguments.model, rejected=rejected)
    _print(calibration)
    lines = advice(calibration)
    for line in lines:
        print(f"burg-drake: {line}", file=sys.stderr)
    useless = is_useless(calibration)
    if arguments.report:
        from burg_drake.visualization.pictures import write_report

        write_report(calibration, lines, arguments.report)
        print(f"report  {arguments.report}")
    if useless and not arguments.keep:
        print(
            "burg-drake: no file was written: the views do not determine the camera well enough;"
            " take more, or give --keep",
            file=sys.stderr,
        )
    else:
        _save(calibration, arguments)
    return 1 if useless else 0


def _save(calibration: Calibration, arguments: argparse.Namespace) -> None:
    import dataclasses

    from burg_drake.cameras.optics import save_intrinsics

    intrinsics = dataclasses.replace(calibration.intrinsics, camera=arguments.name)
    header = (
        f"burg-drake camera calibrate: {len(calibration.views)} views, lens model"
        f" {calibration.model}\nIn 19 of 20 cases the camera is {calibration.promise}."
    )
    save_intrinsics(intrinsics, arguments.output, header)
    print(f"wrote {arguments.output}")


def _look(
    source: FrameSource, target: CharucoTarget
) -> tuple[list[CharucoView], list[tuple[str, str]]]:
    """Looks for the target in photos."""
    from burg_drake.cameras.calibration import find_target
    from burg_drake.core import InvalidInputError
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter

    views, rejected = [], []
    with Reporter(True) as reporter:
        pace = ProgressMeter(reporter.show, Progress("looking for the target", unit="images"))
        while True:
            try:
                frame = source.read()
            except InvalidInputError as error:
                rejected.append(("", str(error)))
                continue
            if frame is None:
                break
            found = find_target(frame.image, target, frame.name)
            if isinstance(found, str):
                rejected.append((frame.name, found))
            else:
                views.append(found)
            pace.step(note=f"{len(views)} with the target")
    return views, rejected


def _take(
    source: FrameSource, target: CharucoTarget, arguments: argparse.Namespace
) -> tuple[list[CharucoView], list[tuple[str, str]]]:
    """Takes views from a camera until there are enough, it ends, or Ctrl-C."""
    from pathlib import Path

    from burg_drake.cameras.calibration import ViewCollector
    from burg_drake.cameras.sources import CameraLost, write_image
    from burg_drake.core.files import writable_folder

    folder = arguments.save_views and writable_folder(arguments.save_views)
    collector = ViewCollector(target)
    said, enough = "", False
    try:
        while len(collector.views) < arguments.views:
            try:
                frame = source.read()
            except CameraLost as error:
                word = str(error)
            else:
                if frame is None:
                    break
                taken, word = collector.offer(frame)
                if taken and folder:
                    number = len(collector.views)
                    write_image(Path(folder) / f"view_{number:03d}.png", frame.image)
            line = f"{len(collector.views)} of {arguments.views} views: {word}"
            if line != said:
                print(line, file=sys.stderr, flush=True)
            said = line
            if collector.enough and not enough:
                print("more views make it better; Ctrl-C ends", file=sys.stderr, flush=True)
            enough = collector.enough
    except KeyboardInterrupt:
        print(f"ended with {len(collector.views)} views", file=sys.stderr)
    return collector.views, []


def _print(calibration: Calibration) -> None:
    """Prints views, what was left out, parameters and where the image was covered."""
    from burg_drake.cameras.calibration import coverage
    from burg_drake.cameras.optics import PARTS
    from burg_drake.core.terminal import TextTable, format_number

    table = TextTable("views").names("image")
    table.numbers("corners", "rms [px]", "worst [px]", "tilt [deg]", "blur [px]")
    for used in calibration.views:
        worst = float(max((used.residuals**2).sum(axis=1)) ** 0.5)
        table.row(
            used.view.name,
            str(len(used.view.ids)),
            format_number(used.rms, 3),
            format_number(worst, 2),
            format_number(math.degrees(used.tilt), 0),
            format_number(used.view.blur, 2),
        )
    table.show()
    for name, reason in calibration.rejected:
        print(f"left out: {name} {reason}".replace(":  ", ": "))
    table = TextTable(f"lens model {calibration.model}").texts("parameter")
    table.numbers("value", "standard deviation")
    for name, (value, deviation) in calibration.parameters.items():
        table.row(name, f"{value:.6g}", f"{deviation:.2g}")
    table.caption = "f and c in pixels, others without a unit"
    table.show()
    size = (calibration.intrinsics.width, calibration.intrinsics.height)
    print("corners seen in each part of the image")
    for row in coverage([used.view for used in calibration.views], size):
        print("  " + " ".join(f"{count:4d}" for count in row))
    print()
    print_intrinsics(calibration.intrinsics)
    print(f"target           bulges by {1e3 * calibration.bulge:.2f} mm")
    print("known, in 19 of 20 cases, to so many pixels")
    parts = calibration.promise.parts
    for row in (PARTS[:3], PARTS[3:6], PARTS[6:]):
        words = (f"{name} {calibration.promise.bound(name)}" for name in row if name in parts)
        print("  " + ", ".join(words))
