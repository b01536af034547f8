"""`burg-drake demo`: a first run, on a built-in scene, with its best grasp in 3D."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path
from typing import Any

from burg_drake.apps.options import (
    DEFAULT_STATION,
    Parser,
    add_quiet,
    add_verb,
    add_workers,
    positive_int,
)
from burg_drake.apps.runs import evaluate, replay

DEMO_SCENE = "tabletop_six"
DEFAULT_GRASPS = 100
DEFAULT_OUTPUT = "runs/demo"
REPLAY_FILE = "replay.html"
FILE_DESCRIPTIONS = {
    "report.html": "the report: how the grasps of each object ended",
    REPLAY_FILE: "the best grasp in 3D, as it was simulated",
    "results.csv": "the table: one row for each grasp",
}
"""What the demo leaves for people, by the names of files in the run's folder."""
NEXT_STEPS = "https://burg-drake.github.io/burg_drake/tutorials/own_object.html"


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "demo",
        run_demo,
        "evaluate grasps on a built-in scene and replay the best one",
        "burg-drake demo",
        "burg-drake demo -n 10 -o /tmp/demo --open",
        "",
        "Six objects on a table, a Panda arm. With 100 grasps an object it takes some minutes."
        " The same command continues where an interrupted one stopped.",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="RUN",
        help=f"folder to write (default: {DEFAULT_OUTPUT}, with another -n {DEFAULT_OUTPUT}_N)",
    )
    parser.add_argument(
        "-n",
        "--grasps-per-object",
        metavar="N",
        type=positive_int,
        default=DEFAULT_GRASPS,
        help="grasps to sample on each object (default: %(default)s)",
    )
    parser.add_argument("--open", action="store_true", help="open report and replay in the browser")
    add_workers(parser)
    add_quiet(parser)
    parser.set_defaults(after_interrupt="; run the same command to continue")


def run_demo(arguments: argparse.Namespace) -> int:
    """Evaluates and replays, as these verbs do; 1 if one of them has failures to report."""
    count = arguments.grasps_per_object
    ending = "" if count == DEFAULT_GRASPS else f"_{count}"
    folder = Path(arguments.output or f"{DEFAULT_OUTPUT}{ending}")
    words = [DEMO_SCENE, "--station", DEFAULT_STATION, "-n", str(count), "-o", str(folder)]
    words += ["--quiet"] * arguments.quiet
    words += [] if arguments.workers is None else ["--workers", str(arguments.workers)]
    code = evaluate.run_evaluate(_parsed(evaluate.add_options_to, words))
    print("\nThe best grasp:")
    words = [str(folder), "--best", "--html", str(folder / REPLAY_FILE)]
    code = max(code, replay.run_replay(_parsed(replay.add_options_to, words)))
    print("\nFiles to open:")
    paths = {
        folder / name: what for name, what in FILE_DESCRIPTIONS.items() if (folder / name).exists()
    }
    width = max(len(str(path)) for path in paths)
    for path, what in paths.items():
        print(f"  {path!s:<{width}}  {what}")
    print(f"\nNext, grasps on your own object: {NEXT_STEPS}")
    for path in paths:
        if arguments.open and path.suffix == ".html":
            webbrowser.open(path.resolve().as_uri())
    return code


def _parsed(options: Any, words: list[str]) -> argparse.Namespace:
    """What a verb makes of the words of its command."""
    parser = Parser(prog="burg-drake demo")
    options(parser)
    found: argparse.Namespace = parser.parse_args(words)
    return found
