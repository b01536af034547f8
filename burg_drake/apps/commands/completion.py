"""`burg-drake completion`: shell completion of commands, options, choices and built-in names."""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Iterable
from typing import Any

from burg_drake.apps import options

BUILTIN_DATA_FOLDERS = {
    "scene": ("scenes",),
    "scenes": ("scenes",),
    "station": ("stations",),
    "hand": ("models/hands",),
    "library": ("models",),
    "source": ("scenes", "models"),
    "scene_or_library": ("scenes", "models"),
}
"""Folders of built-in data that an argument may refer to, by its name in the parsed arguments."""


def add_completion_options(parser: options.Parser) -> None:
    """Adds the options of `burg-drake completion`."""
    parser.epilog = options.examples_text(
        'eval "$(burg-drake completion bash)"',
        'eval "$(burg-drake completion zsh)"',
        "burg-drake completion fish | source",
        "",
        "Put the line of your shell into ~/.bashrc, ~/.zshrc or ~/.config/fish/config.fish.",
    )
    parser.add_argument(
        "shell", choices=("bash", "zsh", "fish"), metavar="SHELL", help="bash, zsh or fish"
    )


def run_completion(arguments: argparse.Namespace) -> int:
    """Prints the script."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["burg-drake"], shell=arguments.shell))
    return 0


def complete_line(parser: options.Parser) -> None:
    """Prints completions for a shell, and ends the process.

    Args:
        parser: parser of the whole command.
    """
    import argcomplete

    words = _split_line(os.environ.get("COMP_LINE", ""))
    for command in _parsers_of_line(parser, words):
        command.add_deferred_options()
        for action in command._actions:
            if kinds := BUILTIN_DATA_FOLDERS.get(action.dest):
                action.completer = _NameCompleter(kinds)  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser, always_complete_options="long")


class _NameCompleter:
    """Completes built-in names and files."""

    def __init__(self, kinds: Iterable[str]) -> None:
        self._kinds = kinds

    def __call__(self, prefix: str, **_: Any) -> list[str]:
        from argcomplete.completers import FilesCompleter

        from burg_drake.core import builtin_names

        names = [name for kind in self._kinds for name in builtin_names(kind)]
        return [*(n for n in names if n.startswith(prefix)), *FilesCompleter()(prefix)]


def _split_line(line: str) -> list[str]:
    """The words of a command line, whose last quote may be open."""
    try:
        return shlex.split(line)[1:]
    except ValueError:
        return line.split()[1:]


def _parsers_of_line(parser: options.Parser, words: Iterable[str]) -> Iterable[options.Parser]:
    """The parsers of `burg-drake` and of the groups and commands in a line, in that order."""
    yield parser
    for word in words:
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction) and word in action.choices:
                parser = action.choices[word]
                yield parser
                break
