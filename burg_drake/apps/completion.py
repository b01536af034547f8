"""`burg-drake completion`: the shell completes verbs, options, choices and built-in names.

The printed script has the shell run `burg-drake` itself with the line so far in its environment,
where `argcomplete` takes over before anything is run.
"""

from __future__ import annotations

import argparse
import os
import shlex
from collections.abc import Callable, Iterable
from typing import Any

from burg_drake.apps.options import Parser, add_verb

SUPPORTED_SHELLS = ("bash", "zsh", "fish")
COMMAND_NAME = "burg-drake"
ASKED_VARIABLE = "_ARGCOMPLETE"
"""Set by the shell's script when it asks for completions."""
NAMES_OF = {
    "scene": ("scenes",),
    "scenes": ("scenes",),
    "station": ("stations",),
    "hand": ("models/hands",),
    "library": ("models",),
    "source": ("scenes", "models"),
    "scene_or_library": ("scenes", "models"),
}
"""Built-in data that an argument may name, by what the parsed arguments call it."""


def add_to(verbs: Any) -> None:
    """Adds the verb."""
    parser = add_verb(
        verbs,
        "completion",
        run_completion,
        "print the script by which your shell completes commands",
        'eval "$(burg-drake completion bash)"',
        'eval "$(burg-drake completion zsh)"',
        "burg-drake completion fish | source",
        "",
        "Put the line of your shell into ~/.bashrc, ~/.zshrc or ~/.config/fish/config.fish.",
    )
    parser.add_argument(
        "shell", choices=SUPPORTED_SHELLS, metavar="SHELL", help="bash, zsh or fish"
    )


def run_completion(arguments: argparse.Namespace) -> int:
    """Prints the script."""
    from argcomplete.shell_integration import shellcode

    print(shellcode([COMMAND_NAME], shell=arguments.shell))
    return 0


def complete_if_asked(build_parser: Callable[[], Parser]) -> None:
    """Answers a shell that asks for completions, and ends the process; else does nothing."""
    if ASKED_VARIABLE not in os.environ:
        return
    import argcomplete

    parser = build_parser()
    words = _words(os.environ.get("COMP_LINE", ""))
    for verb in _path(parser, words):
        verb.complete()
        for action in verb._actions:
            if kinds := NAMES_OF.get(action.dest):
                action.completer = _Names(kinds)  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser, always_complete_options="long")


class _Names:
    """Completes built-in names and files."""

    def __init__(self, kinds: Iterable[str]) -> None:
        self._kinds = kinds

    def __call__(self, prefix: str, **_: Any) -> list[str]:
        from argcomplete.completers import FilesCompleter

        from burg_drake.core.paths import builtin_names

        names = [name for kind in self._kinds for name in builtin_names(kind)]
        return [*(n for n in names if n.startswith(prefix)), *FilesCompleter()(prefix)]


def _words(line: str) -> list[str]:
    """The words of a line, whose last quote may be open."""
    try:
        return shlex.split(line)[1:]
    except ValueError:
        return line.split()[1:]


def _path(parser: Parser, words: Iterable[str]) -> Iterable[Parser]:
    """The parsers of the verbs that a line names, from the whole command on."""
    yield parser
    for word in words:
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction) and word in action.choices:
                parser = action.choices[word]
                yield parser
                break
