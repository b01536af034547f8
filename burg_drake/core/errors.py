"""Exception hierarchy: every error that a user can cause derives from `BurgError`.

A grasp that slips and a pose out of reach are outcomes, not errors; see `core.outcomes`.
"""

from __future__ import annotations

import difflib
import reprlib
from collections.abc import Iterable, Sequence
from typing import Self

MAX_VALUE_LENGTH = 60
"""Longest text of a value in a message, in characters."""


class BurgError(Exception):
    """Base of all errors that burg_drake raises on purpose; the message is one clear line.

    Attributes:
        arguments: names of the arguments whose values have to change; the command line adds the
            names of its options.
    """

    arguments: tuple[str, ...] = ()

    def about(self, *arguments: str) -> Self:
        """Sets the arguments whose values have to change; returns the error."""
        self.arguments = arguments
        return self


class InvalidInputError(BurgError, ValueError):
    """An invalid value from outside (argument, document, mesh)."""


class FieldError(InvalidInputError):
    """An invalid value of a dataclass.

    Attributes:
        place: path to the value, from the dataclass inwards: names of fields, indices of lists.
    """

    def __init__(self, message: str, *place: str | int) -> None:
        super().__init__(message)
        self.place = place


class DocumentError(InvalidInputError):
    """A YAML document that does not fit its schema; the message names file, line and key."""


class MeshError(InvalidInputError):
    """A mesh that cannot be made into a simulated object.

    Attributes:
        units: units in which its size would be plausible, best first, if a wrong unit is the cause.
    """

    units: tuple[str, ...] = ()


class UnknownNameError(BurgError, KeyError):
    """An unknown name; the message lists the known ones."""

    def __str__(self) -> str:  # KeyError would print the repr of the message
        return str(self.args[0]) if self.args else ""


class MissingDependencyError(BurgError, ImportError):
    """An optional package or system library is not installed; the message says how to get it."""


class SimulationError(BurgError, RuntimeError):
    """A simulation, renderer or worker process failed."""


class DeviceError(SimulationError):
    """A graphics card failed, and with it all that was to be simulated there."""


class WorkerDied(SimulationError):
    """A worker process ended during a task, or while it built the task's session.

    Attributes:
        from_outside: whether it was ended from outside: by the system for lack of memory, by a
            batch system, or by a user.
    """

    def __init__(self, message: str, from_outside: bool = False) -> None:
        super().__init__(message)
        self.from_outside = from_outside


class TaskCancelled(BurgError):
    """A task was cancelled, as its result is no longer needed."""


class ClusterError(BurgError, RuntimeError):
    """A cluster is unreachable or lost, or has workers that must not be used."""


def one_line(error: BaseException) -> str:
    """An error as one line: its type and message."""
    message = " ".join(str(error).split())
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def quote_value(value: object) -> str:
    """A short form of a value from outside for messages, in quotes if it is a text.

    Long texts are reduced to beginning and end, structures to the first few items.
    """
    try:
        text = _VALUE_REPR.repr(value)
    except ValueError:  # Python does not print whole numbers of more than 4300 digits
        text = "a number with thousands of digits"
    return shorten_text(text, 2 * MAX_VALUE_LENGTH)


def shorten_text(text: str, length: int = MAX_VALUE_LENGTH) -> str:
    """A short form of a text from outside for messages, without quotes: its beginning."""
    return text if len(text) <= length else f"{text[: length - 3]}..."


_VALUE_REPR = reprlib.Repr()
_VALUE_REPR.maxlevel = 2
_VALUE_REPR.maxstring = _VALUE_REPR.maxother = _VALUE_REPR.maxlong = MAX_VALUE_LENGTH


def suggest_names(name: str, known: Iterable[str], *, ordered: bool = False) -> str:
    """End of an error message about an unknown `name`: the nearest valid name and all valid ones.

    Args:
        name: the given name.
        known: the valid names.
        ordered: keep their order, with the likely ones first, instead of sorting them.

    Returns:
        For example `did you mean 'mug'? Known: bowl, mug`, or `known: bowl, mug`.
    """
    names = list(known) if ordered else sorted(known)
    meant = did_you_mean(name, names)
    return f"{meant} Known: {list_names(names)}" if meant else f"known: {list_names(names)}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint such as `did you mean 'mug'?`; empty if no name is near, or several names begin
    alike."""
    names = sorted(known)
    longer = [other for other in names if len(name) > 2 and other.startswith(name)]
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    close = difflib.get_close_matches(name, near, n=1, cutoff=0.85) or longer or near
    return f"did you mean {close[0]!r}?" if len(close) == 1 else ""


def list_names(names: Sequence[str]) -> str:
    """Names for a message: all, or the first few and the number of the others."""
    max_complete, shown = 24, 9  # names of a complete list; names of a shortened one
    if len(names) <= max_complete:
        return ", ".join(names) or "(none)"
    return f"{', '.join(names[:shown])} and {len(names) - shown} others"
