"""The command line parser, and arguments that many commands share."""

from __future__ import annotations

import argparse
import contextlib
import itertools
import shutil
import textwrap
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NoReturn

from burg_drake.apps.options.values import (
    input_file,
    measured_mm,
    names,
    port,
    positive,
    renaming,
    workers,
)
from burg_drake.core import (
    InvalidInputError,
    builtin_names,
    did_you_mean,
    quote_value,
    suggest_names,
)

if TYPE_CHECKING:
    from burg_drake.cameras import Intrinsics
    from burg_drake.evaluation import Executor

DEFAULT_STATION = "panda_tabletop"
RULER_LENGTH_MM = 100.0
"""Length of the printed rulers, in millimetres."""


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Wraps paragraphs to the width of the terminal, except for those with columns or an indent,
    such as lists of commands and examples."""

    def __init__(self, prog: str, **options: Any) -> None:
        max_width = 100  # Characters. Longer lines are hard to read.
        self.line_width = min(shutil.get_terminal_size().columns, max_width) - 2
        super().__init__(prog, **{"max_help_position": 26, "width": self.line_width} | options)

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = [
            part if "  " in part else textwrap.fill(part, width - len(indent))
            for part in text.split("\n\n")
        ]
        return textwrap.indent("\n\n".join(paragraphs), indent)

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        return f"{', '.join(action.option_strings)} {self.value_text(action)}"

    def value_text(self, action: argparse.Action) -> str:
        """The placeholder for the value of an option, or for a positional argument."""
        name = action.dest if not action.option_strings else action.dest.upper()
        if action.choices is not None:
            name = "{" + ",".join(map(str, action.choices)) + "}"
        return self._format_args(action, name)


class Parser(argparse.ArgumentParser):
    """Reports errors in one line. The usage has required arguments only; the list has all."""

    def __init__(self, **options: Any) -> None:
        options.setdefault("formatter_class", HelpFormatter)
        options.setdefault("allow_abbrev", False)
        self._add_options: Callable[[Parser], None] | None = None
        super().__init__(**options, add_help=False)
        self._positionals.title = "arguments"
        self.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)

    def defer_options(self, add_options: Callable[[Parser], None]) -> None:
        """Adds options when the parser is first used.

        Args:
            add_options: adds options, examples and defaults to this parser.
        """
        self._add_options = add_options

    def add_deferred_options(self) -> None:
        """Adds the deferred options, unless they were added before."""
        add_options, self._add_options = self._add_options, None
        if add_options is not None:
            add_options(self)

    def format_usage(self) -> str:
        """The usage with all required arguments."""
        self.add_deferred_options()
        self.usage = self._required_usage()
        return super().format_usage()

    def format_help(self) -> str:
        """The help with all options."""
        self.add_deferred_options()
        self.usage = self._required_usage()
        return super().format_help()

    def _required_usage(self) -> str:
        """The command with its positional arguments and required options."""
        formatter = HelpFormatter(self.prog)
        required_choices = {
            action: " | ".join(
                f"{other.option_strings[0]} {formatter.value_text(other)}"
                for other in group._group_actions
            )
            for group in self._mutually_exclusive_groups
            if group.required
            for action in group._group_actions[:1]
        }
        words, optional = [self.prog.replace("%", "%%")], ""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                return f"{words[0]} VERB ..."
            elif not action.option_strings:
                words.append(formatter.value_text(action))
            elif action in required_choices:
                words.append(f"({required_choices[action]})")
            elif action.required:
                words.append(f"{action.option_strings[0]} {formatter.value_text(action)}")
            elif action.help is not argparse.SUPPRESS:
                optional = "[options]"
        words.append(optional)
        indent = " " * len(f"usage: {self.prog} ")
        usage = " ".join(filter(None, words))
        return textwrap.fill(usage, formatter.line_width - len("usage: "), subsequent_indent=indent)

    def parse_known_args(self, *arguments: Any, **named: Any) -> Any:
        """Refuses unknown arguments here, so that the error refers to the help of this command and
        not to that of `burg-drake`; before missing ones, as one may be the other, misspelt."""
        self.add_deferred_options()
        if self._subparsers is None:
            known = self._option_string_actions
            options = [
                word
                for word in itertools.takewhile("--".__ne__, arguments[0])
                if word.startswith("--") and " " not in word  # with a space it is a value
            ]
            self._refuse_unknown([one for one in options if one.partition("=")[0] not in known])
        found, unknown = super().parse_known_args(*arguments, **named)
        if not hasattr(found, "flags"):  # the command's parser comes before that of its group
            found.flags = {
                action.dest: action.option_strings[-1]
                for action in self._actions
                if action.option_strings and action.help is not argparse.SUPPRESS
            }
        self._refuse_unknown(unknown)
        return found, unknown

    def _refuse_unknown(self, unknown: Sequence[str]) -> None:
        """Ends the program if there are unknown arguments; the message suggests a similar one."""
        if unknown:
            option = unknown[0].partition("=")[0]
            known = self._option_string_actions if option.startswith("-") else ()
            meant = did_you_mean(option, known)
            self.error(f"unrecognized arguments: {' '.join(unknown)}{meant and f'; {meant}'}")

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuses an unknown choice or command; the message suggests similar ones."""
        if action.choices is not None and value not in action.choices:
            known = suggest_names(str(value), map(str, action.choices))
            if isinstance(action, argparse._SubParsersAction):
                self.error(f"there is no verb {quote_value(value)}; {known}")
            raise argparse.ArgumentError(action, f"invalid choice: {quote_value(value)}; {known}")

    def error(self, message: str) -> NoReturn:
        """Ends the program with exit code 2."""
        self.exit(2, f"burg-drake: error: {message} (see {self.prog} --help)\n")


def examples_text(*lines: str) -> str:
    """Text below the options in the help of a command.

    Args:
        lines: examples; after an empty line, paragraphs of text.
    """
    commands = lines[: lines.index("")] if "" in lines else lines
    paragraphs = lines[len(commands) + 1 :]
    return "\n\n".join(["examples:\n" + textwrap.indent("\n".join(commands), "  "), *paragraphs])


class CommandGroup:
    """The commands of a parser, listed under headings in the order in which they are added."""

    def __init__(self, parser: Parser) -> None:
        """A parser without commands."""
        self._parser = parser
        self._action: Any = parser.add_subparsers(
            metavar="VERB", required=True, help=argparse.SUPPRESS
        )
        self._heading: Any = None

    def begin_heading(self, title: str) -> None:
        """Lists the commands that are added next under this title."""
        self._heading = self._parser.add_argument_group(title)

    def add_parser(self, name: str, summary: str) -> Parser:
        """Adds a command.

        Args:
            name: last word of the command.
            summary: one sentence, without capital and period.
        """
        name_width = 11  # Characters of the column of command names.
        if self._heading is None:
            self.begin_heading("verbs")
        line = f"{name:<{name_width}}  {summary}"
        self._heading.description = "\n".join(filter(None, [self._heading.description, line]))
        sentence = f"{summary[0].upper()}{summary[1:]}."
        parser: Parser = self._action.add_parser(name, help=summary, description=sentence)
        return parser


def add_scene(parser: Parser) -> None:
    """Adds the argument SCENE."""
    parser.add_argument("scene", metavar="SCENE", help=f"scene file, or built-in: {scene_names()}")


def scene_names() -> str:
    """Names of the built-in scenes, for a help text."""
    return ", ".join(builtin_names("scenes"))


def add_output(parser: Any, metavar: str, help: str, *, required: bool = True) -> None:
    """Adds the option --output."""
    parser.add_argument("-o", "--output", metavar=metavar, required=required, help=help)


def add_measured_board(
    parser: Any, help: str = "length of the printed 100 mm rulers along x and y (default: 100)"
) -> None:
    """Adds the option --measured-mm, for commands that print a board or see a printed one.

    Args:
        parser: parser, or group of options, that gets the option.
        help: text for this command.
    """
    parser.add_argument(
        "--measured-mm",
        metavar="X[,Y]",
        type=measured_mm,
        default=(RULER_LENGTH_MM, RULER_LENGTH_MM),
        help=help,
    )


def print_scale_from_options(arguments: argparse.Namespace) -> tuple[float, float]:
    """Scale of the print relative to the document along x and y, from --measured-mm."""
    x, y = arguments.measured_mm
    return x / RULER_LENGTH_MM, y / RULER_LENGTH_MM


def add_station(
    parser: Any,
    help: str = "station: file or name (default: %(default)s)",
    default: str | None = DEFAULT_STATION,
) -> None:
    """Adds the option --station.

    Args:
        parser: parser, or group of options, that gets the option.
        help: text for this command.
        default: None if the station comes from elsewhere or is optional.
    """
    parser.add_argument("--station", metavar="STATION", default=default, help=help)


def add_only(parser: Parser, what: str) -> None:
    """Adds the option --only, which chooses objects.

    Args:
        parser: parser, or group of options, that gets the option.
        what: text before "of this object".
    """
    parser.add_argument(
        "--only",
        metavar="A,B",
        type=names,
        action="extend",
        help=f"{what} of these objects or instances",
    )


def add_renaming(parser: Any) -> None:
    """Adds the option --rename; in evaluate it is called --grasps-object."""
    for option, help in (
        ("--rename", "rename an object of the file, or with OURS alone all"),
        ("--grasps-object", argparse.SUPPRESS),
    ):
        parser.add_argument(
            option,
            dest="rename",
            metavar="[THEIRS=]OURS",
            type=renaming,
            action="append",
            default=[],
            help=help,
        )


def add_quiet(parser: Parser) -> None:
    """Adds the option --quiet, for commands that take long."""
    parser.add_argument("--quiet", action="store_true", help="do not show progress")


def add_workers(
    parser: Any,
    help: str = "worker processes (default: one for each core)",
    default: int | None = None,
) -> None:
    """Adds the option --workers, for commands with worker processes.

    Args:
        parser: parser, or group of options, that gets the option.
        help: text for this command.
        default: None lets the library choose.
    """
    parser.add_argument("--workers", metavar="N", type=workers, default=default, help=help)


MAX_PAGE_CONNECTIONS = 32
"""Maximum number of connections at a time. A browser opens two to six."""


def add_view_options(parser: Parser) -> None:
    """Adds the options of commands that show a 3D view."""
    parser.add_argument("--html", metavar="FILE", help="write one web page instead of a live view")
    parser.add_argument(
        "--port", type=port, metavar="N", help="port of the live view (default: first free)"
    )
    parser.add_argument(
        "--no-wait", action="store_true", help="end at once instead of waiting for Ctrl-C"
    )


def add_page_options(parser: Any, network: str) -> None:
    """Adds the options of commands that serve a page.

    Args:
        parser: parser, or group of options, that gets the options.
        network: text after "with 0.0.0.0" on what others in the network can do with the page.
    """
    parser.add_argument(
        "--port", type=port, metavar="N", help="port of the page (default: first free)"
    )
    parser.add_argument(
        "--host",
        metavar="ADDRESS",
        default="127.0.0.1",
        help="address to serve on (default: 127.0.0.1, this computer alone); with 0.0.0.0"
        f" {network}",
    )
    parser.add_argument("--open", action="store_true", help="open the page in the browser")


def add_intrinsics(
    parser: Any, help: str = "intrinsics of the camera", *, required: bool = False
) -> None:
    """Adds the option --intrinsics.

    Args:
        parser: parser, or group of options, that gets the option.
        help: text for this command.
        required: whether the command needs the option.
    """
    parser.add_argument(
        "--intrinsics", metavar="FILE", type=input_file, required=required, help=help
    )


def add_live_camera(parser: Any, more: str, default: str | None = None) -> None:
    """Adds --camera, --intrinsics, --fps and --measured-mm, for commands with a live camera.

    Args:
        parser: parser, or group of options, that gets the options.
        more: text after the kinds of cameras in the help.
        default: the camera.
    """
    parser.add_argument(
        "--camera",
        metavar="SOURCE",
        default=default,
        help="camera number, stream address, video, image, folder of images, or"
        f" sim:STATION/CAMERA{more}",
    )
    add_intrinsics(
        parser,
        "intrinsics of the camera, by burg-drake camera calibrate; simulated cameras need none",
    )
    parser.add_argument(
        "--fps", type=positive, metavar="N", help="images per second to request from the camera"
    )
    add_measured_board(parser)


def add_depth_unit(parser: Any) -> None:
    """Adds the option --depth-unit, for commands that read a depth image."""
    parser.add_argument(
        "--depth-unit",
        metavar="M",
        type=positive,
        help="unit of the depth image in metres (default: 0.001 for whole numbers, else 1)",
    )


def intrinsics_from_options(arguments: argparse.Namespace) -> Intrinsics:
    """The intrinsics from --intrinsics, or of the simulated camera of --camera.

    Raises:
        InvalidInputError: there are neither.
    """
    from burg_drake.cameras import SIMULATED_PREFIX, load_intrinsics

    if arguments.intrinsics is not None:
        return load_intrinsics(arguments.intrinsics)
    if not arguments.camera.startswith(SIMULATED_PREFIX):
        raise InvalidInputError(
            f"camera {arguments.camera} needs --intrinsics FILE; burg-drake camera calibrate makes"
            " one"
        )
    return load_intrinsics(arguments.camera)


def add_cluster(group: Any) -> None:
    """Adds the option --cluster.

    Args:
        group: group of mutually exclusive options, as the cluster has its own workers.
    """
    group.add_argument(
        "--cluster",
        metavar="WHERE",
        help="use a Dask cluster: tls://HOST:PORT, a cluster.yaml, or local:N (needs"
        " burg-drake[dask])",
    )


def cluster_from_options(
    arguments: argparse.Namespace,
) -> contextlib.AbstractContextManager[Executor | None]:
    """Context manager of the cluster of --cluster; None for worker processes of this machine."""
    if arguments.cluster is None:
        return contextlib.nullcontext()
    from burg_drake.evaluation import connect_cluster

    return connect_cluster(arguments.cluster)


def add_retry_failed(parser: argparse.ArgumentParser, what: str) -> None:
    """Adds the option --retry-failed.

    Args:
        parser: parser, or group of options, that gets the option.
        what: plural noun for the items that are tried again.
    """
    parser.add_argument(
        "--retry-failed", action="store_true", help=f"also retry {what} that could not be simulated"
    )


def retry_advice(interrupted: int, failed: int) -> str:
    """One clause that advises what to do about failures.

    Args:
        interrupted: number of failures whose worker process was killed from outside.
        failed: number of all failures.
    """
    if not interrupted:
        return "--retry-failed tries them again"
    again = (
        f"{interrupted} of them because a worker process was ended from outside, as happens"
        " when memory runs out: the same command tries these again (fewer --workers need less)"
    )
    return again if interrupted == failed else f"{again}, --retry-failed all"
