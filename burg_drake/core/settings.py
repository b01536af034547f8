"""Settings dataclasses: units, command-line options and allowed ranges of their fields.

Name, unit, range and meaning of a setting are declared once, beside the code that uses it; the
command line makes its options from them (see `apps.options`). Ranges bound the time that a
document can ask for.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any, ClassVar, Protocol

from burg_drake.core.errors import FieldError

Vector3 = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True)
class DisplayUnit:
    """A unit for input of a field that is stored in SI units.

    Attributes:
        name: name of the unit; suffix of the option's name.
        to_si: converts a value to SI.
        from_si: converts a value from SI.
    """

    name: str
    to_si: Callable[[float], float]
    from_si: Callable[[float], float]


MAX_DOCUMENT_SEED = (1 << 64) - 1
"""Seeds have at most 64 bits."""


class Units:
    """Units for input of metres, radians and shares."""

    millimetres = DisplayUnit("mm", lambda x: 1e-3 * x, lambda x: 1e3 * x)
    # A quotient, as in files of motions and gaps: differs from the product in the last digit.
    millimetres_by_division = DisplayUnit("mm", lambda x: x / 1000.0, lambda x: 1000.0 * x)
    degrees = DisplayUnit("deg", math.radians, math.degrees)
    percent = DisplayUnit("percent", lambda x: x / 100.0, lambda x: 100.0 * x)


@dataclass(frozen=True, kw_only=True)
class Setting:
    """Declaration of a settings field.

    Attributes:
        help: meaning, without a full stop; another field in braces, such as `{lift_height}`, is
            replaced by its option. For a field that is true by default, the meaning of false, which
            its option sets.
        unit: unit for input; None for the field's own unit.
        name: name of the option, without dashes; the field's and the unit's name if empty.
        flags: short names of the option, such as `-n`.
        metavar: placeholder of the value in a help text; chosen by type and unit if empty.
        choices: allowed values; any if empty.
        low, above, high: bounds in the unit for input: from, more than, at most.
        infinite: whether `inf` is allowed.
        noun: noun for a value in messages.
    """

    help: str
    unit: DisplayUnit | None = None
    name: str = ""
    flags: tuple[str, ...] = ()
    metavar: str | tuple[str, ...] = ""
    choices: tuple[str, ...] = ()
    low: float | None = None
    above: float | None = None
    high: float | None = None
    infinite: bool = False
    noun: str = "a number"

    def option(self, field: str) -> str:
        """The long option of a field with this declaration, such as `--lift-mm`."""
        unit = "" if self.unit is None else f"_{self.unit.name}"
        return f"--{(self.name or field + unit).replace('_', '-')}"


def setting(default: Any = MISSING, help: str = "", **more: Any) -> Any:
    """Declares a field of a settings dataclass, as `dataclasses.field`.

    Args:
        default: default value.
        help: see `Setting`, as for the others.
    """
    return field(default=default, metadata={"setting": Setting(help=help, **more)})


def declared_fields(settings: type) -> dict[str, tuple[Field[Any], Setting]]:
    """The fields of a settings dataclass with their declarations, by name."""
    return {f.name: (f, f.metadata["setting"]) for f in fields(settings) if "setting" in f.metadata}


def option_name(settings: type, name: str) -> str:
    """The long option of a declared field, such as `--lift-mm`."""
    return declared_fields(settings)[name][1].option(name)


Ranges = Mapping[str, tuple[float, float]]
"""Smallest and largest value, by name of the field."""


class WithRanges(Protocol):
    """A dataclass with ranges for its fields, which are also in its schema."""

    RANGES: ClassVar[Ranges]


def require_ranges(settings: WithRanges, what: str = "") -> None:
    """Rejects values outside their range. None is valid; in a tuple, each value is checked.

    Args:
        settings: dataclass with the fields.
        what: subject of the settings, for messages; empty if the field's name suffices.

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


def require_ascending(settings: WithRanges) -> None:
    """Rejects pairs of values in descending order.

    Args:
        settings: dataclass with the fields.

    Raises:
        FieldError: the first value of a pair is above the second.
    """
    for name in settings.RANGES:
        pair = getattr(settings, name)
        if isinstance(pair, tuple) and pair[0] > pair[1]:
            raise FieldError(f"{name} is {pair[0]:g} to {pair[1]:g}; it must rise", name)


def require_finite(document: object) -> None:
    """Rejects NaN and infinite numbers in a document made by a program, as `min`, `max` and
    comparisons accept some of them. Numbers in files are checked by the reader.

    Raises:
        FieldError: names the key of the first one.
    """
    for place, number in _numbers_with_places(document, ()):
        if not math.isfinite(number):
            key = "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in place)
            raise FieldError(f"{key.lstrip('.')} is {number}; it must be a finite number", *place)


def _numbers_with_places(
    value: object, place: tuple[str | int, ...]
) -> Iterable[tuple[tuple[str | int, ...], float]]:
    """All numbers of a document, with their places."""
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
        yield from _numbers_with_places(part, (*place, key))
