"""`burg-drake grasps convert` and `frames`: grasp files and grasp frames of other projects."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake import core, evaluation
from burg_drake.apps import options

if TYPE_CHECKING:
    from burg_drake.formats import GraspFormat, Gripper, ImportedGrasps


def add_grasps_convert_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake grasps convert`."""
    parser.epilog = options.examples_text(
        "burg-drake grasps convert Mug_10f6_0.00027.h5 mug.h5 --rename mug",
        "burg-drake grasps convert grasps.h5 mug.yaml --to isaac_grasp --only mug",
        "burg-drake grasps convert grasps.h5 out/ --to graspgen --success-above 0.5",
        "burg-drake grasps convert runs/first out/ --to acronym",
        "burg-drake grasps convert scene.npy grasps.h5 --scene tabletop_six --camera-pose cam.npy",
    )
    parser.add_argument(
        "input", metavar="IN", type=options.input_file, help="grasp file, or folder of a run"
    )
    parser.add_argument(
        "output", metavar="OUT", help="file to write, or folder for a file per object"
    )
    parser.add_argument("--formats", action=_ListFormats, nargs=0, help="list the formats and end")
    options.add_reading_options(parser, all_corrections=True)
    options.add_format_option(parser)
    options.add_hand(parser, default=None)
    _add_selection_options(parser)
    _add_frame_options(parser)


def _add_selection_options(parser: options.Parser) -> None:
    """Adds options that select grasps and objects."""
    options.add_only(parser, "write grasps")
    options.add_renaming(parser)
    parser.add_argument(
        "--success-above",
        metavar="SCORE",
        type=options.number,
        help="grasps with a higher score count as successful",
    )


def _add_frame_options(parser: options.Parser) -> None:
    """Adds options about frames."""
    group = parser.add_argument_group(
        "frames", "For files whose poses are in the frame of a scene or a camera."
    )
    group.add_argument("--scene", metavar="SCENE", help="scene in which the objects stand")
    options.add_camera_options(group)
    group.add_argument(
        "--frame",
        choices=tuple(options.POSE_FRAMES),
        help="frame of the poses in IN, if not the format's",
    )
    group.add_argument(
        "--out-frame",
        choices=tuple(options.POSE_FRAMES),
        help="frame of the poses in OUT, if not the format's",
    )


def run_grasps_convert(arguments: argparse.Namespace) -> int:
    """Converts a grasp file, and prints what the target format cannot store."""
    output = options.grasp_output(arguments.output, arguments.target)
    gripper = options.gripper_from_options(arguments, path=arguments.input)
    imported = _read_grasps(arguments, output.format, gripper)
    _print_import(arguments, imported)
    grasps = _select_grasps(imported.grasps, arguments)
    output.require_fits(grasps.object.tolist())
    output.write(grasps, gripper)
    return 0


def _read_grasps(
    arguments: argparse.Namespace, target: GraspFormat, gripper: Gripper
) -> ImportedGrasps:
    """The grasps in the frame of the target format."""
    from burg_drake.formats import read_poses
    from burg_drake.scene import load_scene

    return evaluation.read_in_frame(
        arguments.input,
        options.POSE_FRAMES.get(arguments.out_frame, target.frame),  # type: ignore[arg-type]
        gripper,
        format=arguments.source,
        frame=options.POSE_FRAMES.get(arguments.frame),  # type: ignore[arg-type]
        objects=dict(arguments.rename),
        seen=evaluation.SeenScene(
            scene=load_scene(arguments.scene) if arguments.scene else None,
            X_SF=read_poses(arguments.camera_pose) if arguments.camera_pose else None,
            object_ids=arguments.object_ids,
            scene_id=arguments.scene_id,
            correction=arguments.correction,
        ),
    )


def _select_grasps(grasps: core.GraspSet, arguments: argparse.Namespace) -> core.GraspSet:
    from burg_drake.formats import with_success

    if arguments.only:
        instances = grasps.columns.get("instance")
        grasps = grasps.select(
            evaluation.rows_of_names(arguments.only, arguments.input, grasps.object, instances)
        )
    if arguments.success_above is not None:
        grasps = with_success(grasps, arguments.success_above)
    return grasps


def _print_import(arguments: argparse.Namespace, imported: ImportedGrasps) -> None:
    from burg_drake.formats import format_named

    path = arguments.input
    format = options.format_title(format_named(arguments.source or evaluation.format_name(path)))
    names = sorted({name for name in imported.grasps.object.tolist() if name})
    of = f" of {core.list_names(names)}" if names else ""
    where = evaluation.FRAME_WORDS[imported.frame]
    kind = "run" if Path(path).is_dir() else format
    print(f"{path}: {kind}, {len(imported.grasps)} grasps{of} in {where}")
    options.print_notes(imported.notes)


class _ListFormats(argparse.Action):
    """Lists the formats and ends the command, whatever other options are given."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from burg_drake.formats import GRASP_FORMATS

        _print_formats(list(GRASP_FORMATS.values()))
        parser.exit()


def _print_formats(formats: Sequence[GraspFormat]) -> None:
    """Prints each format in a few lines, with the lengths of the Panda hand."""
    from burg_drake.formats import PANDA_GRIPPER, convention_of

    for format in formats:
        frame = convention_of(format, PANDA_GRIPPER)
        print(f"{options.format_title(format)} {' '.join(format.suffixes)}")
        print(
            f"  measured in {evaluation.FRAME_WORDS[format.frame]}; approach {frame.approach},"
            f" closing {frame.closing}, origin {frame.origin}"
        )
        print(f"  carries {', '.join(format.carries) or 'poses only'}")
        if format.cannot_carry:
            print(f"  no place for {', '.join(format.cannot_carry)}")


OWN_FRAMES = (
    ("W", "world", "z up"),
    ("S", "scene", "a corner of the board; x right and y up the sheet, z out of it"),
    ("O", "object", "that of its mesh, after scaling; not the centre of mass"),
    ("H", "hand", "the body of the hand's model that the arm carries"),
    ("G", "grasp", "midway between the pads; +z approach, +x closing direction"),
    ("P", "pregrasp", "G moved back along the approach"),
    ("A", "arm", "the arm's base"),
    ("C", "camera", "optical: z forward, x right, y down"),
)
"""Letter, name and location of the frames of burg_drake."""


def add_frames_options(frames: options.Parser) -> None:
    """Adds the options of `burg-drake frames`."""
    frames.epilog = options.examples_text(
        "burg-drake frames --text",
        "burg-drake frames --html frames.html",
        "burg-drake frames acronym graspnet --hand wsg_50",
    )
    frames.add_argument(
        "names", metavar="NAME", nargs="*", help="formats of grasp files (default: all)"
    )
    options.add_hand(frames)
    frames.add_argument("--text", action="store_true", help="print only the tables")
    options.add_view_options(frames)


def run_frames(arguments: argparse.Namespace) -> int:
    """Prints the tables and shows the frames."""
    from burg_drake.formats import GRASP_FORMATS, format_named

    formats = {name: format_named(name) for name in arguments.names or GRASP_FORMATS}
    if arguments.text:
        _print_tables(formats, options.gripper_by_name(arguments.hand))
        return 0
    from burg_drake.apps.terminal import open_view, present_view
    from burg_drake.station import locate_hand
    from burg_drake.visualization import show_frames

    gripper = options.gripper_by_name(arguments.hand)
    hand, model, _ = locate_hand(arguments.hand)
    meshcat = open_view(arguments)
    # our frame is in every picture
    shown = [
        formats[name]
        for name in arguments.names or formats
        if name != "burg_drake" or arguments.names
    ]
    legend = show_frames(hand, model, gripper, shown, meshcat)
    _print_tables(formats, gripper)
    caption = [f"{hand.name}, open; x red, y green, z blue"]
    present_view(meshcat, arguments, title="Grasp frames", caption=caption, legend=legend)
    return 0


def _print_tables(formats: Mapping[str, GraspFormat], gripper: Gripper) -> None:
    from burg_drake.formats import convention_of

    _print_table("frames of burg_drake", ("frame", "of", "where"), OWN_FRAMES)
    found = [(format, convention_of(format, gripper)) for format in formats.values()]
    _print_table(
        f"grasp frames F of files, for {gripper.name}",
        ("format", "approach", "closing", "origin of F", "poses in", "file"),
        [
            (f.name, c.approach, c.closing, c.origin, f.frame, " ".join(f.suffixes))
            for f, c in found
        ],
    )
    _print_table(
        "what files do not carry",
        ("format", "lost when written"),
        [(f.name, ", ".join(f.cannot_carry) or "-") for f in formats.values()],
    )


def _print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = core.TextTable(title).texts(*columns)
    for row in rows:
        table.row(*row)
    table.show()
