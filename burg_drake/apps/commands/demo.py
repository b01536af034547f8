"""`burg-drake demo`: a first run on a built-in scene, with its best grasp in 3D."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

from burg_drake.apps import options

DEMO_SCENE = "tabletop_six"
DEMO_FOLDER = "runs/demo"  # Default folder of the demo's run.
DEMO_FILES = {
    "report.html": "the report: how the grasps of each object ended",
    "replay.html": "the best grasp in 3D, as it was simulated",
    "results.csv": "the table: one row for each grasp",
}
"""Files that the demo lists, and their content."""


def add_demo_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake demo`."""
    parser.epilog = options.examples_text(
        "burg-drake demo",
        "burg-drake demo -n 10 -o /tmp/demo --open",
        "",
        "Six objects on a table, a Panda arm. With 100 grasps an object it takes some minutes."
        " The same command continues where an interrupted one stopped.",
    )
    options.add_output(
        parser,
        "RUN",
        f"folder to write (default: {DEMO_FOLDER}, with another -n {DEMO_FOLDER}_N)",
        required=False,
    )
    parser.add_argument(
        "-n",
        "--grasps-per-object",
        metavar="N",
        type=options.positive_int,
        default=100,
        help="grasps to sample on each object (default: %(default)s)",
    )
    parser.add_argument("--open", action="store_true", help="open report and replay in the browser")
    options.add_workers(parser)
    options.add_quiet(parser)
    parser.set_defaults(after_interrupt="; run the same command to continue")


def run_demo(arguments: argparse.Namespace) -> int:
    """Runs `evaluate` and `replay`; returns 1 if one of them has failures to report."""
    tutorial_url = "https://burg-drake.github.io/burg_drake/tutorials/own_object.html"
    count = arguments.grasps_per_object
    ending = "" if count == 100 else f"_{count}"
    folder = Path(arguments.output or f"{DEMO_FOLDER}{ending}")
    words = ["evaluate", DEMO_SCENE, "--station", options.DEFAULT_STATION, "-n", str(count)]
    words += ["-o", str(folder)]
    words += ["--quiet"] * arguments.quiet
    words += [] if arguments.workers is None else ["--workers", str(arguments.workers)]
    code = _run_words(words)
    print("\nThe best grasp:")
    words = ["replay", str(folder), "--best", "--html", str(folder / "replay.html")]
    code = max(code, _run_words(words))
    print("\nFiles to open:")
    paths = {folder / name: what for name, what in DEMO_FILES.items() if (folder / name).exists()}
    width = max(len(str(path)) for path in paths)
    for path, what in paths.items():
        print(f"  {path!s:<{width}}  {what}")
    print(f"\nNext, grasps on your own object: {tutorial_url}")
    for path in paths:
        if arguments.open and path.suffix == ".html":
            webbrowser.open(path.resolve().as_uri())
    return code


def _run_words(words: list[str]) -> int:
    """Runs a command; returns its exit code."""
    from burg_drake.apps.cli import build_parser

    arguments = build_parser().parse_args(words)
    return int(arguments.run(arguments))
