"""`burg-drake camera`: which cameras there are, and files of intrinsics.

`camera_target` and `camera_calibrate` make these; `camera_placement` and `camera_locate` look at
photos of the board.
"""

from __future__ import annotations

import argparse
import math
import sys
from typing import TYPE_CHECKING, Any

from burg_drake.apps.camera import calibrate, locate, placement, target
from burg_drake.apps.options import add_group, add_verb

if TYPE_CHECKING:
    from burg_drake.cameras.optics import Intrinsics


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "camera", "find, calibrate and place cameras, and check photos")
    add_verb(
        group,
        "list",
        run_list,
        "print which cameras of this machine give images (exit code 1 if none does)",
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
        "print intrinsics, the field of view, and how far the lens distorts",
        "burg-drake camera show K.yaml",
        "burg-drake camera show sim:panda_tabletop/board",
    )
    _add_intrinsics(show)


def _add_convert(group: Any) -> None:
    convert = add_verb(
        group,
        "convert",
        run_convert,
        "write intrinsics as our document, or as a camera_info file of ROS",
        "burg-drake camera convert K.yaml --to ros -o camera_info.yaml",
        "burg-drake camera convert camera_info.yaml -o K.yaml",
        "burg-drake camera convert opencv_calibration.yml -o K.yaml",
    )
    _add_intrinsics(convert)
    convert.add_argument(
        "--to", choices=("burg", "ros"), default="burg", help="what to write (default: %(default)s)"
    )
    convert.add_argument("-o", "--output", metavar="FILE", required=True, help="file to write")


def _add_intrinsics(parser: Any) -> None:
    parser.add_argument(
        "intrinsics",
        metavar="INTRINSICS",
        help="intrinsics: ours, camera_info of ROS, OpenCV's; or sim:STATION/CAMERA",
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
            "burg-drake: no camera gives images; is one plugged in, free, and may you read it?",
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


def print_intrinsics(intrinsics: Intrinsics) -> None:
    """Prints a camera's figures."""
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
    if k.is_pinhole:
        print("distortion       none")
    else:
        print("distortion       " + ", ".join(f"{value:.5g}" for value in k.distortion))
        corners = np.array([(u, v) for v in (0, k.height - 1) for u in (0, k.width - 1)], float)
        moved = np.linalg.norm(corners - k.undistort(corners), axis=1)
        names = ("upper left", "upper right", "lower left", "lower right")
        of_corners = (f"{name} {m:.1f}" for name, m in zip(names, moved, strict=True))
        print(f"moves corners by {', '.join(of_corners)} pixels")
    if k.residual is not None:
        print(f"residual         {k.residual:.3f} pixels")


def field_of_view(intrinsics: Intrinsics) -> tuple[float, float, float]:
    """Angle between what opposite edges see, across and down, and opposite corners [rad]."""
    import numpy as np

    k = intrinsics
    w, h = k.width - 0.5, k.height - 0.5
    cx, cy = k.center
    ends = [((-0.5, cy), (w, cy)), ((cx, -0.5), (cx, h)), ((-0.5, -0.5), (w, h))]
    straight = (k.undistort(np.array(ends, dtype=float)) - k.center) / k.focal
    rays = np.concatenate([straight, np.ones((3, 2, 1))], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    angles = np.arccos((rays[:, 0] * rays[:, 1]).sum(axis=-1)).tolist()
    return angles[0], angles[1], angles[2]
