"""Parsers of verbs, and the arguments that many of them share."""

from __future__ import annotations

import argparse
import shutil
import textwrap
from collections.abc import Callable
from typing import Any, NoReturn

from burg_drake.apps.options.values import measured_mm, names, renaming, workers
from burg_drake.core import did_you_mean, nearest, quoted

DEFAULT_STATION = "panda_tabletop"
RULER_MM = 100.0
"""Length of the printed rulers."""
MAX_HELP_WIDTH = 100
"""Of a help text [characters]; longer lines are hard to read."""
VERB_WIDTH = 11
"""Room for the name of a verb in a list of verbs [characters]."""


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """Fits paragraphs to the terminal, and keeps those with columns or an indent, such as lists
    of verbs and examples, as they are."""

    def __init__(self, prog: str, **options: Any) -> None:
        self.line_width = min(shutil.get_terminal_size().columns, MAX_HELP_WIDTH) - 2
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
        """What stands for the value of an option, or for a positional argument."""
        name = action.dest if not action.option_strings else action.dest.upper()
        if action.choices is not None:
            name = "{" + ",".join(map(str, action.choices)) + "}"
        return self._format_args(action, name)


class Parser(argparse.ArgumentParser):
    """Reports an error in one line. The usage has what must be given; the list has the rest."""

    def __init__(self, **options: Any) -> None:
        options.setdefault("formatter_class", HelpFormatter)
        options.setdefault("allow_abbrev", False)
        self._waiting: Callable[[Parser], None] | None = None
        super().__init__(**options, add_help=False)
        self._positionals.title = "arguments"
        self.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)

    def wait_with(self, options: Callable[[Parser], None] | None) -> None:
        """Adds options when somebody asks for them."""
        self._waiting = options

    def complete(self) -> None:
        """Adds the options that were left for when somebody asks: they are made of settings, whose
        modules need not be imported for the sake of other verbs."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            waiting(self)

    def format_usage(self) -> str:
        """The usage with all that is required."""
        self.complete()
        self.usage = self._required_usage()
        return super().format_usage()

    def format_help(self) -> str:
        """The help with all options."""
        self.complete()
        self.usage = self._required_usage()
        return super().format_help()

    def _required_usage(self) -> str:
        """The command with its arguments and the options that it cannot do without."""
        formatter = HelpFormatter(self.prog)
        either = {
            action: " | ".join(
                f"{other.option_strings[0]} {formatter.value_text(other)}"
                for other in group._group_actions
            )
            for group in self._mutually_exclusive_groups
            if group.required
            for action in group._group_actions[:1]
        }
        words, more = [self.prog.replace("%", "%%")], ""
        for action in self._actions:
            if isinstance(action, argparse._SubParsersAction):
                return f"{words[0]} VERB ..."
            elif not action.option_strings:
                words.append(formatter.value_text(action))
            elif action in either:
                words.append(f"({either[action]})")
            elif action.required:
                words.append(f"{action.option_strings[0]} {formatter.value_text(action)}")
            elif action.help is not argparse.SUPPRESS:
                more = "[options]"
        words.append(more)
        indent = " " * len(f"usage: {self.prog} ")
        usage = " ".join(filter(None, words))
        return textwrap.fill(usage, formatter.line_width - len("usage: "), subsequent_indent=indent)

    def parse_known_args(self, *arguments: Any, **named: Any) -> Any:
        """Refuses what it does not know, for its verbs, too, which else leave that to the parser
        of the whole command, whose help knows nothing of them."""
        self.complete()
        found, unknown = super().parse_known_args(*arguments, **named)
        if not hasattr(found, "flags"):  # of the verb, whose parser comes first
            found.flags = {
                action.dest: action.option_strings[-1]
                for action in self._actions
                if action.option_strings and action.help is not argparse.SUPPRESS
            }
        if unknown:
            option = unknown[0].partition("=")[0]
            known = self._option_string_actions if option.startswith("-") else ()
            meant = did_you_mean(option, known)
            self.error(f"unrecognized arguments: {' '.join(unknown)}{meant and f'; {meant}'}")
        return found, unknown

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Names the nearest of the choices, of verbs among them."""
        if action.choices is not None and value not in action.choices:
            known = nearest(str(value), map(str, action.choices))
            if isinstance(action, argparse._SubParsersAction):
                self.error(f"there is no verb {quoted(value)}; {known}")
            raise argparse.ArgumentError(action, f"invalid choice: {quoted(value)}; {known}")

    def error(self, message: str) -> NoReturn:
        """Ends the program with exit code 2."""
        self.exit(2, f"burg-drake: error: {message} (see {self.prog} --help)\n")


def examples(*lines: str) -> str:
    """Epilog of a verb's help.

    Args:
        lines: examples, and after an empty one paragraphs of text.
    """
    commands = lines[: lines.index("")] if "" in lines else lines
    paragraphs = lines[len(commands) + 1 :]
    return "\n\n".join(["examples:\n" + textwrap.indent("\n".join(commands), "  "), *paragraphs])


def add_verb(
    verbs: Any,
    name: str,
    run: Any,
    summary: str,
    *lines: str,
    options: Callable[[Parser], None] | None = None,
) -> Parser:
    """Adds a verb.

    Args:
        verbs: what `add_subparsers` returned.
        name: of the verb.
        run: called with the parsed arguments; returns the exit code.
        summary: one sentence.
        lines: examples.
        options: adds what the verb takes, when somebody asks for it.
    """
    parser: Parser = verbs.add_parser(
        name,
        help=summary,
        description=_sentence(summary),
        epilog=examples(*lines),
    )
    parser.set_defaults(run=run)
    parser.wait_with(options)
    return parser


def add_group(verbs: Any, name: str, summary: str) -> VerbGroup:
    """Adds a verb that has verbs of its own; returns what those are added to."""
    parser = verbs.add_parser(name, help=summary, description=_sentence(summary))
    return VerbGroup(parser)


class VerbGroup:
    """The verbs of a parser, listed under one or more headings in the order in which they came."""

    def __init__(self, parser: Parser) -> None:
        """A parser that has no verbs so far."""
        self._parser = parser
        self._action: Any = parser.add_subparsers(
            metavar="VERB", required=True, help=argparse.SUPPRESS
        )
        self._list: Any = None

    def heading(self, title: str) -> None:
        """Lists the verbs that come from now on under this title."""
        self._list = self._parser.add_argument_group(title)

    def add_parser(self, name: str, *, help: str, **options: Any) -> Parser:
        """Adds a verb, as `argparse` does, with a line for the list."""
        if self._list is None:
            self.heading("verbs")
        line = f"{name:<{VERB_WIDTH}}  {help}"
        self._list.description = "\n".join(filter(None, [self._list.description, line]))
        parser: Parser = self._action.add_parser(name, help=help, **options)
        return parser


def _sentence(summary: str) -> str:
    return f"{summary[0].upper()}{summary[1:]}."


def add_scene(parser: Parser) -> None:
    """The argument SCENE."""
    parser.add_argument(
        "scene",
        metavar="SCENE",
        help=f"scene file, or built-in: {scene_names()}",
    )


def scene_names() -> str:
    """The built-in scenes, for a help text."""
    from burg_drake.core.paths import builtin_names

    return ", ".join(builtin_names("scenes"))


def add_measured_board(
    parser: Any,
    help: str = "length of the printed 100 mm rulers along x and y (default: 100)",
) -> None:
    """The option --measured-mm, of verbs that look at a board that was printed already, or print.

    Args:
        parser: gets it.
        help: what it means to the verb.
    """
    parser.add_argument(
        "--measured-mm",
        metavar="X[,Y]",
        type=measured_mm,
        default=(RULER_MM, RULER_MM),
        help=help,
    )


def print_scale(arguments: argparse.Namespace) -> tuple[float, float]:
    """Size of the print against the document along x and y, by --measured-mm."""
    x, y = arguments.measured_mm
    return x / RULER_MM, y / RULER_MM


def add_station(
    parser: Any,
    help: str = "station: file or name (default: %(default)s)",
    default: str | None = DEFAULT_STATION,
) -> None:
    """The option --station.

    Args:
        parser: gets it.
        help: what it means to the verb.
        default: None where something else tells the station, or there need not be one.
    """
    parser.add_argument("--station", metavar="STATION", default=default, help=help)


def add_only(parser: Parser, what: str) -> None:
    """The option --only, by which all verbs choose objects.

    Args:
        parser: gets it.
        what: is chosen, before "of this object".
    """
    parser.add_argument(
        "--only",
        metavar="A,B",
        type=names,
        action="extend",
        help=f"{what} of these objects or instances",
    )


def add_renaming(parser: Parser) -> None:
    """The option --rename; evaluate, which is not about a file alone, calls it --grasps-object."""
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
    """The option --quiet of verbs that take long."""
    parser.add_argument("--quiet", action="store_true", help="do not show progress")


def add_workers(
    parser: Any,
    help: str = "worker processes (default: one for each core)",
    default: int | None = None,
) -> None:
    """The option --workers of verbs that share their work out.

    Args:
        parser: gets it.
        help: what it means to the verb.
        default: None lets the library choose.
    """
    parser.add_argument("--workers", metavar="N", type=workers, default=default, help=help)
