"""Options by which `evaluate` takes grasps from files, of any origin."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from burg_drake.apps.arguments import Parser, renaming
from burg_drake.core.errors import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.evaluation.candidate_files import GivenGrasps
    from burg_drake.scene.scene import Scene
    from burg_drake.station.station import Station

FRAMES = {"object": "object", "scene": "world", "camera": "camera"}
"""What `formats` calls the choices of --grasps-frame."""


def add_given(parser: Parser, which: Any) -> None:
    """Adds the options.

    Args:
        parser: gets a group of options.
        which: group that --grasps is an alternative in.
    """
    which.add_argument(
        "--grasps",
        metavar="FILE",
        help="judge the grasps of this file, ours or of another project; sample none",
    )
    group = parser.add_argument_group(
        "with --grasps",
        "A file tells by its content what it is; see `burg-drake grasps convert --help`.",
    )
    group.add_argument("--grasps-format", metavar="NAME", help="format of the file, if it must be")
    group.add_argument(
        "--grasps-object",
        metavar="[THEIRS=]OURS",
        action="append",
        type=renaming,
        default=[],
        help="object or instance of the scene that grasps are of; once for each name in the file",
    )
    group.add_argument(
        "--grasps-frame",
        choices=tuple(FRAMES),
        help="what poses are measured in, where that is not what the format says",
    )
    group.add_argument(
        "--camera-pose",
        metavar="FILE",
        nargs="+",
        default=[],
        help="where the scene frame has the file's camera (or world): 4x4 .npy, FILE:INDEX for one"
        " of several, or YAML; several are multiplied",
    )
    group.add_argument(
        "--object-ids",
        metavar="ID=NAME,...",
        type=numbering,
        default={},
        help="instances by object id; without, grasps go to what is between their fingers",
    )
    group.add_argument("--scene-id", metavar="ID", help="which one of a file of several scenes")


def numbering(text: str) -> dict[int, str]:
    """`ID=NAME,ID=NAME`."""
    names: dict[int, str] = {}
    for part in text.split(","):
        number, _, name = part.partition("=")
        if not number.strip().isdecimal() or not name.strip():
            raise argparse.ArgumentTypeError(f"{part!r} is not ID=NAME, such as 5=mug")
        names[int(number)] = name.strip()
    return names


def require_file(arguments: argparse.Namespace) -> None:
    """Refuses options about a file where none is given.

    Raises:
        InvalidInputError: names the option.
    """
    names = ("grasps_format", "grasps_object", "grasps_frame", "camera_pose", "object_ids")
    for name in (*names, "scene_id"):
        if getattr(arguments, name) and arguments.grasps is None:
            raise InvalidInputError(
                f"--{name.replace('_', '-')} is about a file; add --grasps FILE"
            )


def read_given(arguments: argparse.Namespace, scene: Scene, station: Station) -> GivenGrasps:
    """The grasps of the file that --grasps names, on the instances of a scene."""
    from burg_drake.evaluation.candidate_files import read_grasps
    from burg_drake.formats.pose_file import read_poses
    from burg_drake.station.gripper import gripper_of

    poses = arguments.camera_pose
    return read_grasps(
        scene,
        arguments.grasps,
        gripper_of(station.hand, station.hand_model, station.hand_path),
        format=arguments.grasps_format,
        objects=dict(arguments.grasps_object),
        frame=FRAMES.get(arguments.grasps_frame),  # type: ignore[arg-type]
        X_SF=read_poses(poses) if poses else None,
        object_ids=arguments.object_ids,
        scene_id=arguments.scene_id,
    )
