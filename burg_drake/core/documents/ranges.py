"""Ranges of settings, so that what a document or a row asks for ends in bounded time."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import ClassVar, Protocol

from burg_drake.core.errors import FieldError

Ranges = Mapping[str, tuple[float, float]]
"""Smallest and largest value by name of the field."""


class WithRanges(Protocol):
    """A dataclass that says which values its fields may have; schemas say it, too."""

    RANGES: ClassVar[Ranges]


def require_ranges(settings: WithRanges, what: str = "") -> None:
    """Refuses values outside of their range. None passes; in a tuple, each value has to be inside.

    Args:
        settings: dataclass with the fields.
        what: the settings are of, for messages; nothing where the field's name says enough.

    Raises:
        FieldError: a value is outside, or not a number.
    """
    of = f" of {what}" if what else ""
    for name, (low, high) in settings.RANGES.items():
        given = getattr(settings, name)
        several = isinstance(given, tuple)
        for value in given if several else (given,):
            if value is not None and not low <= value <= high:
                verb = "has" if several else "is"
                raise FieldError(
                    f"{name}{of} {verb} {value:g}; it must be {low:g} to {high:g}", name
                )


def require_rising(pair: tuple[float, float], name: str) -> None:
    """Refuses a range that falls.

    Raises:
        FieldError: the first value is above the second.
    """
    if pair[0] > pair[1]:
        raise FieldError(f"{name} is {pair[0]:g} to {pair[1]:g}; it must rise", name)


def require_finite(document: object) -> None:
    """Refuses numbers that are NaN or infinite, of a document that a program has made: `min`, `max`
    and comparisons let some of them pass. Those of a file are checked when it is read.

    Raises:
        FieldError: names the first one by its key.
    """
    for place, number in _numbers(document, ()):
        if not math.isfinite(number):
            key = "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in place)
            raise FieldError(f"{key.lstrip('.')} is {number}; it must be a finite number", *place)


def _numbers(
    value: object, place: tuple[str | int, ...]
) -> Iterable[tuple[tuple[str | int, ...], float]]:
    """All numbers of a document with their places in it."""
    parts: Iterable[tuple[str | int, object]] = ()
    if isinstance(value, float):
        yield place, value
    elif dataclasses.is_dataclass(value):
        parts = ((f.name, getattr(value, f.name)) for f in dataclasses.fields(value))
    elif isinstance(value, Mapping):
        parts = value.items()
    elif isinstance(value, (list, tuple)):
        parts = enumerate(value)
    for key, part in parts:
        yield from _numbers(part, (*place, key))
