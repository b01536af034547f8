"""Options of `burg-drake scene sample` that make its recipe."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    add_options,
    add_station,
    add_workers,
    names,
    positive_int,
    settings_from,
)

if TYPE_CHECKING:
    from burg_drake.objects.library import ObjectLibrary
    from burg_drake.scene.document import SceneRecipe
    from burg_drake.station.document import Station

MOST_OBJECTS = 1000
OWN_OPTIONS = ("random", "packed", "heap")
"""Layouts that are no spacings."""


def add_recipe(parser: Any) -> None:
    """Adds them."""
    _add_objects(parser)
    _add_layout(parser)
    _add_rules(parser)


def recipe_defaults() -> dict[str, Any]:
    """Values of the options that nobody gave, by name."""
    parser = argparse.ArgumentParser(add_help=False)
    add_recipe(parser)
    return vars(parser.parse_args([]))


def written(name: str) -> str:
    """How the option of a value is written."""
    return "-n" if name == "objects" else f"--{name.replace('_', '-')}"


def _add_objects(parser: Any) -> None:
    from burg_drake.scene.document import SceneRecipe

    group = parser.add_argument_group("objects")
    group.add_argument(
        "-n",
        metavar="N",
        dest="objects",
        type=positive_int,
        default=SceneRecipe.count,
        help="objects in a scene (default: %(default)d)",
    )
    group.add_argument(
        "--only", metavar="A,B", type=names, action="extend", help="only these objects"
    )
    add_options(group, SceneRecipe, "repeat", "poses", "seed")
    group.add_argument(
        "--count",
        metavar="N",
        type=positive_int,
        default=1,
        help="number of scenes (default: %(default)d)",
    )
    add_workers(group, "worker processes (default: %(default)d)", default=1)


def _add_layout(parser: Any) -> None:
    from burg_drake.scene.document import LAYOUTS, SceneRecipe

    group = parser.add_argument_group("layout")
    group.add_argument(
        "--size",
        metavar="SIZE",
        default="A2",
        help="size of the board: A4 to A0, or WxH in mm (default: %(default)s)",
    )
    group.add_argument("--portrait", action="store_true", help="board in portrait format")
    how = group.add_mutually_exclusive_group()
    how.add_argument(
        "--spacing",
        choices=[name for name in LAYOUTS if name not in OWN_OPTIONS],
        help="space between objects: 40 mm, 2 to 10 mm, or contact (default: random)",
    )
    how.add_argument("--packed", action="store_true", help="pack objects side by side")
    how.add_argument("--heap", action="store_true", help="drop objects in a heap")
    add_options(group, SceneRecipe, "tries", "fewer", "settle")


def _add_rules(parser: Any) -> None:
    from burg_drake.scene.document import SceneRecipe

    group = parser.add_argument_group("rules")
    add_station(group)
    add_options(group, SceneRecipe, "within_reach")
    add_options(group, SceneRecipe, "clear_grasps", "visible_from", unset=True)
    add_options(group, SceneRecipe, "attempts")


def recipe_of(
    arguments: argparse.Namespace, library: ObjectLibrary, station: Station, folder: Path
) -> SceneRecipe:
    """The recipe that the options ask for, with references that start from a folder."""
    from burg_drake.apps.scene.references import library_reference, station_reference
    from burg_drake.core import InvalidInputError
    from burg_drake.scene.document import Board, SceneRecipe

    if arguments.objects > MOST_OBJECTS:
        raise InvalidInputError(
            f"-n {arguments.objects}: a scene has {MOST_OBJECTS} objects at most"
        )
    layout: Any = "packed" if arguments.packed else "heap" if arguments.heap else arguments.spacing
    return settings_from(
        arguments,
        SceneRecipe,
        library=library_reference(arguments.library, library, folder),
        count=arguments.objects,
        only=tuple(sorted(set(arguments.only or ()))),
        board=Board(size=board_extents(arguments.size, upright=arguments.portrait)),
        layout=layout or "random",
        station=station_reference(arguments.station, station, folder),
    )


def board_extents(size: str, *, upright: bool) -> tuple[float, float]:
    """Extents along x and y of a board [m]: A4 to A0, across unless upright, or WxH in mm.

    Raises:
        UnknownNameError: there is no such size.
    """
    from burg_drake.compose.commands import BOARD_SIZES, board_size
    from burg_drake.core import UnknownNameError, nearest

    own = re.fullmatch(r"(\d+(?:\.\d+)?)\s*[x×]\s*(\d+(?:\.\d+)?)(?:\s*mm)?", size.lower())
    if own:
        return float(own[1]) * 1e-3, float(own[2]) * 1e-3
    if size.upper() not in BOARD_SIZES:
        raise UnknownNameError(
            f"board size {size!r} does not exist; {nearest(size, BOARD_SIZES)}; or give WxH in mm,"
            " such as 700x500"
        )
    return board_size(size.upper(), upright=upright)
