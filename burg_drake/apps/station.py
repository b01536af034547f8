"""`burg-drake station`: lists stations, checks one, shows one with its workspace."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING, Any

from burg_drake.apps.options import Parser, add_group, add_verb, add_view
from burg_drake.core.terminal import TextTable

if TYPE_CHECKING:
    from burg_drake.motion.workspace import ArmFigures, ReachabilityMap, StationReport
    from burg_drake.scene.document import Scene
    from burg_drake.station.document import Station


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "station", "list, check and show robot cells: arm, board, cameras")
    add_verb(group, "list", run_list, "list the built-in stations", "burg-drake station list")
    check = add_verb(
        group,
        "check",
        run_check,
        "check a station: base, home, reach, cameras",
        "burg-drake station check panda_bin",
        "burg-drake station check my_station.yaml --scene my_scene.yaml",
    )
    _add_station(check)
    show = add_verb(
        group,
        "show",
        run_show,
        "show a station in 3D with the reach of its arm",
        "burg-drake station show panda_shelf",
        "burg-drake station show panda_tabletop --scene tabletop_six --html station.html",
        "burg-drake station show my_station.yaml --camera board",
    )
    _add_station(show)
    show.add_argument("--camera", metavar="NAME", help="look through this camera")
    add_view(show)


def _add_station(parser: Parser) -> None:
    parser.add_argument(
        "station",
        metavar="STATION",
        help="station file, or built-in name (burg-drake station list)",
    )
    parser.add_argument(
        "--scene",
        metavar="SCENE",
        help="scene to put on it, file or built-in name (default: an empty board)",
    )


def run_list(arguments: argparse.Namespace) -> int:
    """Prints name and description of each built-in station."""
    from burg_drake.core.paths import builtin_names
    from burg_drake.station.document import load_station

    stations = [load_station(name) for name in builtin_names("stations")]
    table = TextTable().texts("station", "description")
    for station in stations:
        table.row(station.name, station.document.description)
    table.show()
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Prints what a station can do; what makes it useless is an error."""
    station, scene, report = _inspect(arguments)
    print(f"{station.name}: {station.path} can be used")
    table = TextTable().texts("", "")
    for name, text in _lines(station, scene, report):
        table.row(name, text)
    table.show()
    for warning in report.warnings:
        print(f"burg-drake: warning: {station.path}: {warning}", file=sys.stderr)
    return 0


def run_show(arguments: argparse.Namespace) -> int:
    """Shows a station; what its author should know goes to stderr."""
    from burg_drake.apps.terminal import open_view, present
    from burg_drake.motion.workspace import empty_scene
    from burg_drake.visualization.scenes import show_station

    meshcat = open_view(arguments)
    station, scene, report = _inspect(arguments)
    for warning in report.warnings:
        print(f"burg-drake: warning: {station.path}: {warning}", file=sys.stderr)
    arm = report.arm
    legend = show_station(
        scene or empty_scene(),
        station,
        meshcat,
        reachability=arm.reachability if arm else None,
        span=arm.span if arm else None,
        camera=arguments.camera,
    )
    what = f"{len(scene.instances)} objects of {scene.name}" if scene else "empty board"
    caption = [station.document.description, what, *(f"⚠ {w}" for w in report.warnings)]
    present(
        meshcat, arguments, title=station.name, caption=[c for c in caption if c], legend=legend
    )
    return 0


def _inspect(arguments: argparse.Namespace) -> tuple[Station, Scene | None, StationReport]:
    from burg_drake.motion.workspace import inspect_station
    from burg_drake.scene.document import load_scene
    from burg_drake.station.document import load_station

    station = load_station(arguments.station)
    if getattr(arguments, "camera", None) is not None:
        station.camera(arguments.camera)  # before all that takes time
    scene = None if arguments.scene is None else load_scene(arguments.scene)
    return station, scene, inspect_station(station, scene)


def _lines(station: Station, scene: Scene | None, report: StationReport) -> list[tuple[str, str]]:
    """What is printed about a station, by name."""
    from burg_drake.evaluation.records import motion_text

    low, high = (round(1e3 * width) + 0 for width in report.hand.opening)
    hand = station.hand
    lines = [("hand", f"{hand.name}, opening {low} to {high} mm, {hand.force:g} N a finger")]
    if report.arm is None:
        lines.append(("arm", "none: the hand alone"))
    else:
        lines += _arm_lines(station, report.arm)
    lines.append(("motion", motion_text(station.document.motion)))
    lines += _board_lines(scene, report.arm.reachability if report.arm else None)
    for name, share in report.seen.items():
        camera = station.document.cameras[name]
        size = f"{camera.width} x {camera.height} pixels"
        lines.append((f"camera {name}", f"{size}, sees {_percent(share)} of the board"))
    return lines


def _arm_lines(station: Station, arm: ArmFigures) -> list[tuple[str, str]]:
    document = station.document.arm
    assert document is not None and station.arm_model is not None
    x, y, z = document.X_WA.translation
    roll, pitch, yaw = document.X_WA.rpy_deg or (0.0, 0.0, 0.0)
    near = arm.clearance
    pair = f" ({near.link} to {near.other})" if near.link else ""
    lines = [
        ("arm", f"{station.arm_model.stem}, {len(arm.joints)} joints"),
        (
            "base",
            f"at ({x:g}, {y:g}, {z:g}) m in the world, turned by"
            f" ({roll:g}, {pitch:g}, {yaw:g}) degrees",
        ),
        ("reach", f"{arm.span.radius:.2f} m at most, from the shoulder to between the pads"),
        ("home clearance", f"{1e3 * near.distance:.0f} mm{pair}"),
    ]
    for name, low, q, high in zip(arm.joints, arm.lower, arm.home, arm.upper, strict=True):
        lines.append((name, f"{low:.3f} to {high:.3f} rad, at home {q:.3f}"))
    return lines


def _board_lines(scene: Scene | None, reach: ReachabilityMap | None) -> list[tuple[str, str]]:
    from burg_drake.scene.document import Board

    width, height = (1e3 * extent for extent in (scene.board if scene else Board()).size)
    content = f"{len(scene.instances)} objects of {scene.name}" if scene else "empty"
    lines = [("board", f"{width:g} x {height:g} mm, {content}")]
    if reach is None:
        return lines
    for k, z in enumerate(reach.heights):
        lines.append(
            (
                f"  {100 * z:g} cm above",
                f"{_percent(reach.covered_from_above[k])} reached from straight above,"
                f" {_percent(reach.covered[k])} with any orientation,"
                f" {_percent(reach.share[k].mean())} of all orientations",
            )
        )
    return lines


def _percent(share: float) -> str:
    from burg_drake.motion.workspace import percent

    return percent(share)
