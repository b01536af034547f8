"""Options by which `evaluate` takes grasps from files, of any origin."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options.arguments import Parser
from burg_drake.apps.options.grasp_file import (
    FRAMES,
    add_camera_options,
    add_reading,
    gripper_for,
)
from burg_drake.apps.options.values import input_file, renaming
from burg_drake.core import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.evaluation.grasp_sets import GivenGrasps
    from burg_drake.scene.document import Scene
    from burg_drake.station.document import Station


def add_given(parser: Parser, which: Any) -> None:
    """Adds the options.

    Args:
        parser: gets a group of options.
        which: group that --grasps is an alternative in.
    """
    which.add_argument(
        "--grasps",
        metavar="FILE|RUN",
        type=input_file,
        help="grasps of this file or run, instead of sampling",
    )
    group = parser.add_argument_group(
        "with --grasps",
        "`burg-drake grasps convert --formats` lists the formats.",
    )
    group.add_argument(
        "--grasps-format", metavar="NAME", help="format of the file (default: recognised)"
    )
    add_reading(group)
    group.add_argument(
        "--grasps-object",
        metavar="[THEIRS=]OURS",
        action="append",
        type=renaming,
        default=[],
        help="object or instance of the grasps; once for each name in the file",
    )
    group.add_argument(
        "--grasps-frame",
        choices=tuple(FRAMES),
        help="frame of the poses, if not the format's",
    )
    add_camera_options(group)


def require_file(arguments: argparse.Namespace) -> None:
    """Refuses options about a file where none is given.

    Raises:
        InvalidInputError: names the option.
    """
    names = ("grasps_format", "grasps_object", "grasps_frame", "camera_pose", "object_ids")
    for name in (*names, "scene_id", "gripper_link", "correction"):
        if getattr(arguments, name) and arguments.grasps is None:
            raise InvalidInputError(
                f"--{name.replace('_', '-')} is for grasp files; add --grasps FILE"
            )


def read_given(arguments: argparse.Namespace, scene: Scene, station: Station) -> GivenGrasps:
    """The grasps of the file that --grasps names, on the instances of a scene."""
    from burg_drake.evaluation.grasp_sets import (
        FileReading,
        MisplacedGraspsError,
        find_mistake,
        read_grasps,
    )
    from burg_drake.formats.common import read_poses

    poses = arguments.camera_pose
    try:
        return read_grasps(
            scene,
            arguments.grasps,
            gripper_for(arguments, station),
            format=FileReading(arguments.grasps_format, arguments.correction),
            objects=dict(arguments.grasps_object),
            frame=FRAMES.get(arguments.grasps_frame),  # type: ignore[arg-type]
            X_SF=read_poses(poses) if poses else None,
            object_ids=arguments.object_ids,
            scene_id=arguments.scene_id,
        )
    except MisplacedGraspsError as error:
        mistake = find_mistake(error.grasps, station, scene)
        if mistake is None:
            raise
        raise InvalidInputError(f"{error}. {mistake.text()}") from error
