"""`burg-drake grasps convert`: grasps from and to the files of other projects."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    FRAMES,
    Parser,
    add_camera_options,
    add_file_options,
    add_format,
    add_hand,
    add_only,
    add_renaming,
    add_verb,
    gripper_for,
    input_file,
    named,
    number,
    output_of,
    print_notes,
)

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet
    from burg_drake.formats.common import GraspFormat, Gripper, ImportedGrasps


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "convert",
        run_convert,
        "convert grasps between formats",
        "burg-drake grasps convert Mug_10f6_0.00027.h5 mug.h5 --rename mug",
        "burg-drake grasps convert grasps.h5 mug.yaml --to isaac_grasp --only mug",
        "burg-drake grasps convert grasps.h5 out/ --to graspgen --success-above 0.5",
        "burg-drake grasps convert runs/first out/ --to acronym",
        "burg-drake grasps convert scene.npy grasps.h5 --scene tabletop_six --camera-pose cam.npy",
    )
    parser.add_argument(
        "input", metavar="IN", type=input_file, help="grasp file, or folder of a run"
    )
    parser.add_argument(
        "output", metavar="OUT", help="file to write, or folder for a file per object"
    )
    parser.add_argument("--formats", action=_ListFormats, nargs=0, help="list the formats and end")
    add_file_options(parser, in_full=True)
    add_format(parser)
    add_hand(parser, default=None)
    _add_selection(parser)
    _add_placement(parser)


def _add_selection(parser: Parser) -> None:
    """Options about which grasps are written, and of what."""
    add_only(parser, "write grasps")
    add_renaming(parser)
    parser.add_argument(
        "--success-above",
        metavar="SCORE",
        type=number,
        help="grasps with a higher score count as successful",
    )


def _add_placement(parser: Parser) -> None:
    """Options about frames."""
    group = parser.add_argument_group(
        "frames",
        ("For files whose poses are in the frame of a scene or a camera."),
    )
    group.add_argument("--scene", metavar="SCENE", help="scene in which the objects stand")
    add_camera_options(group)
    group.add_argument(
        "--frame",
        choices=tuple(FRAMES),
        help="frame of the poses in IN, if not the format's",
    )
    group.add_argument(
        "--out-frame", choices=tuple(FRAMES), help="frame of the poses in OUT, if not the format's"
    )


def run_convert(arguments: argparse.Namespace) -> int:
    """Reads, changes what is asked for, writes, and says what got lost on the way."""
    output = output_of(arguments.output, arguments.target)
    gripper = gripper_for(arguments, path=arguments.input)
    imported = _read(arguments, output.format, gripper)
    _print_read(arguments, imported)
    grasps = _selected(imported.grasps, arguments)
    output.require_fits(grasps.object.tolist())
    output.write(grasps, gripper)
    return 0


def _read(arguments: argparse.Namespace, target: GraspFormat, gripper: Gripper) -> ImportedGrasps:
    """The grasps in the frame that the target wants."""
    from burg_drake.evaluation.grasp_sets import SeenScene, read_in_frame
    from burg_drake.formats.common import read_poses
    from burg_drake.scene.document import load_scene

    return read_in_frame(
        arguments.input,
        FRAMES.get(arguments.out_frame, target.frame),  # type: ignore[arg-type]
        gripper,
        format=arguments.source,
        frame=FRAMES.get(arguments.frame),  # type: ignore[arg-type]
        objects=dict(arguments.rename),
        seen=SeenScene(
            scene=load_scene(arguments.scene) if arguments.scene else None,
            X_SF=read_poses(arguments.camera_pose) if arguments.camera_pose else None,
            object_ids=arguments.object_ids,
            scene_id=arguments.scene_id,
            correction=arguments.correction,
        ),
    )


def _selected(grasps: GraspSet, arguments: argparse.Namespace) -> GraspSet:
    from burg_drake.evaluation.candidates import are_of
    from burg_drake.formats.common import with_success

    if arguments.only:
        instances = grasps.columns.get("instance")
        grasps = grasps.select(are_of(arguments.only, arguments.input, grasps.object, instances))
    if arguments.success_above is not None:
        grasps = with_success(grasps, arguments.success_above)
    return grasps


def _print_read(arguments: argparse.Namespace, imported: ImportedGrasps) -> None:
    from burg_drake.core import listing
    from burg_drake.evaluation.grasp_sets import IN_WORDS, format_name
    from burg_drake.formats import FORMATS

    path = arguments.input
    format = named(FORMATS[arguments.source or format_name(path)])
    names = sorted({name for name in imported.grasps.object.tolist() if name})
    of = f" of {listing(names)}" if names else ""
    where = IN_WORDS[imported.frame]
    kind = "run" if Path(path).is_dir() else format
    print(f"{path}: {kind}, {len(imported.grasps)} grasps{of} in {where}")
    print_notes(imported.notes)


class _ListFormats(argparse.Action):
    """Lists the formats and ends, whatever else is given."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from burg_drake.formats import FORMATS

        _print_formats(list(FORMATS.values()))
        parser.exit()


def _print_formats(formats: Sequence[GraspFormat]) -> None:
    """Prints each format in a few lines; lengths are those of the Panda."""
    from burg_drake.evaluation.grasp_sets import IN_WORDS
    from burg_drake.formats.common import PANDA, convention_of

    for format in formats:
        frame = convention_of(format, PANDA)
        print(f"{named(format)} {' '.join(format.suffixes)}")
        print(
            f"  measured in {IN_WORDS[format.frame]}; approach {frame.approach}, closing"
            f" {frame.closing}, origin {frame.origin}"
        )
        print(f"  carries {', '.join(format.carries) or 'poses only'}")
        if format.cannot_carry:
            print(f"  no place for {', '.join(format.cannot_carry)}")
