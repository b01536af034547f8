"""`burg-drake scene`: show, validate, settle, export and import scenes."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from burg_drake import core, simulation
from burg_drake.apps import options
from burg_drake.apps.commands.scene_sampling import require_another_file
from burg_drake.apps.terminal import print_remark, print_warning, show_progress

if TYPE_CHECKING:
    from burg_drake.scene import Scene


def add_scene_export_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake scene export`."""
    from burg_drake.export import SCENE_FORMATS

    formats = (f"  {name:5}{format.about}" for name, format in SCENE_FORMATS.items())
    parser.epilog = options.examples_text(
        "burg-drake scene export tabletop_six --to sdf -o tabletop_sdf",
        "burg-drake scene export my_scene.yaml --station my_station.yaml --to mjcf -o my_mjcf",
        "burg-drake scene export tabletop_six --station panda_tabletop --to mjcf --hand -o hand",
        "",
        "\n".join(["The folder holds all files that it needs. Formats:", *formats]),
    )
    options.add_scene(parser)
    parser.add_argument("--to", choices=SCENE_FORMATS, required=True, help="format")
    options.add_output(parser, "FOLDER", "folder to write; an earlier export is replaced")
    options.add_station(parser, "export table and obstacles of this station, too", default=None)
    parser.add_argument(
        "--hand",
        action="store_true",
        help="with --to mjcf and --station, add the hand with its actuators",
    )


def run_scene_export(arguments: argparse.Namespace) -> int:
    """Writes the folder of an export, also of a faulty scene; prints its issues to stderr."""
    from burg_drake.export import export_scene
    from burg_drake.scene import load_scene, validate_scene
    from burg_drake.station import check_scene, load_station

    scene = load_scene(arguments.scene)
    station = load_station(arguments.station) if arguments.station is not None else None
    for issue in validate_scene(scene) if station is None else check_scene(scene, station):
        print_warning(f"{scene.path}: {issue.message}")
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


def add_scene_import_burg_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake scene import-burg`."""
    parser.epilog = options.examples_text(
        "burg-drake library import-burg object_library.yaml -o my_library",
        "burg-drake scene import-burg scene.yaml --library my_library -o my_scene.yaml",
        "burg-drake scene import-burg scene.yaml --library my_library -o my_scene.yaml"
        " --station-out my_station.yaml",
        "burg-drake scene validate my_scene.yaml",
    )
    parser.add_argument("file", metavar="SCENE.yaml", help="scene file of BURG-Toolkit")
    parser.add_argument(
        "--library", metavar="LIB", required=True, help="library made by `library import-burg`"
    )
    options.add_output(parser, "FILE", "scene file to write (.yaml)")
    parser.add_argument("--name", metavar="NAME", help="name of the scene (default: that of FILE)")
    parser.add_argument(
        "--station-out", metavar="FILE", help="also write a station that the scene fits on"
    )


def run_scene_import_burg(arguments: argparse.Namespace) -> int:
    """Writes a scene document."""
    from burg_drake.formats import read_burg_scene
    from burg_drake.objects import load_library
    from burg_drake.pipeline import import_burg_scene
    from burg_drake.scene import load_scene, save_scene

    output = Path(arguments.output)
    for file in filter(None, (arguments.output, arguments.station_out)):
        core.require_writable(file)
        require_another_file(Path(arguments.file), file)
    if arguments.station_out is not None:
        require_another_file(output, arguments.station_out)
    burg = read_burg_scene(arguments.file)
    library = load_library(arguments.library)
    imported = import_burg_scene(
        burg,
        library,
        name=arguments.name or core.make_name(output.stem),
        reference=core.name_or_reference(arguments.library, "models", library.root, output.parent),
    )
    for note in (*burg.notes, *imported.notes):
        print(note)
    save_scene(imported.document, output)
    fixed = f" and {n} fixed ones" if (n := len(imported.document.background)) else ""
    print(f"wrote {output}: {len(imported.document.instances)} objects{fixed}")
    _propose_station(load_scene(output), arguments.station_out)
    return 0


def _propose_station(scene: Scene, output: str | None) -> None:
    """Prints which station fits, and writes it if requested."""
    from burg_drake.motion import find_built_in, propose_station

    if output is None:
        try:
            fitting, misfits = find_built_in(scene)
        except core.InvalidInputError as error:
            print(f"no station fits: {error}")
            return
        _print_fits(fitting.name if fitting else "", misfits)
        if fitting is None:
            print("no built-in station fits; --station-out FILE lays one out around the scene")
        return
    proposal = propose_station(scene, Path(output))
    _print_fits(proposal.source, proposal.misfits)
    core.save_document(proposal.document, output)
    where = "without an arm"
    if (arm := proposal.document.arm) is not None:
        where = "the arm's base at ({:g}, {:g}, {:g}) m".format(*arm.X_WA.translation)
    width, depth, _ = proposal.document.table.size
    print(f"wrote {output}: a table of {width:g} x {depth:g} m, {where}")
    for warning in proposal.warnings:
        print_warning(f"{output}: {warning}")


def _print_fits(fitting: str, misfits: dict[str, str]) -> None:
    for name, reason in misfits.items():
        print(f"station {name} does not fit: {reason}")
    if fitting:
        print(f"station {fitting} fits: --station {fitting}")


def add_scene_show_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake scene show`."""
    parser.epilog = options.examples_text(
        "burg-drake scene show tabletop_six",
        "burg-drake scene show my_scene.yaml --station my_station.yaml",
        "burg-drake scene show tabletop_six --html scene.html",
    )
    options.add_scene(parser)
    options.add_station(parser)
    parser.add_argument("--no-robot", action="store_true", help="hide the arm")
    options.add_view_options(parser)


def add_scene_validate_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake scene validate`."""
    parser.epilog = options.examples_text("burg-drake scene validate my_scene.yaml")
    options.add_scene(parser)
    options.add_station(parser)


def add_scene_settle_options(settle: options.Parser) -> None:
    """Adds the options of `burg-drake scene settle`."""
    from burg_drake.station import DRAKE_ENGINES

    settle.epilog = options.examples_text(
        "burg-drake scene settle heap.yaml -o settled.yaml",
        "burg-drake scene settle heap.yaml --station my_station.yaml --keep -o settled.yaml",
        "",
        "Exit code 1 if an object still moves, fell off the table or came to rest where `scene"
        " validate` refuses it; the scene is then written only with --keep.",
    )
    options.add_scene(settle)
    options.add_station(settle)
    options.add_output(settle, "FILE", "scene file to write (.yaml)")
    settle.add_argument(
        "--time-limit",
        metavar="S",
        type=options.positive,
        default=simulation.SETTLING_TIME,
        help="simulated time in seconds (default: %(default)g)",
    )
    settle.add_argument(
        "--keep", action="store_true", help="write the scene anyway, without objects that fell off"
    )
    settle.add_argument(
        "--engine",
        choices=DRAKE_ENGINES,
        default=simulation.SETTLING_ENGINE,
        help="physics preset (default: %(default)s)",
    )
    options.add_quiet(settle)


def run_scene_show(arguments: argparse.Namespace) -> int:
    """Shows a scene, also a faulty one; prints its issues to stderr."""
    from burg_drake.apps.terminal import open_view, present_view
    from burg_drake.scene import load_scene
    from burg_drake.station import check_scene, load_station
    from burg_drake.visualization import show_scene

    scene = load_scene(arguments.scene)
    station = load_station(arguments.station)
    issues = check_scene(scene, station)
    for issue in issues:
        print_warning(f"{scene.path}: {issue.message}")
    meshcat = open_view(arguments)
    with_arm = station.document.arm is not None and not arguments.no_robot
    show_scene(scene, station, meshcat, robot="arm" if with_arm else "none")
    caption = [f"{len(scene.instances)} objects on station {station.name}"]
    present_view(
        meshcat, arguments, title=scene.name, caption=caption + [f"⚠ {i.message}" for i in issues]
    )
    return 0


def run_scene_validate(arguments: argparse.Namespace) -> int:
    """Prints the issues of a scene."""
    from burg_drake.scene import load_scene
    from burg_drake.station import check_scene, load_station

    scene = load_scene(arguments.scene)
    station = load_station(arguments.station)
    issues = check_scene(scene, station)
    for issue in issues:
        print(f"{'error' if issue.is_error else 'warning'}: {issue.message}")
    count = len(scene.instances)
    if not issues and count:
        objects = core.count_with_noun(count, "object")
        print(
            f"{scene.path}: no mistakes on station {station.name}: {objects}, all standing within"
            " the board, none overlapping another"
        )
    elif not issues:
        print(f"{scene.path}: no mistakes, but it has no objects")
    return 1 if any(issue.is_error for issue in issues) else 0


def run_scene_settle(arguments: argparse.Namespace) -> int:
    """Settles a scene; returns 1 if an object still moves, has fallen off, or is misplaced."""
    from burg_drake.scene import load_scene, save_scene
    from burg_drake.station import check_scene, load_station

    core.require_writable(arguments.output)
    scene = load_scene(arguments.scene)
    require_another_file(scene.path, arguments.output)
    station = load_station(arguments.station)
    limit, quiet = arguments.time_limit, arguments.quiet
    with show_progress("settling", "s at most", limit, quiet=quiet) as pace:
        settled = simulation.settle_scene(
            scene,
            station,
            engine=arguments.engine,
            time_limit=limit,
            progress=lambda time, moving: pace.step(time, note=f"{moving} moving"),
        )
    faults = _settling_faults(settled, limit, kept=arguments.keep)
    faults += [i.message for i in check_scene(settled.scene, station) if i.is_error]
    written = arguments.keep or not faults
    if written:
        path, document = Path(arguments.output), settled.scene.document
        root = settled.scene.library.root
        library = core.name_or_reference(document.library, "models", root, path.parent)
        save_scene(replace(document, library=library, origin=None), path)
    displacement_table(settled.displacements).show()
    if settled.at_rest:
        print(f"at rest after {settled.duration:.2f} s")
    if written:
        print(f"wrote {arguments.output}")
    for line in faults:
        print_remark(f"{scene.path}: {line}")
    return 1 if faults else 0


def displacement_table(displacements: Mapping[str, simulation.Displacement]) -> core.TextTable:
    """Table of the displacement of each object."""
    table = core.TextTable().names("object").numbers("moved [mm]", "turned [deg]")
    for name, moved in displacements.items():
        table.row(
            name,
            core.format_number(1e3 * moved.distance, 1),
            core.format_number(math.degrees(moved.angle), 1),
        )
    return table


def _settling_faults(
    settled: simulation.SettledScene, time_limit: float, *, kept: bool
) -> list[str]:
    """Reasons why a scene is not settled, one line each."""
    lines = []
    if settled.moving:
        moving = ", ".join(
            f"{name!r} at {v.speed * 1e3:.2f} mm/s and {math.degrees(v.turning):.2f} deg/s"
            for name, v in settled.moving.items()
        )
        in_time = settled.duration < time_limit - 1e-9
        advice = "place it differently" if in_time else "give a longer --time-limit"
        advice += "" if kept else ", or --keep"
        lines.append(f"after {settled.duration:g} s something still moves: {moving}; {advice}")
    if settled.fallen:
        lines.append(f"fell off the table: {', '.join(settled.fallen)}")
    return lines
