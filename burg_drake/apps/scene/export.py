"""`burg-drake scene export`: scenes for other programs."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from burg_drake.apps.options import Parser, add_scene, add_station, add_verb


def add_to(group: Any) -> None:
    """Adds the verb."""
    add_verb(
        group,
        "export",
        run_export,
        "write a scene for Gazebo, Drake, MuJoCo or Isaac Sim",
        "burg-drake scene export tabletop_six --to sdf -o tabletop_sdf",
        "burg-drake scene export my_scene.yaml --station my_station.yaml --to mjcf -o my_mjcf",
        "burg-drake scene export tabletop_six --station panda_tabletop --to mjcf --hand -o hand",
        "",
        "The folder holds all files that it needs. Formats:",
        options=_add_options,
    )


def _add_options(parser: Parser) -> None:
    from burg_drake.export import FORMATS

    formats = (f"  {name:5}{format.about}" for name, format in FORMATS.items())
    parser.epilog = "\n".join([str(parser.epilog), *formats])
    add_scene(parser)
    parser.add_argument("--to", choices=FORMATS, required=True, help="format")
    parser.add_argument(
        "-o",
        "--output",
        metavar="FOLDER",
        required=True,
        help="folder to write; an earlier export is replaced",
    )
    add_station(
        parser,
        "export table and obstacles of this station, too",
        default=None,
    )
    parser.add_argument(
        "--hand",
        action="store_true",
        help="with --to mjcf and --station, add the hand with its actuators",
    )


def run_export(arguments: argparse.Namespace) -> int:
    """Writes the folder of an export, however faulty the scene; what is wrong goes to stderr."""
    from burg_drake.export import export_scene
    from burg_drake.scene.document import load_scene, validate_scene
    from burg_drake.station.checks import check_scene
    from burg_drake.station.document import load_station

    scene = load_scene(arguments.scene)
    station = load_station(arguments.station) if arguments.station is not None else None
    for issue in validate_scene(scene) if station is None else check_scene(scene, station):
        print(f"burg-drake: warning: {scene.path}: {issue.message}", file=sys.stderr)
    exported = export_scene(scene, arguments.output, arguments.to, station, hand=arguments.hand)
    for note in exported.notes:
        print(note)
    fixed = len(scene.background)
    parts = [f"{len(scene.instances)} objects"]
    parts += [f"{fixed} fixed"] if fixed else []
    parts += list(exported.layout.boxes)
    parts += [station.hand.name] if station is not None and arguments.hand else []
    print(f"wrote {exported.main}: {', '.join(parts)}")
    return 0
