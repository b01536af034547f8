"""Options about grasp files: the gripper, the objects that the grasps belong to, and the output."""

from __future__ import annotations

import argparse
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake import core, evaluation, formats
from burg_drake.apps.options.arguments import DEFAULT_STATION, Parser, add_station
from burg_drake.apps.options.values import input_file

if TYPE_CHECKING:
    from burg_drake.objects import ObjectLibrary
    from burg_drake.scene import Scene
    from burg_drake.station import Station

DEFAULT_HAND = "panda_hand"

POSE_FRAMES = {"object": "object", "scene": "world", "camera": "camera"}
"""Frames of poses in grasp files: option values, and their names in `formats`."""


def add_reading_options(parser: Any, *, all_corrections: bool = False) -> None:
    """Adds the options --from, --gripper-link and --correction, for reading a file; the help names
    all corrections, or only an example."""
    parser.add_argument(
        "--from", dest="source", metavar="FORMAT", help="format to read (default: recognised)"
    )
    add_correction_options(parser, all_corrections=all_corrections)


def add_correction_options(parser: Any, *, all_corrections: bool = False) -> None:
    """Adds the options --gripper-link and --correction."""
    others = " (see burg-drake grasps convert --help)"
    if all_corrections:
        others = (
            " (degrees about x, y or z), forward:103.4 (mm along the approach), inverse,"
            " transposed, wxyz, xyzw, y_up, z_up, millimetres, half_widths"
        )
    parser.add_argument(
        "--gripper-link", metavar="NAME", help="hand's link in isaac_grasp files (default: its own)"
    )
    parser.add_argument(
        "--correction",
        metavar="NAME,...",
        type=lambda text: tuple(text.split(",")),
        default=(),
        help=f"correct poses, such as turn:z90{others}",
    )


def add_hand(parser: Parser, default: str | None = DEFAULT_HAND) -> None:
    """Adds --hand, for commands without a station; the file names the hand if `default` is None."""
    parser.add_argument(
        "--hand",
        metavar="HAND",
        default=default,
        help="hand file or built-in name (default:"
        f" {default or f'that of the file, else {DEFAULT_HAND}'})",
    )


def add_camera_options(group: Any) -> None:
    """Adds the options --camera-pose, --object-ids and --scene-id, for files about a scene."""
    group.add_argument(
        "--camera-pose",
        metavar="FILE",
        type=input_file,
        nargs="+",
        default=[],
        help="pose of the camera in the scene: 4x4 .npy, FILE:INDEX, or YAML; several are"
        " multiplied",
    )
    group.add_argument(
        "--object-ids",
        metavar="ID=NAME,...",
        type=parse_object_ids,
        default={},
        help="instances by object id (default: the object between the fingers)",
    )
    group.add_argument("--scene-id", metavar="ID", help="scene to read from a file of several")


def parse_object_ids(text: str) -> dict[int, str]:
    """Parses `ID=NAME,ID=NAME`."""
    names: dict[int, str] = {}
    for part in text.split(","):
        number, _, name = part.partition("=")
        if not number.strip().isdecimal() or not name.strip():
            raise argparse.ArgumentTypeError(f"{part!r} is not ID=NAME, such as 5=mug")
        names[int(number)] = name.strip()
    return names


def gripper_from_options(
    arguments: argparse.Namespace, station: Station | None = None, path: str | None = None
) -> formats.Gripper:
    """The hand of the station, else of --hand, else of the file, with the link of
    --gripper-link."""
    if station is None:
        gripper = gripper_by_name(arguments.hand) if arguments.hand else _gripper_of_file(path)
    else:
        from burg_drake.station import station_gripper

        gripper = station_gripper(station)
    return replace(gripper, body=arguments.gripper_link) if arguments.gripper_link else gripper


def add_file_station(parser: Parser) -> None:
    """Adds the option --station, for commands whose files may name a station."""
    add_station(
        parser,
        f"station file or built-in name (default: that of the file, else {DEFAULT_STATION})",
        default=None,
    )


def station_from_options(arguments: argparse.Namespace, path: str) -> Station:
    """The station of --station, else of the file or run, else the default.

    Raises:
        UnknownNameError: there is no such station.
    """
    from burg_drake.station import load_station

    if arguments.station is not None:
        return load_station(arguments.station)
    reference = evaluation.station_reference(path)
    if reference is not None and not core.is_resolved(reference, "stations"):
        raise core.UnknownNameError(
            f"{path} names a station that is not there: {reference}; give --station"
        )
    try:
        return load_station(reference or DEFAULT_STATION)
    except core.UnknownNameError as error:
        raise core.UnknownNameError(f"{path} names a station: {error}; give --station") from error


def gripper_by_name(hand: str) -> formats.Gripper:
    """Properties of a hand for grasp formats; those of the Panda without loading its model."""
    if hand == DEFAULT_HAND:
        return formats.PANDA_GRIPPER
    from burg_drake.station import gripper_of, locate_hand

    return gripper_of(*locate_hand(hand))


def _gripper_of_file(path: str | None) -> formats.Gripper:
    """The hand named by a grasp file or a run, else the default hand."""
    reference = None if path is None else evaluation.hand_reference(path)
    if reference is None:
        return gripper_by_name(DEFAULT_HAND)
    try:
        return gripper_by_name(reference)
    except core.BurgError as error:
        raise core.UnknownNameError(
            f"the hand that {path} names cannot be used; give another (--hand): {error}"
        ) from error


@dataclass(frozen=True, eq=False)
class GraspSource:
    """The objects of grasps.

    Attributes:
        library: library of the objects.
        scene: scene of the objects; None if unknown.
    """

    library: ObjectLibrary
    scene: Scene | None = None

    def reference(self) -> dict[str, str]:
        """The entry for the provenance of grasps, which `load_grasp_source` reads."""
        if self.scene is not None:
            return {"scene": str(self.scene.path)}
        return {"library": str(self.library.root)}


def open_grasp_source(reference: str) -> GraspSource:
    """Opens the argument SCENE|LIB.

    Args:
        reference: a scene file or a library folder, or the name of a built-in one.

    Raises:
        UnknownNameError: there is no such scene or library.
        DocumentError: its document does not fit the schema.
    """
    from burg_drake.objects import LIBRARY_FILE, load_library
    from burg_drake.scene import load_scene

    scenes, libraries = core.builtin_names("scenes"), core.builtin_names("models")
    path = core.expand_home(reference)
    is_library = path.is_dir() or path.name == LIBRARY_FILE or reference in libraries
    if not is_library and reference not in scenes and not path.exists():
        raise core.UnknownNameError(
            f"{reference} is neither a scene nor an object library;"
            f" {core.suggest_names(reference, [*scenes, *libraries])}"
        )
    if is_library:
        return GraspSource(load_library(reference))
    scene = load_scene(reference)
    return GraspSource(scene.library, scene)


def add_source_options(parser: Parser) -> None:
    """Adds the options --scene and --library."""
    choice = parser.add_mutually_exclusive_group()
    choice.add_argument(
        "--scene", metavar="SCENE", help="scene of the grasps (default: what the file names)"
    )
    choice.add_argument(
        "--library", metavar="LIB", help="library of the grasps (default: what the file names)"
    )


def load_grasp_source(
    arguments: argparse.Namespace, grasps: core.GraspSet, path: str
) -> GraspSource:
    """The objects of a grasp file.

    Args:
        arguments: parsed arguments with the options of `add_source_options`.
        grasps: the grasps; their provenance names the objects if no option does.
        path: path of the file, for messages.

    Raises:
        InvalidInputError: neither the options nor the file name the objects, or the grasps are far
            from their objects.
        UnknownNameError: there is no such scene or library, or it lacks an object of the grasps.
    """
    named = [arguments.scene, arguments.library]
    named += [grasps.provenance.get(key) for key in ("scene", "library")]
    reference = next((name for name in named if name), None)
    if reference is None:
        raise core.InvalidInputError(
            f"{path} does not say where its objects are; give --scene or --library"
        )
    from_file = reference not in (arguments.scene, arguments.library)
    try:
        if from_file and not core.is_resolved(str(reference), "scenes", "models"):
            raise core.UnknownNameError(str(reference))
        source = open_grasp_source(str(reference))
    except core.UnknownNameError as error:
        if not from_file:
            raise
        raise core.UnknownNameError(
            f"{path} says that its objects are in {reference}, which is not there; give --scene or"
            " --library"
        ) from error
    for name in sorted(set(grasps.object.tolist())):
        if name not in source.library.objects:
            raise core.UnknownNameError(
                f"{path} has grasps of object {name!r}, which is not in library"
                f" {source.library.root}; {core.suggest_names(name, source.library.objects)}"
            )
    evaluation.require_near(grasps, source.library, path)
    return source


@dataclass(frozen=True, eq=False)
class GraspOutput:
    """Path and format of an output, checked before there are grasps.

    Attributes:
        path: file or folder.
        format: format of the file, or of each file in the folder.
        is_folder: whether `path` is a folder.
    """

    path: Path
    format: formats.GraspFormat
    is_folder: bool

    def require_fits(self, objects: Collection[str]) -> None:
        """Refuses grasps of several objects for a file format with one object per file.

        Raises:
            InvalidInputError: there are several objects.
        """
        names = sorted(set(objects))
        if self.format.one_object and not self.is_folder and len(names) > 1:
            raise core.InvalidInputError(
                f"a file of {self.format.title} holds grasps of one object, and these are of"
                f" {len(names)} ({core.list_names(names)}); choose one, or give a folder for a file"
                f" per object: {self.path.with_suffix('')}/"
            )

    def write(self, grasps: core.GraspSet, gripper: formats.Gripper) -> None:
        """Writes the grasps; prints what was written, and what the format cannot store."""
        as_format = "" if self.format.name == "burg_drake" else f" as {format_title(self.format)}"
        message = f"wrote {len(grasps)} grasps to {self.path}{as_format}"
        if not self.is_folder:
            notes = self.format.write(grasps, self.path, gripper)
            print(message)
            print_notes(notes)
            return
        written = formats.write_each_object(grasps, self.path, self.format, gripper)
        print(message)
        print(f"  {core.list_names([path.name for path in written])}")
        for note in dict.fromkeys(note for notes in written.values() for note in notes):
            files = [path.name for path, notes in written.items() if note in notes]
            where = f"{core.list_names(files)}: " if len(files) < len(written) else ""
            print_notes([f"{where}{note}"])


def add_format_option(parser: Parser, default: str = "by the suffix") -> None:
    """Adds the option --to; the help names the default."""
    parser.add_argument(
        "--to", dest="target", metavar="FORMAT", help=f"format to write (default: {default})"
    )


def grasp_output(path: str, target: str | None, *, frame: str | None = None) -> GraspOutput:
    """Path and format of an output, checked as far as possible without grasps.

    Args:
        path: a file or a folder; a folder exists, or its name ends in `/` or has no suffix.
        target: name of the format; None to take it from the suffix.
        frame: frame of the grasps, if it cannot be changed.

    Raises:
        InvalidInputError: the path cannot be written, the format is unknown, or it needs another
            frame.
        UnknownNameError: there is no such format.
    """
    out = Path(path)
    is_folder = out.is_dir() or path.endswith("/") or not out.suffix
    if is_folder and target is None:
        raise core.InvalidInputError(f"{out} is a folder; say in which format to write (--to)")
    try:
        format = formats.format_named(target) if target else formats.format_by_suffix(out)
    except core.InvalidInputError as error:
        raise core.InvalidInputError(f"{error} (--to)") from error
    if frame is not None and format.frame != frame:
        raise core.InvalidInputError(
            f"files of {format.title} have grasps in the {format.frame} frame; write burg_drake's"
            " own format (--to burg_drake), then convert it with `burg-drake grasps convert`"
        )
    core.require_writable(out / "grasps" if is_folder else out)
    return GraspOutput(out, format, is_folder)


def format_title(format: formats.GraspFormat) -> str:
    """Name and title of a format."""
    return format.name if format.title == format.name else f"{format.name} ({format.title})"


def print_notes(notes: Sequence[str]) -> None:
    """Prints notes about the line above."""
    for note in notes:
        print(f"  {note}")
