"""Options of a recipe of scenes, for commands that sample them."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from burg_drake import core
from burg_drake.apps.options.arguments import add_station, add_workers
from burg_drake.apps.options.settings_options import add_settings_options, settings_from
from burg_drake.apps.options.values import names, positive_int

if TYPE_CHECKING:
    from burg_drake.objects import ObjectLibrary
    from burg_drake.scene import SceneRecipe
    from burg_drake.station import Station


def add_recipe_options(parser: Any, *, with_count: bool = True) -> None:
    """Adds the options of a recipe.

    Args:
        parser: parser that gets the options.
        with_count: whether an option gives the number of scenes.
    """
    _add_object_options(parser, with_count=with_count)
    _add_layout_options(parser)
    _add_rule_options(parser)


def _add_object_options(parser: Any, *, with_count: bool) -> None:
    from burg_drake.scene import SceneRecipe

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
    add_settings_options(group, SceneRecipe, "repeat", "poses", "seed")
    if with_count:
        group.add_argument(
            "--count",
            metavar="N",
            type=positive_int,
            default=1,
            help="number of scenes (default: %(default)d)",
        )
    add_workers(group, "worker processes (default: %(default)d)", default=1)


def _add_layout_options(parser: Any) -> None:
    other_layouts = ("random", "packed", "heap")  # Layouts with an option of their own.
    from burg_drake.scene import LAYOUT_NAMES, SceneRecipe

    group = parser.add_argument_group("layout")
    group.add_argument(
        "--size",
        metavar="SIZE",
        default="A2",
        help="size of the board: A4 to A0, or WxH in mm (default: %(default)s)",
    )
    group.add_argument("--portrait", action="store_true", help="board in portrait format")
    layout_group = group.add_mutually_exclusive_group()
    layout_group.add_argument(
        "--spacing",
        choices=[name for name in LAYOUT_NAMES if name not in other_layouts],
        help="space between objects: 40 mm, 2 to 10 mm, or contact (default: random)",
    )
    layout_group.add_argument("--packed", action="store_true", help="pack objects side by side")
    layout_group.add_argument("--heap", action="store_true", help="drop objects in a heap")
    add_settings_options(group, SceneRecipe, "tries", "fewer", "settle")


def _add_rule_options(parser: Any) -> None:
    from burg_drake.scene import SceneRecipe

    group = parser.add_argument_group("rules")
    add_station(group)
    add_settings_options(group, SceneRecipe, "within_reach")
    add_settings_options(group, SceneRecipe, "clear_grasps", "visible_from", unset=True)
    add_settings_options(group, SceneRecipe, "attempts")


def recipe_from_options(
    arguments: argparse.Namespace, library: ObjectLibrary, station: Station, folder: Path
) -> SceneRecipe:
    """The recipe from options, with references relative to a folder."""
    max_objects = 1000
    from burg_drake.scene import Board, SceneRecipe

    if arguments.objects > max_objects:
        raise core.InvalidInputError(
            f"-n {arguments.objects}: a scene has {max_objects} objects at most"
        )
    layout: Any = "packed" if arguments.packed else "heap" if arguments.heap else arguments.spacing
    return settings_from(
        arguments,
        SceneRecipe,
        library=core.name_or_reference(arguments.library, "models", library.root, folder),
        count=arguments.objects,
        only=tuple(sorted(set(arguments.only or ()))),
        board=Board(size=board_extents(arguments.size, upright=arguments.portrait)),
        layout=layout or "random",
        station=core.name_or_reference(arguments.station, "stations", station.path, folder),
    )


def board_extents(size: str, *, upright: bool) -> tuple[float, float]:
    """Extents of a board along x and y [m]: A4 to A0, landscape unless upright, or WxH in mm.

    Raises:
        UnknownNameError: there is no such size.
    """
    from burg_drake.compose import BOARD_SIZES, board_size

    own = re.fullmatch(r"(\d+(?:\.\d+)?)\s*[x×]\s*(\d+(?:\.\d+)?)(?:\s*mm)?", size.lower())
    if own:
        return float(own[1]) * 1e-3, float(own[2]) * 1e-3
    if size.upper() not in BOARD_SIZES:
        known = core.suggest_names(size, BOARD_SIZES)
        raise core.UnknownNameError(
            f"board size {size!r} does not exist; {known}; or give WxH in mm, such as 700x500"
        )
    return board_size(size.upper(), upright=upright)
