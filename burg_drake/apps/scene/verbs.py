"""`burg-drake scene`: show, validate and settle; `sample`, `export` and `importing`
have the rest."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import (
    Parser,
    add_group,
    add_quiet,
    add_scene,
    add_station,
    add_verb,
    add_view,
    positive,
)
from burg_drake.apps.scene import export, importing, sample
from burg_drake.core.terminal import TextTable, format_number

if TYPE_CHECKING:
    from burg_drake.simulation.rest import Displacement
    from burg_drake.simulation.settling import SettledScene


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "scene", "show, check, settle, sample, export, import scenes")
    add_verb(
        group,
        "show",
        run_show,
        "show a scene in 3D, on its station",
        "burg-drake scene show tabletop_six",
        "burg-drake scene show my_scene.yaml --station my_station.yaml",
        "burg-drake scene show tabletop_six --html scene.html",
        options=_add_show_options,
    )
    add_verb(
        group,
        "validate",
        run_validate,
        "check a scene: off the board, in the air, overlaps",
        "burg-drake scene validate my_scene.yaml",
        options=_add_validate_options,
    )
    _add_settle(group)
    sample.add_to(group)
    export.add_to(group)
    importing.add_to(group)


def _add_show_options(parser: Parser) -> None:
    add_scene(parser)
    add_station(parser)
    parser.add_argument("--no-robot", action="store_true", help="hide the arm")
    add_view(parser)


def _add_validate_options(parser: Parser) -> None:
    add_scene(parser)
    add_station(parser)


def _add_settle(group: Any) -> None:
    add_verb(
        group,
        "settle",
        run_settle,
        "let objects fall and come to rest; write the new scene",
        "burg-drake scene settle heap.yaml -o settled.yaml",
        "burg-drake scene settle heap.yaml --station my_station.yaml --keep -o settled.yaml",
        "",
        "Exit code 1 if an object still moves, fell off the table or came to rest where `scene"
        " validate` refuses it; the scene is then written only with --keep.",
        options=_add_settle_options,
    )


def _add_settle_options(settle: Parser) -> None:
    from burg_drake.simulation.settling import SETTLING_ENGINE, SETTLING_TIME
    from burg_drake.station.document import DRAKE_ENGINES

    add_scene(settle)
    add_station(settle)
    settle.add_argument(
        "-o", "--output", metavar="FILE", required=True, help="scene file to write (.yaml)"
    )
    settle.add_argument(
        "--time-limit",
        metavar="S",
        type=positive,
        default=SETTLING_TIME,
        help="simulated time in seconds (default: %(default)g)",
    )
    settle.add_argument(
        "--keep",
        action="store_true",
        help="write the scene anyway, without objects that fell off",
    )
    settle.add_argument(
        "--engine",
        choices=DRAKE_ENGINES,
        default=SETTLING_ENGINE,
        help="physics preset (default: %(default)s)",
    )
    add_quiet(settle)


def run_show(arguments: argparse.Namespace) -> int:
    """Shows a scene, however faulty; what is wrong goes to stderr."""
    from burg_drake.apps.terminal import open_view, present
    from burg_drake.scene.document import load_scene
    from burg_drake.station.checks import check_scene
    from burg_drake.station.document import load_station
    from burg_drake.visualization.scenes import show_scene

    scene = load_scene(arguments.scene)
    station = load_station(arguments.station)
    issues = check_scene(scene, station)
    for issue in issues:
        print(f"burg-drake: warning: {scene.path}: {issue.message}", file=sys.stderr)
    meshcat = open_view(arguments)
    with_arm = station.document.arm is not None and not arguments.no_robot
    show_scene(scene, station, meshcat, robot="arm" if with_arm else "none")
    caption = [f"{len(scene.instances)} objects on station {station.name}"]
    present(
        meshcat, arguments, title=scene.name, caption=caption + [f"⚠ {i.message}" for i in issues]
    )
    return 0


def run_validate(arguments: argparse.Namespace) -> int:
    """Prints what is wrong with a scene."""
    from burg_drake.scene.document import load_scene
    from burg_drake.station.checks import check_scene
    from burg_drake.station.document import load_station

    scene = load_scene(arguments.scene)
    station = load_station(arguments.station)
    issues = check_scene(scene, station)
    for issue in issues:
        print(f"{'error' if issue.is_error else 'warning'}: {issue.message}")
    if not issues:
        count = len(scene.instances)
        objects = f"{count} object{'' if count == 1 else 's'}"
        print(
            f"{scene.path}: no mistakes on station {station.name}: {objects}, all standing within"
            " the board, none overlapping another"
            if count
            else f"{scene.path}: no mistakes, but it has no objects"
        )
    return 1 if any(issue.is_error for issue in issues) else 0


def run_settle(arguments: argparse.Namespace) -> int:
    """Settles a scene; 1 if an object still moves, is gone, or lies where it must not."""
    from burg_drake.apps.scene.references import require_another_file
    from burg_drake.core.files import require_writable
    from burg_drake.core.terminal import Progress, ProgressMeter, Reporter
    from burg_drake.scene.document import load_scene
    from burg_drake.simulation.settling import settle_scene
    from burg_drake.station.checks import check_scene
    from burg_drake.station.document import load_station

    require_writable(arguments.output)
    scene = load_scene(arguments.scene)
    require_another_file(scene.path, arguments.output)
    station = load_station(arguments.station)
    with Reporter(not arguments.quiet) as reporter:
        whole = Progress("settling", 0.0, arguments.time_limit, unit="s at most")
        pace = ProgressMeter(reporter.show, whole)
        settled = settle_scene(
            scene,
            station,
            engine=arguments.engine,
            time_limit=arguments.time_limit,
            progress=lambda time, moving: pace.step(time, note=f"{moving} moving"),
        )
    faults = _faults(settled, arguments.time_limit, kept=arguments.keep)
    faults += [i.message for i in check_scene(settled.scene, station) if i.is_error]
    written = arguments.keep or not faults
    if written:
        _write_settled(settled, arguments.output)
    displacement_table(settled.displacements).show()
    if settled.at_rest:
        print(f"at rest after {settled.duration:.2f} s")
    if written:
        print(f"wrote {arguments.output}")
    for line in faults:
        print(f"burg-drake: {scene.path}: {line}", file=sys.stderr)
    return 1 if faults else 0


def _write_settled(settled: SettledScene, output: str) -> None:
    """Writes a scene so that its library is found from there, too."""
    import dataclasses
    from pathlib import Path

    from burg_drake.apps.scene.references import library_reference
    from burg_drake.scene.document import save_scene

    path, scene = Path(output), settled.scene
    library = library_reference(scene.document.library, scene.library, path.parent)
    save_scene(dataclasses.replace(scene.document, library=library, origin=None), path)


def displacement_table(displacements: Mapping[str, Displacement]) -> TextTable:
    """How far each object has come."""
    table = TextTable().names("object").numbers("moved [mm]", "turned [deg]")
    for name, moved in displacements.items():
        table.row(
            name,
            format_number(1e3 * moved.distance, 1),
            format_number(math.degrees(moved.angle), 1),
        )
    return table


def _faults(settled: SettledScene, time_limit: float, *, kept: bool) -> list[str]:
    """What keeps a scene from being settled, a line each."""
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
