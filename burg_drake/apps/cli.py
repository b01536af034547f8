"""The command `burg-drake`: its parser, and how it ends.

Exit codes: 0 all went well; 1 finished, with failures to report; 2 the input cannot be used;
130 interrupted by Ctrl-C. Everything heavy is imported by the verbs when they run, so that
`burg-drake --help` answers in a moment.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import select
import signal
import sys
from collections.abc import Sequence
from functools import cache

from burg_drake import __version__
from burg_drake.apps import (
    ar,
    camera,
    completion,
    dataset,
    doctor,
    grasps,
    hand,
    library,
    ros,
    scene,
    schema,
    station,
    trials,
)
from burg_drake.apps.comparison import compare, gap
from burg_drake.apps.dataset import render
from burg_drake.apps.grasps import frames
from burg_drake.apps.options import Parser, VerbGroup, examples, with_given_names
from burg_drake.apps.runs import demo, evaluate, merge, reach, replay, report, robustness, status
from burg_drake.apps.scene import printout, setup
from burg_drake.apps.terminal import terminated_as_interrupted
from burg_drake.core import BurgError, shown

INPUT_ERROR = 2
INTERRUPTED = 130
DEBUG_VARIABLE = "BURG_DEBUG"
OPTIONS_OF = {
    "X_SF": ("camera_pose",),
    "objects": ("grasps_object", "rename"),
    "format": ("grasps_format", "source"),
    "frame": ("grasps_frame", "frame"),
    "hand": ("hand", "station"),
    "moved": ("run",),
    "out": ("output",),
    "folder": ("output",),
}
"""What the parsed arguments call those of the library that have another name there."""
LONGEST_WORD = 300
"""Of a message, paths included; what is longer was not written by people."""

VERBS = {
    "start": (demo, doctor, completion),
    "objects and scenes": (library, scene, setup),
    "grasps": (grasps, frames),
    "evaluate": (reach, evaluate, status, report, replay, robustness, merge),
    "real robot": (printout, camera, ar, ros, trials, compare, gap),
    "training data": (render, dataset),
    "robot cells, files": (station, hand, schema),
}
"""By what people want to do, each in the order of use."""


@cache
def build_parser() -> Parser:
    """The parser of the whole command, of which a process needs one."""
    parser = Parser(
        prog="burg-drake",
        description="Find out which grasps a robot can execute: in simulation, on a printed board,"
        " on your robot.",
        epilog=examples(
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
    verbs = VerbGroup(parser)
    for title, modules in VERBS.items():
        verbs.heading(title)
        for module in modules:
            module.add_to(verbs)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Runs a command line and returns its exit code.

    Args:
        argv: arguments without the program's name; those of the process if None.
    """
    if argv is None:
        completion.complete_if_asked(build_parser)
        _print_any_name()
    # pyarrow's own allocator gives memory back again and again, which costs more than the reading
    os.environ.setdefault("ARROW_DEFAULT_MEMORY_POOL", "system")
    arguments = build_parser().parse_args(argv)
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        if argv is None:  # the process ends: further Ctrl-C, of an impatient user, change nothing
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        return _end("interrupted" + getattr(arguments, "after_interrupt", ""), INTERRUPTED)
    except BurgError as error:
        if os.environ.get(DEBUG_VARIABLE):
            raise
        return _end(f"error: {error}{_options(error, arguments)}", INPUT_ERROR)
    except MemoryError as error:
        if os.environ.get(DEBUG_VARIABLE):
            raise
        return _end(f"error: there is not enough memory for this input. {error}", INPUT_ERROR)
    except ImportError as error:
        if os.environ.get(DEBUG_VARIABLE) or "cannot open shared object file" not in str(error):
            raise
        return _end(f"error: {_missing_library(error)}", INPUT_ERROR)
    except BrokenPipeError:
        if not _drop_unread_output():
            raise
        return 0


def _run(arguments: argparse.Namespace) -> int:
    """Runs a verb. Whatever an interrupt turned into on its way up is an interrupt again; for verbs
    that go on later SIGTERM, which batch systems send, is one, too."""
    goes_on = hasattr(arguments, "after_interrupt")
    try:
        with terminated_as_interrupted() if goes_on else contextlib.nullcontext():
            code = int(arguments.run(arguments))
        sys.stdout.flush()
        return code
    except Exception as error:
        behind: BaseException | None = error
        while behind is not None:  # modules in C++ end an interrupted import by an ImportError
            if isinstance(behind, KeyboardInterrupt):
                raise behind from None
            behind = behind.__cause__ or behind.__context__
        raise


def _options(error: BurgError, arguments: argparse.Namespace) -> str:
    """The verb's options of the arguments that an error is about, in brackets."""
    names = (OPTIONS_OF.get(name, (name,)) for name in error.arguments)
    flags = [arguments.flags[n] for several in names for n in several if n in arguments.flags]
    return f" ({', '.join(flags)})" if flags else ""


def _end(message: str, code: int) -> int:
    """Says in one line of printable text how it ended."""
    _drop_unread_output()
    sys.stdout.flush()
    words = " ".join(shown(word, LONGEST_WORD) for word in with_given_names(message).split())
    line = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in words)
    print(f"burg-drake: {line}", file=sys.stderr)
    return code


def _drop_unread_output() -> bool:
    """Whether nobody reads our output any more, as of `burg-drake ... | head`; it is then dropped.

    What is left of it would otherwise raise an error when Python ends.
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


def _print_any_name() -> None:
    """Names of files need not be text, and not every terminal knows all characters."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def _missing_library(error: ImportError) -> str:
    """What to do about a system library that a package could not load."""
    from burg_drake.system_libraries import describe_missing, missing_render_libraries

    missing = missing_render_libraries()
    return describe_missing(missing) if missing else str(error)


if __name__ == "__main__":
    sys.exit(main())
