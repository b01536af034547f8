"""`burg-drake station` and `burg-drake hand`: list and check stations and hands; show a station."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from burg_drake import core, motion
from burg_drake.apps import options
from burg_drake.apps.terminal import print_warning

if TYPE_CHECKING:
    from burg_drake.scene import Scene
    from burg_drake.station import Station


def add_station_list_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake station list`."""
    parser.epilog = options.examples_text("burg-drake station list")


def add_station_check_options(check: options.Parser) -> None:
    """Adds the options of `burg-drake station check`."""
    check.epilog = options.examples_text(
        "burg-drake station check panda_bin",
        "burg-drake station check my_station.yaml --scene my_scene.yaml",
    )
    _add_station_argument(check)


def add_station_show_options(show: options.Parser) -> None:
    """Adds the options of `burg-drake station show`."""
    show.epilog = options.examples_text(
        "burg-drake station show panda_shelf",
        "burg-drake station show panda_tabletop --scene tabletop_six --html station.html",
        "burg-drake station show my_station.yaml --camera board",
    )
    _add_station_argument(show)
    show.add_argument("--camera", metavar="NAME", help="look through this camera")
    options.add_view_options(show)


def _add_station_argument(parser: options.Parser) -> None:
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


def run_station_list(arguments: argparse.Namespace) -> int:
    """Prints name and description of each built-in station."""
    from burg_drake.station import load_station

    table = core.TextTable().texts("station", "description")
    for station in map(load_station, core.builtin_names("stations")):
        table.row(station.name, station.document.description)
    table.show()
    return 0


def run_station_check(arguments: argparse.Namespace) -> int:
    """Prints the properties of a station; raises an error if it cannot be used."""
    station, scene, report = _inspect_station(arguments)
    print(f"{station.name}: {station.path} can be used")
    table = core.TextTable().texts("", "")
    for name, text in _station_lines(station, scene, report):
        table.row(name, text)
    table.show()
    for warning in report.warnings:
        print_warning(f"{station.path}: {warning}")
    return 0


def run_station_show(arguments: argparse.Namespace) -> int:
    """Shows a station; prints notes for its author to stderr."""
    from burg_drake.apps.terminal import open_view, present_view
    from burg_drake.visualization import show_station

    meshcat = open_view(arguments)
    station, scene, report = _inspect_station(arguments)
    for warning in report.warnings:
        print_warning(f"{station.path}: {warning}")
    arm = report.arm
    legend = show_station(
        scene or motion.empty_scene(),
        station,
        meshcat,
        reachability=arm.reachability if arm else None,
        span=arm.span if arm else None,
        camera=arguments.camera,
    )
    what = f"{len(scene.instances)} objects of {scene.name}" if scene else "empty board"
    caption = [station.document.description, what, *(f"⚠ {w}" for w in report.warnings)]
    present_view(
        meshcat, arguments, title=station.name, caption=[c for c in caption if c], legend=legend
    )
    return 0


def _inspect_station(
    arguments: argparse.Namespace,
) -> tuple[Station, Scene | None, motion.StationReport]:
    from burg_drake.scene import load_scene
    from burg_drake.station import load_station

    station = load_station(arguments.station)
    if getattr(arguments, "camera", None) is not None:
        station.camera(arguments.camera)  # checks the name before steps that take time
    scene = None if arguments.scene is None else load_scene(arguments.scene)
    return station, scene, motion.inspect_station(station, scene)


def _station_lines(
    station: Station, scene: Scene | None, report: motion.StationReport
) -> list[tuple[str, str]]:
    """The printed lines about a station, with their names."""
    from burg_drake.evaluation import motion_text

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
        lines.append((f"camera {name}", f"{size}, sees {motion.format_share(share)} of the board"))
    return lines


def _arm_lines(station: Station, arm: motion.ArmFigures) -> list[tuple[str, str]]:
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


def _board_lines(
    scene: Scene | None, reach: motion.ReachabilityMap | None
) -> list[tuple[str, str]]:
    from burg_drake.scene import Board

    width, height = (1e3 * extent for extent in (scene.board if scene else Board()).size)
    content = f"{len(scene.instances)} objects of {scene.name}" if scene else "empty"
    lines = [("board", f"{width:g} x {height:g} mm, {content}")]
    if reach is None:
        return lines
    for k, z in enumerate(reach.heights):
        text = (
            f"{motion.format_share(reach.covered_from_above[k])} reached from straight above,"
            f" {motion.format_share(reach.covered[k])} with any orientation,"
            f" {motion.format_share(reach.share[k].mean())} of all orientations"
        )
        lines.append((f"  {100 * z:g} cm above", text))
    return lines


def add_hand_list_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake hand list`."""
    parser.epilog = options.examples_text("burg-drake hand list")


def add_hand_check_options(check: options.Parser) -> None:
    """Adds the options of `burg-drake hand check`."""
    check.epilog = options.examples_text(
        "burg-drake hand check wsg_50", "burg-drake hand check my_hand.yaml"
    )
    check.add_argument(
        "hand", metavar="HAND", help="hand file, or built-in name (burg-drake hand list)"
    )


def run_hand_list(arguments: argparse.Namespace) -> int:
    """Prints name and description of each built-in hand."""
    from burg_drake.station import load_hand

    table = core.TextTable().texts("hand", "description")
    for hand in map(load_hand, core.builtin_names("models/hands")):
        table.row(hand.name, hand.description)
    table.show()
    return 0


def run_hand_check(arguments: argparse.Namespace) -> int:
    """Prints motion and sizes of a hand; raises an error if its document does not fit its model."""
    from burg_drake.station import check_hand, locate_hand

    hand, model, path = locate_hand(arguments.hand)
    figures = check_hand(hand, model, path)
    low, high = (round(1e3 * width, 1) + 0.0 for width in figures.opening)
    thickness, *face = (1e3 * extent for extent in figures.pad_size)
    x, y, z = hand.X_HG.translation
    print(f"{hand.name}: the document agrees with {model}")
    print(f"  opening        {low:.1f} to {high:.1f} mm, measured between the pads")
    print(f"  pads           {face[0]:.1f} x {face[1]:.1f} mm, {thickness:.1f} mm thick")
    print(f"  grasp frame    at ({1e3 * x:g}, {1e3 * y:g}, {1e3 * z:g}) mm of {hand.body}")
    print(f"  force          {hand.force:g} N a finger")
    print(f"  closing speed  {1e3 * hand.closing_speed:g} mm/s a finger")
    print(f"  fingers        {'coupled' if hand.coupled else 'independent'}")
    return 0
