"""Options about the grasps that are evaluated: sampled or from a file, and how the hand moves."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from burg_drake import core, evaluation
from burg_drake.apps.options.arguments import Parser, add_only
from burg_drake.apps.options.grasp_files import (
    POSE_FRAMES,
    add_camera_options,
    add_correction_options,
    gripper_from_options,
)
from burg_drake.apps.options.settings_options import add_settings_options, fields_from_options
from burg_drake.apps.options.values import input_file, renaming

if TYPE_CHECKING:
    from burg_drake.evaluation import MotionRemedy
    from burg_drake.scene import Scene
    from burg_drake.station import GraspMotion, Station


def add_sampling_options(parser: Parser, default: int, source_group: Any = None) -> None:
    """Adds the options for grasp sampling.

    Args:
        parser: parser that gets the options.
        default: number of grasps for each object.
        source_group: mutually exclusive options for the grasps, such as --grasps; None for none.
    """
    add_settings_options(
        source_group or parser,
        evaluation.EvaluationSettings,
        "grasps_per_object",
        unset=True,
        shown_default=default,
    )
    parser.set_defaults(default_grasps=default)
    add_settings_options(parser, evaluation.EvaluationSettings, "blind")
    add_only(parser, "grasps")
    add_settings_options(parser, evaluation.EvaluationSettings, "approach_angle_deg", unset=True)
    add_settings_options(parser, evaluation.EvaluationSettings, "seed")


def grasps_per_object(arguments: argparse.Namespace) -> int:
    """The requested number of grasps per object."""
    return int(arguments.grasps_per_object or arguments.default_grasps)


def refuse_sampling_options_with_file(arguments: argparse.Namespace) -> None:
    """Refuses options about sampling if the grasps come from a file.

    Raises:
        InvalidInputError: such an option is given; the message names it.
    """
    for name in ("blind", "approach_angle", "until_balanced"):
        if getattr(arguments, name, None) and arguments.grasps is not None:
            raise core.InvalidInputError(
                f"{arguments.flags[name]} is for sampled grasps; leave out either it or --grasps"
            )


def print_shortfalls(sampled: Mapping[str, core.GraspSet], asked: int) -> None:
    """Prints a line for each object with fewer grasps than requested, with the reason."""
    for name, grasps in sampled.items():
        note = evaluation.shortfall_note(name, asked, grasps.provenance, len(grasps))
        if note:
            print(f"note: {note}")


def add_grasp_file_options(parser: Parser, source_group: Any) -> None:
    """Adds the options for grasps from a file.

    Args:
        parser: parser that gets a group of options.
        source_group: mutually exclusive options that --grasps belongs to.
    """
    source_group.add_argument(
        "--grasps",
        metavar="FILE|RUN",
        type=input_file,
        help="grasps of this file or run, instead of sampling",
    )
    group = parser.add_argument_group(
        "with --grasps", "`burg-drake grasps convert --formats` lists the formats."
    )
    group.add_argument(
        "--grasps-format", metavar="NAME", help="format of the file (default: recognised)"
    )
    add_correction_options(group)
    group.add_argument(
        "--grasps-object",
        metavar="[THEIRS=]OURS",
        action="append",
        type=renaming,
        default=[],
        help="object or instance of the grasps; once for each name in the file",
    )
    group.add_argument(
        "--grasps-frame", choices=tuple(POSE_FRAMES), help="frame of the poses, if not the format's"
    )
    add_camera_options(group)
    parser.set_defaults(grasp_file_options=[action.dest for action in group._group_actions])


def require_grasp_file(arguments: argparse.Namespace) -> None:
    """Refuses options about a grasp file if no file is given.

    Raises:
        InvalidInputError: such an option is given; the message names it.
    """
    for name in arguments.grasp_file_options:
        if getattr(arguments, name) and arguments.grasps is None:
            raise core.InvalidInputError(
                f"{arguments.flags[name]} is for grasp files; add --grasps FILE"
            )


def read_grasps_from_options(
    arguments: argparse.Namespace, scene: Scene, station: Station
) -> evaluation.GivenGrasps:
    """The grasps of the file that --grasps names, on the instances of a scene."""
    from burg_drake.formats import read_poses

    poses = arguments.camera_pose
    try:
        return evaluation.read_grasps(
            scene,
            arguments.grasps,
            gripper_from_options(arguments, station),
            format=evaluation.FileReading(arguments.grasps_format, arguments.correction),
            objects=dict(arguments.grasps_object),
            frame=POSE_FRAMES.get(arguments.grasps_frame),  # type: ignore[arg-type]
            X_SF=read_poses(poses) if poses else None,
            object_ids=arguments.object_ids,
            scene_id=arguments.scene_id,
        )
    except evaluation.MisplacedGraspsError as error:
        mistake = evaluation.find_mistake(error.grasps, station, scene)
        if mistake is None:
            raise
        raise core.InvalidInputError(f"{error}. {mistake.text()}") from error


def add_motion_options(parser: Parser) -> None:
    """Adds the options for the motion of the hand."""
    from burg_drake.station import GraspMotion

    group = parser.add_argument_group(
        "motion of the hand",
        "Default: what the station says, else 100 mm approach and 300 mm lift.",
    )
    add_settings_options(group, GraspMotion, unset=True)


def motion_fields_from_options(arguments: argparse.Namespace) -> dict[str, object]:
    """The fields of `GraspMotion` that are given by options."""
    from burg_drake.station import GraspMotion

    return fields_from_options(arguments, GraspMotion)


def describe_motion_remedy(remedy: MotionRemedy) -> str:
    """The option that a remedy suggests, with its value, in one sentence."""
    what = "retreat" if remedy.setting == "retreat" else "lift"
    return f"{motion_option(remedy.setting)} {1e3 * remedy.value:g} asks for the shorter {what}"


def motion_from_options(arguments: argparse.Namespace, station: Station) -> GraspMotion:
    """The station's motion, with the fields that options change.

    Raises:
        InvalidInputError: the values are inconsistent; the message names the option.
    """
    given = motion_fields_from_options(arguments)
    try:
        return replace(station.document.motion, **given)  # type: ignore[arg-type]
    except core.FieldError as error:
        options = ", ".join(motion_option(field) for field in given)
        raise core.InvalidInputError(f"{error} ({options})") from error


def motion_option(field: str) -> str:
    """The option of a field of `GraspMotion`."""
    from burg_drake.station import GraspMotion

    return core.option_name(GraspMotion, field)


def refuse_standoff_without_arm(arguments: argparse.Namespace, mode: str) -> None:
    """Refuses a standoff in a mode without arm.

    Raises:
        InvalidInputError: a standoff is given, but the hand starts at the grasp.
    """
    approaches = mode != "hand" or getattr(arguments, "approach", False)
    if not approaches and arguments.standoff_mm is not None:
        raise core.InvalidInputError(
            "--standoff-mm is the length of the approach; in mode 'hand' the trial begins at the"
            " grasp: leave it out, or give --approach, or --mode reach or arm"
        )
