"""The command `burg-drake`: the table of its commands, the parser, exit codes and error messages.

Exit codes: 0 success; 1 finished, with failures to report; 2 the input cannot be used; 130
interrupted by Ctrl-C. Only the module of the given command is imported.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import select
import shlex
import signal
import sys
from collections.abc import Sequence
from functools import cache, partial
from typing import NamedTuple

from burg_drake import __version__
from burg_drake.apps.options.arguments import CommandGroup, Parser, examples_text
from burg_drake.apps.options.values import restore_pipe_names
from burg_drake.apps.terminal import sigterm_as_interrupt
from burg_drake.core import BurgError, shorten_text

DEBUG_VARIABLE = "BURG_DEBUG"
OPTION_DESTINATIONS = {
    "X_SF": ("camera_pose",),
    "objects": ("grasps_object", "rename"),
    "format": ("grasps_format", "source"),
    "frame": ("grasps_frame", "frame"),
    "hand": ("hand", "station"),
    "moved": ("run",),
    "out": ("output",),
    "folder": ("output",),
}
"""Names in the parsed arguments of library parameters that have other names there."""


class Verb(NamedTuple):
    """A command, or a group of commands, as the help lists it.

    `burg-drake grasps sample` has the functions `add_grasps_sample_options` and `run_grasps_sample`
    in its module.
    """

    words: str
    module: str | None
    """Module of `burg_drake.apps.commands`; None for a group."""
    summary: str


COMMANDS = {
    "start": (
        Verb("demo", "demo", "evaluate grasps on a built-in scene and replay the best one"),
        Verb("doctor", "doctor", "show what is installed, what is missing, and how to get it"),
        Verb("completion", "completion", "print the script by which your shell completes commands"),
    ),
    "objects and scenes": (
        Verb("library", None, "make objects from meshes; check and show them"),
        Verb("library build", "library", "make objects for simulation from meshes"),
        Verb("library add", "library", "add one object, or build it again"),
        Verb("library import-burg", "library", "build a library from BURG-Toolkit's"),
        Verb("library import-ycb", "library", "build a library from a download of the YCB objects"),
        Verb("library list", "library", "list the objects of a library"),
        Verb("library check", "library", "look for mistakes in a library"),
        Verb(
            "library show", "library", "show objects in 3D: pieces, contact surfaces, stable poses"
        ),
        Verb("scene", None, "show, check, settle, sample, export, import scenes"),
        Verb("scene show", "scene", "show a scene in 3D, on its station"),
        Verb("scene validate", "scene", "check a scene: off the board, in the air, overlaps"),
        Verb("scene settle", "scene", "let objects fall and come to rest; write the new scene"),
        Verb("scene sample", "scene_sampling", "make random scenes from the objects of a library"),
        Verb("scene export", "scene", "write a scene for Gazebo, Drake, MuJoCo or Isaac Sim"),
        Verb("scene import-burg", "scene", "import a scene of BURG-Toolkit"),
        Verb("setup", "setup", "arrange a scene in the browser: place, check, save, print"),
    ),
    "grasps": (
        Verb("grasps", None, "sample, score, label, show, convert and compare grasps"),
        Verb("grasps sample", "grasp_sampling", "sample antipodal grasps on objects"),
        Verb(
            "grasps score",
            "grasp_sampling",
            "score grasps by formulas: force closure, epsilon, load",
        ),
        Verb("grasps label", "grasp_labelling", "label grasps of objects: held or lost when tried"),
        Verb("grasps show", "grasp_display", "show grasps in 3D, coloured by outcome or score"),
        Verb("grasps convert", "grasp_formats", "convert grasps between formats"),
        Verb(
            "grasps stats",
            "grasp_stats",
            "print statistics of a set of grasps, or compare two sets",
        ),
        Verb("frames", "grasp_formats", "show frames and the grasp frames of other projects"),
    ),
    "evaluate": (
        Verb("reach", "reach", "find which grasps the arm can reach, and what stops it"),
        Verb("evaluate", "evaluate", "evaluate grasps: clear hand, reach of the arm, lift"),
        Verb("status", "runs", "print the progress of a run"),
        Verb("report", "runs", "print what a run found so far; write its report again"),
        Verb("replay", "replay", "simulate one grasp again and show it in 3D"),
        Verb("robustness", "robustness", "test lifted grasps: tug, shake, friction, noise"),
        Verb("merge", "runs", "join the shards of a run"),
    ),
    "real robot": (
        Verb("printout", "printout", "write the board of a scene as PDF, to print at true scale"),
        Verb("camera", None, "find, calibrate and locate cameras; measure photos"),
        Verb("camera list", "camera", "list the cameras of this machine that give images"),
        Verb("camera target", "printout", "write a calibration board (ChArUco) as PDF"),
        Verb("camera calibrate", "camera", "find the intrinsics of a camera, from photos or live"),
        Verb("camera show", "camera", "print intrinsics, field of view and distortion"),
        Verb("camera convert", "camera", "convert intrinsics to or from ROS and OpenCV"),
        Verb(
            "camera locate",
            "camera_placement",
            "find the pose of a fixed camera from photos of the board",
        ),
        Verb(
            "camera placement",
            "camera_placement",
            "measure on a photo how far objects stand from their targets",
        ),
        Verb("ar", "ar", "show where objects belong, live in the camera picture"),
        Verb("ros", "ros", "run a ROS node: overlay, camera pose, board on tf"),
        Verb("trials", None, "plan, export and record trials on your robot"),
        Verb(
            "trials plan", "trial_preparation", "choose grasps to try on the robot, in random order"
        ),
        Verb(
            "trials sheet",
            "trial_preparation",
            "write a paper form: order, pictures, boxes to tick",
        ),
        Verb(
            "trials export", "trial_preparation", "write the robot motion of each trial to a file"
        ),
        Verb(
            "trials serve", "trial_page", "serve a page for the lab: next trial, picture, buttons"
        ),
        Verb("trials record", "trial_records", "record the outcome of a trial"),
        Verb("trials show", "trial_records", "print the progress of the trials"),
        Verb("trials restore", "trial_records", "restore recorded outcomes that the file has lost"),
        Verb("compare", "compare", "compare a run with trials on the robot, or another run"),
        Verb("gap", "gap", "find what costs grasps: reach, the arm, misplaced objects"),
    ),
    "training data": (
        Verb("render", "render", "render what a camera of the station sees"),
        Verb("dataset", None, "make training data: images, labels, grasps"),
        Verb("dataset generate", "dataset", "render images with labels of many scenes"),
        Verb("dataset check", "dataset", "look for damaged files and wrong depth or labels"),
        Verb("dataset show", "dataset", "show a sample in 3D, or many on a sheet"),
        Verb("dataset export", "dataset", "convert to BOP, COCO, GraspNet or WebDataset"),
    ),
    "benchmark": (
        Verb("benchmark", None, "compare grasp planners on suites of scenes"),
        Verb("benchmark list", "benchmark", "list the built-in suites"),
        Verb("benchmark show", "benchmark", "print a suite; write its scenes and boards"),
        Verb("benchmark run", "benchmark", "ask a planner about each scene, and judge its grasps"),
        Verb("benchmark trials", "benchmark", "plan trials of the best grasps on your robot"),
        Verb("benchmark compare", "benchmark", "compare planners; write a leaderboard"),
        Verb("benchmark table", "benchmark", "print the tables of results, also as Markdown"),
        Verb("benchmark verify", "benchmark", "judge a sample of a result again, to the bit"),
        Verb("benchmark new", "benchmark", "make a suite of your own scenes or sampled ones"),
        Verb("planner", None, "list, check and serve grasp planners"),
        Verb("planner list", "planner", "list the built-in planners, and how to name your own"),
        Verb("planner check", "planner", "find frame mistakes in the answers of a planner"),
        Verb("planner serve", "planner", "serve a planner to other programs over a websocket"),
    ),
    "robot cells, files": (
        Verb("station", None, "list, check and show robot cells: arm, board, cameras"),
        Verb("station list", "station", "list the built-in stations"),
        Verb("station check", "station", "check a station: base, home, reach, cameras"),
        Verb("station show", "station", "show a station in 3D with the reach of its arm"),
        Verb("hand", None, "list and check hands"),
        Verb("hand list", "station", "list the built-in hands"),
        Verb("hand check", "station", "check a hand file against its model"),
        Verb("schema", "schema", "list kinds of YAML files; write their JSON Schemas"),
    ),
}
"""All commands by heading of the help, in the order of use."""


@cache
def build_parser() -> Parser:
    """The parser of the whole command, built once per process."""
    parser = Parser(
        prog="burg-drake",
        description="Find out which grasps a robot can execute: in simulation, on a printed board,"
        " on your robot.",
        epilog=examples_text(
            "burg-drake demo",
            "burg-drake library build scans/*.obj -o my_library",
            "burg-drake setup my_library",
            "burg-drake evaluate my_scene.yaml -o runs/first",
            "",
            "burg-drake VERB --help tells what a verb does. Set"
            f" {DEBUG_VARIABLE}=1 to see where an error came from.",
        ),
    )
    parser.add_argument(
        "--version", action="version", version=f"burg-drake {__version__}", help="print the version"
    )
    groups = {"": CommandGroup(parser)}
    for title, commands in COMMANDS.items():
        groups[""].begin_heading(title)
        for command in commands:
            group, _, name = command.words.rpartition(" ")
            command_parser = groups[group].add_parser(name, command.summary)
            if command.module is None:
                groups[command.words] = CommandGroup(command_parser)
            else:
                command_parser.defer_options(partial(_add_options, command))
    return parser


def _add_options(command: Verb, parser: Parser) -> None:
    """Imports the module of a command, and adds the options of the command to its parser."""
    module = importlib.import_module(f"burg_drake.apps.commands.{command.module}")
    name = command.words.replace(" ", "_").replace("-", "_")
    getattr(module, f"add_{name}_options")(parser)
    parser.set_defaults(run=getattr(module, f"run_{name}"))


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a command line and returns its exit code.

    Args:
        argv: arguments without the program's name; those of the process if None.
    """
    input_error_code = 2
    interrupted_code = 130
    if argv is None:
        if "_ARGCOMPLETE" in os.environ:
            from burg_drake.apps.commands.completion import complete_line

            complete_line(build_parser())
        if isinstance(sys.stdout, io.TextIOWrapper):  # the terminal may lack some characters
            sys.stdout.reconfigure(errors="backslashreplace")
    # pyarrow's own allocator returns memory so often that it takes longer than the reading
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    words = sys.argv[1:] if argv is None else argv
    arguments = build_parser().parse_args(words)
    arguments.command_line = shlex.join(["burg-drake", *words])
    try:
        return _run_command(arguments)
    except KeyboardInterrupt:
        if argv is None:  # the process ends; ignore further Ctrl-C
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        return _print_error(
            "interrupted" + getattr(arguments, "after_interrupt", ""), interrupted_code
        )
    except (BurgError, MemoryError, ImportError) as error:
        message = _describe_error(error, arguments)
        if os.environ.get(DEBUG_VARIABLE) or message is None:
            raise
        return _print_error(f"error: {message}", input_error_code)
    except BrokenPipeError:
        if not _drop_unread_output():
            raise
        return 0


def _run_command(arguments: argparse.Namespace) -> int:
    """Runs a command. Raises `KeyboardInterrupt` in place of an exception that an interrupt has
    caused. Resumable commands treat SIGTERM, which batch systems send, as an interrupt, too."""
    is_resumable = hasattr(arguments, "after_interrupt")
    try:
        with sigterm_as_interrupt() if is_resumable else contextlib.nullcontext():
            code = int(arguments.run(arguments))
        sys.stdout.flush()
        return code
    except Exception as error:
        cause: BaseException | None = error
        while cause is not None:  # an interrupted import of a C++ module raises ImportError
            if isinstance(cause, KeyboardInterrupt):
                raise cause from None
            cause = cause.__cause__ or cause.__context__
        raise


def _describe_error(
    error: BurgError | MemoryError | ImportError, arguments: argparse.Namespace
) -> str | None:
    """The message of an error that a user can fix, with the options concerned; else None."""
    if isinstance(error, BurgError):
        names = [n for name in error.arguments for n in OPTION_DESTINATIONS.get(name, (name,))]
        flags = [arguments.flags[name] for name in names if name in arguments.flags]
        return f"{error} ({', '.join(flags)})" if flags else str(error)
    if isinstance(error, MemoryError):
        return f"there is not enough memory for this input. {error}"
    if "cannot open shared object file" not in str(error):
        return None
    from burg_drake.system_libraries import describe_missing, missing_render_libraries

    missing = missing_render_libraries()
    return describe_missing(missing) if missing else str(error)


def _print_error(message: str, code: int) -> int:
    """Prints an error message in one line of printable text; returns the exit code."""
    max_word_length = 300  # Characters. Longer words, such as paths, are shortened.
    _drop_unread_output()
    sys.stdout.flush()
    words = " ".join(
        shorten_text(word, max_word_length) for word in restore_pipe_names(message).split()
    )
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in words)
    print(f"burg-drake: {line}", file=sys.stderr)
    return code


def _drop_unread_output() -> bool:
    """Drops the output if its reader is gone, as in `burg-drake ... | head`; returns whether.

    Buffered output would otherwise raise an error when Python ends.
    """
    try:
        output = sys.stdout.fileno()
    except OSError:  # no file, as in tests
        return False
    poll = select.poll()
    poll.register(output, 0)
    if not any(events & (select.POLLERR | select.POLLHUP) for _, events in poll.poll(0)):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    return True


if __name__ == "__main__":
    sys.exit(main())
