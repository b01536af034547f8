"""`burg-drake camera list`, `show`, `convert` and `calibrate`: cameras and their intrinsics."""

from __future__ import annotations

import argparse
import math
import sys
from typing import Any

from burg_drake import cameras, core
from burg_drake.apps import options
from burg_drake.apps.commands.printout import add_target_board_options, target_from_options
from burg_drake.apps.terminal import print_remark, show_progress


def print_intrinsics(intrinsics: cameras.Intrinsics) -> None:
    """Prints the parameters of a camera."""
    import numpy as np

    k = intrinsics
    title = f"{k.camera}: " if k.camera else ""
    print(f"{title}{k.width} x {k.height} pixels")
    print(f"focal length     fx {k.focal[0]:.2f}, fy {k.focal[1]:.2f} pixels")
    print(
        f"principal point  cx {k.center[0]:.2f}, cy {k.center[1]:.2f} (pixel centres at integers)"
    )
    across, down, diagonal = (math.degrees(angle) for angle in field_of_view(k))
    print(f"field of view    {across:.1f} x {down:.1f} degrees, diagonal {diagonal:.1f}")
    if k.is_fisheye:
        print("lens model       fisheye")
    if k.is_pinhole:
        print("distortion       none")
    else:
        print("distortion       " + ", ".join(f"{value:.5g}" for value in k.distortion))
        corners = np.array([(u, v) for v in (0, k.height - 1) for u in (0, k.width - 1)], float)
        if k.is_fisheye:
            figures = np.degrees(np.arccos(k.rays(corners)[:, 2]))
            words = "corners look", "degrees off the axis"
        else:
            figures = np.linalg.norm(corners - k.undistort(corners), axis=1)
            words = "moves corners by", "pixels"
        names = ("upper left", "upper right", "lower left", "lower right")
        of_corners = (f"{name} {figure:.1f}" for name, figure in zip(names, figures, strict=True))
        print(f"{words[0]:17}{', '.join(of_corners)} {words[1]}")
    if k.residual is not None:
        print(f"residual         {k.residual:.3f} pixels")
    if k.known_to is not None:
        print(f"known            {cameras.describe_accuracy(k.known_to, k.except_at)}")


def field_of_view(intrinsics: cameras.Intrinsics) -> tuple[float, float, float]:
    """Angles between opposite edges, horizontally and vertically, and between corners [rad]."""
    import numpy as np

    k = intrinsics
    w, h = k.width - 0.5, k.height - 0.5
    cx, cy = k.center
    ends = [((-0.5, cy), (w, cy)), ((cx, -0.5), (cx, h)), ((-0.5, -0.5), (w, h))]
    rays = k.rays(np.array(ends, dtype=float))
    between = np.arccos(np.clip((rays[:, 0] * rays[:, 1]).sum(axis=-1), -1.0, 1.0))
    # The angle of a fisheye camera may exceed 180 degrees.
    beyond = np.arccos(rays[..., 2]).sum(axis=1) > np.pi
    angles = np.where(beyond, 2.0 * np.pi - between, between).tolist()
    return angles[0], angles[1], angles[2]


def add_camera_calibrate_options(calibrate: options.Parser) -> None:
    """Adds the options of `burg-drake camera calibrate`."""
    calibrate.epilog = options.examples_text(
        "burg-drake camera calibrate photos/*.jpg -o K.yaml --report calibration.html",
        "burg-drake camera calibrate --camera 0 --size 1280x720 -o K.yaml",
        "burg-drake camera calibrate photos --squares 5x7 --square-mm 30 --marker-mm 22 -o K.yaml",
        "",
        "Exit code 1 if the photos do not determine the camera well; the file is then written"
        " only with --keep.",
    )
    calibrate.add_argument(
        "images",
        metavar="IMAGE",
        nargs="*",
        help="photos of the calibration board, folders of them, or a video",
    )
    calibrate.add_argument(
        "--camera", metavar="CAMERA", help="take the views live: 0, /dev/video0, rtsp://..."
    )
    calibrate.add_argument(
        "--size", metavar="WxH", type=options.two_numbers, help="image size of the live camera"
    )
    calibrate.add_argument(
        "--views",
        metavar="N",
        type=options.positive_int,
        default=20,
        help="number of live views (default: %(default)s); Ctrl-C ends earlier",
    )
    calibrate.add_argument("--save-views", metavar="FOLDER", help="save the live images here")
    options.add_output(calibrate, "FILE", "intrinsics file to write (.yaml)")
    calibrate.add_argument(
        "--report", metavar="FILE", help="page with all residuals to write (.html)"
    )
    calibrate.add_argument(
        "--model",
        choices=("auto", "pinhole", "radial4", "radial", "rational", "fisheye"),
        default="auto",
        help="lens model: pinhole (no distortion), radial4 (k1 k2 p1 p2), radial (also k3),"
        " rational (also k4 k5 k6), fisheye; auto chooses by the residuals (default:"
        " %(default)s)",
    )
    calibrate.add_argument("--name", default="", help="name of the camera, for the file")
    calibrate.add_argument(
        "--keep", action="store_true", help="write the file even if the result is uncertain"
    )
    add_target_board_options(calibrate)


def run_camera_calibrate(arguments: argparse.Namespace) -> int:
    """Calibrates a camera; returns 1 if the result is of little use."""
    if bool(arguments.images) == bool(arguments.camera):
        raise core.InvalidInputError("give images of the target, or --camera; not both")
    for output in (arguments.output, arguments.report):
        if output:
            core.require_writable(output)
    target = target_from_options(arguments)
    with cameras.open_source(arguments.camera or arguments.images, size=arguments.size) as source:
        views, rejected = (
            _views_from_camera(source, target, arguments)
            if arguments.camera
            else _views_from_photos(source, target)
        )
    calibration = cameras.calibrate_views(views, target, model=arguments.model, rejected=rejected)
    _print_calibration(calibration)
    lines = cameras.calibration_advice(calibration)
    for line in lines:
        print_remark(line)
    is_useless = cameras.is_useless(calibration)
    if arguments.report:
        from burg_drake.visualization import write_calibration_report

        write_calibration_report(calibration, lines, arguments.report)
        print(f"report  {arguments.report}")
    if is_useless and not arguments.keep:
        print_remark(
            "no file was written: the views do not determine the camera well enough;"
            " take more, or give --keep"
        )
    else:
        _save_calibration(calibration, arguments)
    return 1 if is_useless else 0


def _save_calibration(calibration: cameras.Calibration, arguments: argparse.Namespace) -> None:
    import dataclasses

    intrinsics = dataclasses.replace(calibration.intrinsics, camera=arguments.name)
    header = (
        f"burg-drake camera calibrate: {len(calibration.views)} views, lens model"
        f" {calibration.model}\nIn 19 of 20 cases the camera is {calibration.accuracy}."
    )
    cameras.save_intrinsics(intrinsics, arguments.output, header)
    print(f"wrote {arguments.output}")


def _views_from_photos(
    source: cameras.FrameSource, target: cameras.CharucoTarget
) -> tuple[list[cameras.CharucoView], list[tuple[str, str]]]:
    """Finds the target in photos; also returns the reasons for rejected ones."""
    views, rejected = [], []
    with show_progress("looking for the target", "images") as pace:
        while True:
            try:
                frame = source.read()
            except core.InvalidInputError as error:
                rejected.append(("", str(error)))
                continue
            if frame is None:
                break
            found = cameras.find_target(frame.image, target, frame.name)
            if isinstance(found, str):
                rejected.append((frame.name, found))
            else:
                views.append(found)
            pace.step(note=f"{len(views)} with the target")
    return views, rejected


def _views_from_camera(
    source: cameras.FrameSource, target: cameras.CharucoTarget, arguments: argparse.Namespace
) -> tuple[list[cameras.CharucoView], list[tuple[str, str]]]:
    """Collects views from a camera until there are enough, its end, or Ctrl-C."""
    from pathlib import Path

    folder = arguments.save_views and core.ensure_writable_folder(arguments.save_views)
    collector = cameras.ViewCollector(target)
    last_line, enough = "", False
    try:
        while len(collector.views) < arguments.views:
            try:
                frame = source.read()
            except cameras.CameraLost as error:
                word = str(error)
            else:
                if frame is None:
                    break
                taken, word = collector.add_frame(frame)
                if taken and folder:
                    number = len(collector.views)
                    cameras.write_image(Path(folder) / f"view_{number:03d}.png", frame.image)
            line = f"{len(collector.views)} of {arguments.views} views: {word}"
            if line != last_line:
                print(line, file=sys.stderr, flush=True)
            last_line = line
            if collector.enough and not enough:
                print("more views make it better; Ctrl-C ends", file=sys.stderr, flush=True)
            enough = collector.enough
    except KeyboardInterrupt:
        print(f"ended with {len(collector.views)} views", file=sys.stderr)
    return collector.views, []


def _print_calibration(calibration: cameras.Calibration) -> None:
    """Prints views, rejected views, parameters, and the coverage of the image."""
    table = core.TextTable("views").names("image")
    table.numbers("corners", "rms [px]", "worst [px]", "tilt [deg]", "blur [px]")
    for used in calibration.views:
        worst = float(max((used.residuals**2).sum(axis=1)) ** 0.5)
        table.row(
            used.view.name,
            str(len(used.view.ids)),
            core.format_number(used.rms, 3),
            core.format_number(worst, 2),
            core.format_number(math.degrees(used.tilt), 0),
            core.format_number(used.view.blur, 2),
        )
    table.show()
    for name, reason in calibration.rejected:
        print(f"left out: {name} {reason}".replace(":  ", ": "))
    table = core.TextTable(f"lens model {calibration.model}").texts("parameter")
    table.numbers("value", "standard deviation")
    for name, (value, deviation) in calibration.parameters.items():
        table.row(name, f"{value:.6g}", f"{deviation:.2g}")
    table.caption = "f and c in pixels, others without a unit"
    table.show()
    size = (calibration.intrinsics.width, calibration.intrinsics.height)
    print("corners seen in each part of the image")
    for row in cameras.corner_coverage([used.view for used in calibration.views], size):
        print("  " + " ".join(f"{count:4d}" for count in row))
    print()
    print_intrinsics(calibration.intrinsics)
    print(f"target           bulges by {1e3 * calibration.bulge:.2f} mm")
    print("known, in 19 of 20 cases, to so many pixels")
    parts = calibration.accuracy.parts
    for row in (cameras.IMAGE_PARTS[:3], cameras.IMAGE_PARTS[3:6], cameras.IMAGE_PARTS[6:]):
        words = (f"{name} {calibration.accuracy.bound(name)}" for name in row if name in parts)
        print("  " + ", ".join(words))


def add_camera_list_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake camera list`."""
    parser.epilog = options.examples_text("burg-drake camera list")


def add_camera_show_options(show: options.Parser) -> None:
    """Adds the options of `burg-drake camera show`."""
    show.epilog = options.examples_text(
        "burg-drake camera show K.yaml", "burg-drake camera show sim:panda_tabletop/board"
    )
    _add_intrinsics_argument(show)


def add_camera_convert_options(convert: options.Parser) -> None:
    """Adds the options of `burg-drake camera convert`."""
    convert.epilog = options.examples_text(
        "burg-drake camera convert K.yaml --to ros -o camera_info.yaml",
        "burg-drake camera convert camera_info.yaml -o K.yaml",
        "burg-drake camera convert opencv_calibration.yml -o K.yaml",
    )
    _add_intrinsics_argument(convert)
    convert.add_argument(
        "--to",
        choices=("burg", "ros"),
        default="burg",
        help="format to write (default: %(default)s)",
    )
    options.add_output(convert, "FILE", "file to write")


def _add_intrinsics_argument(parser: Any) -> None:
    parser.add_argument(
        "intrinsics",
        metavar="INTRINSICS",
        type=options.input_file,
        help="intrinsics file (ours, ROS's camera_info, OpenCV's), or sim:STATION/CAMERA",
    )


def run_camera_list(arguments: argparse.Namespace) -> int:
    """Prints the cameras that open; 1 if there are none."""
    found = 0
    for name, (width, height) in cameras.open_devices():
        print(f"camera {name}: {width} x {height} pixels")
        found += 1
    if not found:
        print_remark(
            "no camera gives images; is one plugged in and not in use, and do you have"
            " permission to read it?"
        )
    return 0 if found else 1


def run_camera_show(arguments: argparse.Namespace) -> int:
    """Prints intrinsics."""
    print_intrinsics(cameras.load_intrinsics(arguments.intrinsics))
    return 0


def run_camera_convert(arguments: argparse.Namespace) -> int:
    """Writes intrinsics in another format."""
    intrinsics = cameras.load_intrinsics(arguments.intrinsics)
    save = cameras.save_camera_info if arguments.to == "ros" else cameras.save_intrinsics
    save(intrinsics, arguments.output)
    print(f"wrote {arguments.output}")
    return 0
