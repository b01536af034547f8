"""`burg-drake grasps convert`: grasps from and to the files of other projects."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.arguments import Parser, add_renaming, add_verb, number
from burg_drake.apps.given_grasps import FRAMES, numbering
from burg_drake.core.errors import InvalidInputError

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet
    from burg_drake.formats.grasp_format import GraspFormat, Gripper, Imported

DEFAULT_HAND = "panda_hand"


def add_to(group: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        group,
        "convert",
        run_convert,
        "write grasps of one format in another",
        "burg-drake grasps convert --formats",
        "burg-drake grasps convert Mug_10f6_0.00027.h5 mug.h5 --rename mug",
        "burg-drake grasps convert grasps.h5 mug.yaml --to isaac_grasp --object mug",
        "burg-drake grasps convert grasps.h5 out/ --to graspgen --success-above 0.5",
        "burg-drake grasps convert scene.npy grasps.h5 --scene tabletop_six --camera-pose cam.npy",
    )
    parser.add_argument("input", metavar="IN", nargs="?", help="file of grasps")
    parser.add_argument(
        "output", metavar="OUT", nargs="?", help="file, or folder for one file an object"
    )
    parser.add_argument("--formats", action="store_true", help="list the formats and end")
    parser.add_argument(
        "--from", dest="source", metavar="FORMAT", help="format of IN (default: by its content)"
    )
    parser.add_argument(
        "--to", dest="target", metavar="FORMAT", help="format of OUT (default: by its suffix)"
    )
    parser.add_argument(
        "--hand",
        metavar="HAND",
        default=DEFAULT_HAND,
        help="hand that the grasps are for: document or built-in name (default: %(default)s)",
    )
    parser.add_argument(
        "--gripper-link", metavar="NAME", help="what isaac_grasp files call the body of that hand"
    )
    _add_selection(parser)
    _add_placement(parser)


def _add_selection(parser: Parser) -> None:
    """Options about which grasps are written, and of what."""
    parser.add_argument("--object", metavar="NAME", help="write the grasps of this object only")
    add_renaming(parser)
    parser.add_argument(
        "--success-above",
        metavar="SCORE",
        type=number,
        help="count grasps of a higher score as successful, where OUT has success and no scores",
    )


def _add_placement(parser: Parser) -> None:
    """Options about frames."""
    group = parser.add_argument_group(
        "frames", "For grasps that IN or OUT measure in a scene or a camera instead of an object."
    )
    group.add_argument("--scene", metavar="SCENE", help="scene in which the objects stand")
    group.add_argument(
        "--camera-pose",
        metavar="FILE",
        nargs="+",
        default=[],
        help="the camera in the scene frame: 4x4 .npy, FILE:INDEX, or YAML; several are multiplied",
    )
    group.add_argument(
        "--frame", choices=tuple(FRAMES), help="what IN measures in, if not what its format says"
    )
    group.add_argument("--out-frame", choices=tuple(FRAMES), help="what OUT measures in, likewise")
    group.add_argument(
        "--object-ids",
        metavar="ID=NAME,...",
        type=numbering,
        default={},
        help="object ids of instances in GraspNet's files",
    )
    group.add_argument("--scene-id", metavar="ID", help="which one of a file of several scenes")


def run_convert(arguments: argparse.Namespace) -> int:
    """Reads, changes what is asked for, writes, and says what got lost on the way."""
    from burg_drake.formats.grasp_files import FORMATS, format_by_suffix, format_of

    if arguments.formats:
        _print_formats(list(FORMATS.values()))
        return 0
    if arguments.input is None or arguments.output is None:
        raise InvalidInputError("give a file to read and a file or folder to write: IN OUT")
    out = Path(arguments.output)
    is_folder = out.is_dir() or arguments.output.endswith("/") or not out.suffix
    if is_folder and arguments.target is None:
        raise InvalidInputError(f"{out} is a folder; say in which format to write (--to)")
    target = FORMATS[arguments.target] if arguments.target else format_by_suffix(out)
    gripper = _gripper(arguments)
    imported = _read(arguments, target, gripper)
    source = FORMATS[arguments.source] if arguments.source else format_of(arguments.input)
    _print_read(arguments.input, source, imported)
    grasps = _selected(imported.grasps, arguments)
    if is_folder:
        from burg_drake.formats.conversion import write_each_object

        for path, notes in write_each_object(grasps, out, target, gripper).items():
            _print_written(path, target, notes)
    else:
        _print_written(out, target, target.write(grasps, out, gripper))
    return 0


def _gripper(arguments: argparse.Namespace) -> Gripper:
    """The hand of the grasps; for the Panda without a look into its model."""
    from burg_drake.formats.grasp_format import PANDA

    gripper = PANDA
    if arguments.hand != DEFAULT_HAND:
        from burg_drake.station.gripper import gripper_of
        from burg_drake.station.hand import locate_hand

        gripper = gripper_of(*locate_hand(arguments.hand))
    return replace(gripper, body=arguments.gripper_link) if arguments.gripper_link else gripper


def _read(arguments: argparse.Namespace, target: GraspFormat, gripper: Gripper) -> Imported:
    """The grasps in the frame that the target wants."""
    from burg_drake.evaluation.exchange import read_in_frame
    from burg_drake.formats.pose_file import read_poses
    from burg_drake.scene.scene import load_scene

    return read_in_frame(
        arguments.input,
        FRAMES.get(arguments.out_frame, target.frame),  # type: ignore[arg-type]
        gripper,
        format=arguments.source,
        frame=FRAMES.get(arguments.frame),  # type: ignore[arg-type]
        objects=dict(arguments.rename),
        scene=load_scene(arguments.scene) if arguments.scene else None,
        X_SF=read_poses(arguments.camera_pose) if arguments.camera_pose else None,
        object_ids=arguments.object_ids,
        scene_id=arguments.scene_id,
    )


def _selected(grasps: GraspSet, arguments: argparse.Namespace) -> GraspSet:
    from burg_drake.formats.conversion import of_object, with_success

    if arguments.object is not None:
        grasps = of_object(grasps, arguments.object)
    if arguments.success_above is not None:
        grasps = with_success(grasps, arguments.success_above)
    return grasps


def _print_read(path: str, source: GraspFormat, imported: Imported) -> None:
    from burg_drake.core.errors import listing
    from burg_drake.evaluation.exchange import IN_WORDS

    names = sorted({name for name in imported.grasps.object.tolist() if name})
    of = f" of {listing(names)}" if names else ""
    where = IN_WORDS[imported.frame]
    print(f"{path}: {_named(source)}, {len(imported.grasps)} grasps{of} in {where}")
    _print_notes(imported.notes)


def _print_written(path: Path, target: GraspFormat, notes: Sequence[str]) -> None:
    print(f"{path}: written as {_named(target)}")
    _print_notes(notes)


def _named(format: GraspFormat) -> str:
    return format.name if format.title == format.name else f"{format.name} ({format.title})"


def _print_notes(notes: Sequence[str]) -> None:
    for note in notes:
        print(f"  {note}")


def _print_formats(formats: Sequence[GraspFormat]) -> None:
    """Prints each format in a few lines; lengths are those of the Panda."""
    from burg_drake.evaluation.exchange import IN_WORDS
    from burg_drake.formats.grasp_convention import convention_of
    from burg_drake.formats.grasp_format import PANDA

    for format in formats:
        frame = convention_of(format, PANDA)
        print(f"{_named(format)} {' '.join(format.suffixes)}")
        print(
            f"  measured in {IN_WORDS[format.frame]}; approach {frame.approach}, closing"
            f" {frame.closing}, origin {frame.origin}"
        )
        print(f"  carries {', '.join(format.carries) or 'poses only'}")
        if format.cannot_carry:
            print(f"  no place for {', '.join(format.cannot_carry)}")
