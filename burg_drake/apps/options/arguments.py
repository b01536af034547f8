"""Parsers of verbs, and the arguments that many of them share."""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable
from typing import Any, NoReturn

from burg_drake.apps.options.values import measured_mm, names, renaming, workers
from burg_drake.core import did_you_mean, nearest, quoted

DEFAULT_STATION = "panda_tabletop"
RULER_MM = 100.0
"""Length of the printed rulers."""


class Parser(argparse.ArgumentParser):
    """Reports an error in one line, and shows epilogs as they are written."""

    def __init__(self, **options: Any) -> None:
        options.setdefault("formatter_class", argparse.RawDescriptionHelpFormatter)
        options.setdefault("allow_abbrev", False)
        self._waiting: Callable[[Parser], None] | None = None
        super().__init__(**options)

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
        """The usage with all options."""
        self.complete()
        return super().format_usage()

    def format_help(self) -> str:
        """The help with all options."""
        self.complete()
        return super().format_help()

    def parse_known_args(self, *arguments: Any, **named: Any) -> Any:
        """Refuses what it does not know, for its verbs, too, which else leave that to the parser
        of the whole command, whose help knows nothing of them."""
        self.complete()
        found, unknown = super().parse_known_args(*arguments, **named)
        if not hasattr(found, "flags"):  # of the verb, whose parser comes first
            found.flags = {a.dest: a.option_strings[-1] for a in self._actions if a.option_strings}
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
            raise argparse.ArgumentError(action, f"invalid choice: {quoted(value)}; {known}")

    def error(self, message: str) -> NoReturn:
        """Ends the program with exit code 2."""
        self.exit(2, f"burg-drake: error: {message} (see {self.prog} --help)\n")


def examples(*lines: str) -> str:
    """Epilog of a verb's help."""
    return "examples:\n" + textwrap.indent("\n".join(lines), "  ")


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


def add_group(verbs: Any, name: str, summary: str) -> Any:
    """Adds a verb that has verbs of its own; returns what those are added to."""
    parser = verbs.add_parser(name, help=summary, description=_sentence(summary))
    return parser.add_subparsers(title="verbs", metavar="VERB", required=True)


def _sentence(summary: str) -> str:
    return f"{summary[0].upper()}{summary[1:]}."


def add_scene(parser: Parser) -> None:
    """The argument SCENE."""
    parser.add_argument(
        "scene",
        metavar="SCENE",
        help=f"scene file, or name of a built-in one: {scene_names()}",
    )


def scene_names() -> str:
    """The built-in scenes, for a help text."""
    from burg_drake.core.paths import builtin_names

    return ", ".join(builtin_names("scenes"))


def add_measured_board(
    parser: Any,
    help: str = "what the printed board's rulers of 100 mm measure, along x and along y",
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
    help: str = "station file or built-in name (default: %(default)s)",
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
        help=f"{what} of these objects, or instances of a scene, alone",
    )


def add_renaming(parser: Parser) -> None:
    """The option --rename; evaluate, which is not about a file alone, calls it --grasps-object."""
    parser.add_argument(
        "--rename",
        "--grasps-object",
        metavar="[THEIRS=]OURS",
        type=renaming,
        action="append",
        default=[],
        help="rename an object of the file; OURS alone renames all",
    )


def add_quiet(parser: Parser) -> None:
    """The option --quiet of verbs that take long."""
    parser.add_argument("--quiet", action="store_true", help="no progress")


def add_workers(
    parser: Any, help: str = "processes (default: one a processor)", default: int | None = None
) -> None:
    """The option --workers of verbs that share their work out.

    Args:
        parser: gets it.
        help: what it means to the verb.
        default: None lets the library choose.
    """
    parser.add_argument("--workers", metavar="N", type=workers, default=default, help=help)
