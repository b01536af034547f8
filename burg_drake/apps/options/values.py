"""Types of option values: each function parses the text of one value or says what is wrong with it.

All raise `argparse.ArgumentTypeError`, which the parser reports with the option's name.
"""

from __future__ import annotations

import argparse
import math
import re
import stat
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from burg_drake.core import (
    MAX_DOCUMENT_SEED,
    InvalidInputError,
    quote_value,
    read_pipe,
    shorten_text,
    suggest_names,
)

MAX_COUNT = 10_000_000
"""Maximum number of grasps, trials or rows."""
_PIPE_NAMES: dict[str, str] = {}
"""Names of pipes for messages, by the paths of the copies of their contents."""


def input_file(text: str) -> str:
    """A file to read, `-` for the standard input. Files are read more than once, to recognise their
    format; input from a pipe, as with `<(...)`, is copied to a file first."""
    standard_input = ("-", "/dev/stdin")
    try:
        if text not in standard_input and not stat.S_ISFIFO(Path(text).stat().st_mode):
            return text
    except (OSError, ValueError):  # opening the file reports the error
        return text
    name = "stdin" if text in standard_input else Path(text).name
    copy = Path(tempfile.mkdtemp(dir=_pipe_folder().name)).resolve() / name
    _PIPE_NAMES[str(copy)] = "standard input" if text in standard_input else text
    try:
        copy.write_bytes(read_pipe(0 if text in standard_input else text))
    except InvalidInputError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    return str(copy)


def restore_pipe_names(message: str) -> str:
    """A message with the user's names of pipes in place of the paths of their copies."""
    for copy, name in _PIPE_NAMES.items():
        message = message.replace(copy, name)
    return message


@cache
def _pipe_folder() -> tempfile.TemporaryDirectory[str]:
    """The folder for copies of input from pipes; deleted when the process ends."""
    return tempfile.TemporaryDirectory(prefix="burg-drake-pipe-")


def positive_int(text: str) -> int:
    """A whole number from 1 to `MAX_COUNT`."""
    return whole_number(text, 1, MAX_COUNT)


def workers(text: str) -> int:
    """A number of processes."""
    return whole_number(text, 1, 1024)


def whole_number(text: str, low: int, high: int) -> int:
    """A whole number within bounds."""
    try:
        value = int(text)
    except ValueError:  # also of 4,300 digits
        value = low - 1
    if not low <= value <= high:
        raise argparse.ArgumentTypeError(
            f"{quote_value(text)} is not a whole number from {low:,} to {high:,}"
        )
    return value


def two_numbers(text: str) -> tuple[int, int]:
    """`AxB` of whole numbers from 1."""
    found = re.fullmatch(r"([1-9]\d*)[x×]([1-9]\d*)", text.strip().lower())
    if found is None:
        raise argparse.ArgumentTypeError(
            f"{quote_value(text)} is not two whole numbers, such as 8x11"
        )
    return int(found[1]), int(found[2])


def seed(text: str) -> int:
    """A whole number from 0 with at most 64 bits, as in documents."""
    return whole_number(text, 0, MAX_DOCUMENT_SEED)


def port(text: str) -> int:
    """A port that needs no privileges: Drake's Meshcat accepts ports from 1024."""
    return whole_number(text, 1024, 65535)


def positive(text: str) -> float:
    """A finite number above 0."""
    value = number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{shorten_text(text)} is not above 0")
    return value


def not_negative(text: str) -> float:
    """A finite number from 0."""
    value = number(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{shorten_text(text)} is below 0")
    return value


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{quote_value(text)} is not a finite number")
    return value


def named_positive(text: str) -> tuple[str, float]:
    """`NAME=VALUE` with a value above 0."""
    name, equals, value = text.rpartition("=")
    if not equals or not name:
        raise argparse.ArgumentTypeError(
            f"{quote_value(text)} is not NAME=VALUE, such as mug=0.118"
        )
    try:
        return name, positive(value)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{name}: {error}") from error


def key_and_value(text: str, form: str) -> tuple[str, str]:
    """`KEY=VALUE`, neither of them empty.

    Args:
        text: the value of the option.
        form: expected form for the message, such as `KEY=FOLDER`.
    """
    key, _, value = text.partition("=")
    if not key or not value:
        raise argparse.ArgumentTypeError(f"{quote_value(text)} is not {form}")
    return key, value


def unit(text: str) -> tuple[str, str]:
    """`NAME=UNIT`, or `UNIT` for all (then the name is empty)."""
    from burg_drake.objects import UNITS

    name, _, value = text.rpartition("=")
    if value not in UNITS:
        raise argparse.ArgumentTypeError(
            f"{quote_value(text)} is not [NAME=]UNIT with one of the units {', '.join(UNITS)}"
        )
    return name, value


def friction(text: str) -> tuple[str, float]:
    """`NAME=MU`, or `MU` for all (then the name is empty), with a coefficient from 0."""
    name, _, value = text.rpartition("=")
    return name, coefficient(value)


def coefficient(text: str) -> float:
    """A friction coefficient from 0."""
    mu = number(text)
    if mu < 0.0:
        raise argparse.ArgumentTypeError(
            f"{shorten_text(text)} is not a friction coefficient from 0"
        )
    return mu


def renaming(text: str) -> tuple[str, str]:
    """`THEIRS=OURS`, or `OURS` for all (then the first name is empty)."""
    theirs, _, ours = text.rpartition("=")
    if not ours:
        raise argparse.ArgumentTypeError(
            f"{quote_value(text)} is not THEIRS=OURS, such as Mug_3f2a=mug"
        )
    return theirs, ours


def names(text: str) -> list[str]:
    """`A` or `A,B`: names of objects or instances, which have no commas."""
    found = [name for part in text.split(",") if (name := part.strip())]
    if not found:
        raise argparse.ArgumentTypeError(
            f"{quote_value(text)} has no name; give A, or A,B for several"
        )
    return found


def known_names(text: str, known: Sequence[str], what: str) -> list[str]:
    """`A` or `A,B`: names among the known ones, each once and in the order of `known`.

    Args:
        text: the value of the option.
        known: the valid names.
        what: noun for the message, such as `a test`.
    """
    given = [name.strip() for name in text.split(",") if name.strip()] or [text]
    for name in given:
        if name not in known:
            raise argparse.ArgumentTypeError(
                f"{name!r} is not {what}; {suggest_names(name, known)}"
            )
    return [name for name in known if name in given]


def measured_mm(text: str) -> tuple[float, float]:
    """`X` or `X,Y`: what printed rulers of 100 mm measure along x and y [mm]."""
    values = [positive(part) for part in text.split(",")]
    if len(values) > 2:
        raise argparse.ArgumentTypeError(
            f"{quote_value(text)} is not X or X,Y, such as 98.5 or 98.5,99.2"
        )
    return values[0], values[-1]
