"""`burg-drake scene`: show and validate scenes."""

from __future__ import annotations

import argparse
import sys
from typing import Any

from burg_drake.apps.arguments import add_group, add_scene, add_station, add_verb, add_view


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "scene", "show and validate scenes")
    show = add_verb(
        group,
        "show",
        run_show,
        "show a scene on its station in Meshcat",
        "burg-drake scene show tabletop_six",
        "burg-drake scene show my_scene.yaml --station my_station.yaml",
        "burg-drake scene show tabletop_six --html scene.html",
    )
    add_scene(show)
    add_station(show)
    show.add_argument("--no-robot", action="store_true", help="leave the arm out")
    add_view(show)
    validate = add_verb(
        group,
        "validate",
        run_validate,
        "check a scene: bounds of the board, ground, overlaps (exit code 1 if anything is wrong)",
        "burg-drake scene validate my_scene.yaml",
    )
    add_scene(validate)
    add_station(validate)


def run_show(arguments: argparse.Namespace) -> int:
    """Shows a scene, however faulty; what is wrong goes to stderr."""
    from burg_drake.apps.live import open_view, present
    from burg_drake.scene.scene import load_scene
    from burg_drake.station.check import check_scene
    from burg_drake.station.station import load_station
    from burg_drake.visualization.scene_view import show_scene

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
    from burg_drake.scene.scene import load_scene
    from burg_drake.station.check import check_scene
    from burg_drake.station.station import load_station

    scene = load_scene(arguments.scene)
    station = load_station(arguments.station)
    issues = check_scene(scene, station)
    for issue in issues:
        print(f"{'error' if issue.is_error else 'warning'}: {issue.message}")
    if not issues:
        print(
            f"{scene.path}: {len(scene.instances)} objects stand free and in bounds"
            f" on station {station.name}"
        )
    return 1 if any(issue.is_error for issue in issues) else 0
