"""`burg-drake frames`: the grasp frames of other projects next to ours."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import add_hand, add_verb, add_view, named_gripper
from burg_drake.core import UnknownNameError, nearest
from burg_drake.core.terminal import TextTable

if TYPE_CHECKING:
    from burg_drake.formats.common import GraspFormat, Gripper

OURS = "burg_drake"

OUR_FRAMES = (
    ("W", "world", "z up"),
    ("S", "scene", "a corner of the board; x right and y up the sheet, z out of it"),
    ("O", "object", "that of its mesh, after scaling; not the centre of mass"),
    ("H", "hand", "the body of the hand's model that the arm carries"),
    ("G", "grasp", "midway between the pads; +z approach, +x closing direction"),
    ("P", "pregrasp", "G moved back along the approach"),
    ("A", "arm", "the arm's base"),
    ("C", "camera", "optical: z forward, x right, y down"),
)
"""Letter, name, and where it is."""


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    frames = add_verb(
        verbs,
        "frames",
        run_frames,
        "show frames and the grasp frames of other projects",
        "burg-drake frames --text",
        "burg-drake frames --html frames.html",
        "burg-drake frames acronym graspnet --hand wsg_50",
    )
    frames.add_argument(
        "names", metavar="NAME", nargs="*", help="formats of grasp files (default: all)"
    )
    add_hand(frames)
    frames.add_argument("--text", action="store_true", help="print only the tables")
    add_view(frames)


def run_frames(arguments: argparse.Namespace) -> int:
    """Prints the tables and shows the frames."""
    formats = _formats(arguments.names)
    if arguments.text:
        _print_tables(formats, named_gripper(arguments.hand))
        return 0
    from burg_drake.apps.terminal import open_view, present
    from burg_drake.station.document import locate_hand
    from burg_drake.visualization.gallery import show_frames

    gripper = named_gripper(arguments.hand)
    hand, model, _ = locate_hand(arguments.hand)
    meshcat = open_view(arguments)
    # ours is in every picture
    shown = [
        formats[name] for name in arguments.names or formats if name != OURS or arguments.names
    ]
    legend = show_frames(hand, model, gripper, shown, meshcat)
    _print_tables(formats, gripper)
    caption = [f"{hand.name}, open; x red, y green, z blue"]
    present(meshcat, arguments, title="Grasp frames", caption=caption, legend=legend)
    return 0


def _formats(names: list[str]) -> Mapping[str, GraspFormat]:
    from burg_drake.formats import FORMATS

    for name in names:
        if name not in FORMATS:
            raise UnknownNameError(f"there is no grasp format {name!r}; {nearest(name, FORMATS)}")
    return {name: FORMATS[name] for name in names or FORMATS}


def _print_tables(formats: Mapping[str, GraspFormat], gripper: Gripper) -> None:
    from burg_drake.formats.common import convention_of

    _print_table("frames of burg_drake", ("frame", "of", "where"), OUR_FRAMES)
    found = [convention_of(format, gripper) for format in formats.values()]
    _print_table(
        f"grasp frames F of files, for {gripper.name}",
        ("format", "approach", "closing", "origin of F", "poses in", "file"),
        [(c.name, c.approach, c.closing, c.origin, c.frame, " ".join(c.suffixes)) for c in found],
    )
    _print_table(
        "what files do not carry",
        ("format", "lost when written"),
        [(c.name, ", ".join(c.cannot_carry) or "-") for c in found],
    )


def _print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    table = TextTable(title).texts(*columns)
    for row in rows:
        table.row(*row)
    table.show()
