"""Where a verb writes grasps: a file, or a folder that gets one for each object."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake.apps.options.arguments import Parser
from burg_drake.core import InvalidInputError, listing
from burg_drake.core.files import require_writable

if TYPE_CHECKING:
    from burg_drake.core.grasps import GraspSet
    from burg_drake.formats.common import GraspFormat, Gripper

OURS = "burg_drake"
"""Our own format, which need not be said."""


@dataclass(frozen=True, eq=False)
class Output:
    """A place and a format that go together, known before there are grasps.

    Attributes:
        path: file or folder.
        format: of the file, or of each file in the folder.
        is_folder: which of the two.
    """

    path: Path
    format: GraspFormat
    is_folder: bool

    def require_fits(self, objects: Collection[str]) -> None:
        """Refuses grasps of several objects for a file that can hold those of one.

        Raises:
            InvalidInputError: they do not fit.
        """
        if self.format.one_object and not self.is_folder and len(set(objects)) > 1:
            raise InvalidInputError(
                f"a file of {self.format.title} holds grasps of one object, and these are of"
                f" {len(set(objects))} ({listing(sorted(set(objects)))}); choose one, or give a"
                f" folder for a file per object: {self.path.with_suffix('')}/"
            )

    def write(self, grasps: GraspSet, gripper: Gripper) -> None:
        """Writes, and prints what was written and what the format has no place for."""
        from burg_drake.formats.common import write_each_object

        as_what = "" if self.format.name == OURS else f" as {named(self.format)}"
        said = f"wrote {len(grasps)} grasps to {self.path}{as_what}"
        if not self.is_folder:
            notes = self.format.write(grasps, self.path, gripper)
            print(said)
            print_notes(notes)
            return
        written = write_each_object(grasps, self.path, self.format, gripper)
        print(said)
        print(f"  {listing([path.name for path in written])}")
        for note, paths in _by_note(written).items():
            if len(paths) < len(written):
                note = f"{listing([path.name for path in paths])}: {note}"
            print_notes([note])


def add_format(parser: Parser) -> None:
    """The option --to."""
    parser.add_argument(
        "--to", dest="target", metavar="FORMAT", help="format to write (default: by the suffix)"
    )


def output_of(path: str, target: str | None, *, frame: str | None = None) -> Output:
    """Where to write, checked as far as it can be without grasps.

    Args:
        path: file, or folder: one that is there, or a name that ends in `/` or has no suffix.
        target: name of the format; None to tell by the suffix.
        frame: what the grasps are measured in, if nothing can be done about that.

    Raises:
        InvalidInputError: the place cannot be written to, the format is not told, or it wants
            another frame.
        UnknownNameError: there is no such format.
    """
    from burg_drake.formats import FORMATS, format_by_suffix

    out = Path(path)
    is_folder = out.is_dir() or path.endswith("/") or not out.suffix
    if is_folder and target is None:
        raise InvalidInputError(f"{out} is a folder; say in which format to write (--to)")
    try:
        format = FORMATS[target] if target else format_by_suffix(out)
    except InvalidInputError as error:
        raise InvalidInputError(f"{error} (--to)") from error
    if frame is not None and format.frame != frame:
        raise InvalidInputError(
            f"{format.title} has grasps in the {format.frame} frame; write a .h5 file, then convert"
            " it with `burg-drake grasps convert`"
        )
    require_writable(out / "grasps" if is_folder else out)
    return Output(out, format, is_folder)


def named(format: GraspFormat) -> str:
    """A format's name and title."""
    return format.name if format.title == format.name else f"{format.name} ({format.title})"


def _by_note(written: Mapping[Path, Sequence[str]]) -> dict[str, list[Path]]:
    """The files that each note is about."""
    found: dict[str, list[Path]] = {}
    for path, notes in written.items():
        for note in notes:
            found.setdefault(note, []).append(path)
    return found


def print_notes(notes: Sequence[str]) -> None:
    """Prints sentences about the line above."""
    for note in notes:
        print(f"  {note}")
