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
    """A unit that people give, where a field has SI.

    Attributes:
        name: of the unit; ends the option's name.
        to_si: brings a value to SI.
        from_si: and back.
    """

    name: str
    to_si: Callable[[float], float]
    from_si: Callable[[float], float]


MAX_DOCUMENT_SEED = (1 << 64) - 1
"""Seeds have at most 64 bits."""


class Units:
    """Units that people give, where fields have metres, radians and shares."""

    millimetres = DisplayUnit("mm", lambda x: 1e-3 * x, lambda x: 1e3 * x)
    # As in files of motions and gaps: differs from the product in the last digit.
    millimetres_by_division = DisplayUnit("mm", lambda x: x / 1000.0, lambda x: 1000.0 * x)
    degrees = DisplayUnit("deg", math.radians, math.degrees)
    percent = DisplayUnit("percent", lambda x: x / 100.0, lambda x: 100.0 * x)


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What a field says about itself.

    Attributes:
        help: what it means, for people, without a full stop; another field in braces, such as
            `{lift_height}`, is told by its option. Of a field that is true by default: what it
            means that it is false, which its option makes it.
        unit: that people give it in; None if that is the field's own.
        name: of the option, without dashes; the field's and the unit's name if empty.
        flags: short names of the option, such as `-n`.
        metavar: what stands for the value in a help text; chosen by type and unit if empty.
        choices: the values there are; any if empty.
        low, above, high: bounds of the value as people give it: from, more than, at most.
        infinite: whether `inf` may be given.
        noun: what a value is called in a message.
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
    noun: str = "number"

    def option(self, field: str) -> str:
        """The long option of a field that has this to say, such as `--lift-mm`."""
        unit = "" if self.unit is None else f"_{self.unit.name}"
        return f"--{(self.name or field + unit).replace('_', '-')}"


def setting(default: Any = MISSING, help: str = "", **more: Any) -> Any:
    """A field of a settings dataclass, as `dataclasses.field`.

    Args:
        default: its value unless another one is given.
        help: see `Setting`, which has all the rest.
    """
    return field(default=default, metadata={"setting": Setting(help=help, **more)})


def declared_fields(settings: type) -> dict[str, tuple[Field[Any], Setting]]:
    """The fields of a settings dataclass that say something about themselves, by name."""
    return {f.name: (f, f.metadata["setting"]) for f in fields(settings) if "setting" in f.metadata}


def option_name(settings: type, name: str) -> str:
    """The long option of a declared field, such as `--lift-mm`."""
    return declared_fields(settings)[name][1].option(name)


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


def require_ascending(settings: WithRanges) -> None:
    """Refuses pairs of values that fall.

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
    """Refuses numbers that are NaN or infinite, of a document that a program has made: `min`, `max`
    and comparisons let some of them pass. Those of a file are checked when it is read.

    Raises:
        FieldError: names the first one by its key.
    """
    for place, number in _numbers_with_places(document, ()):
        if not math.isfinite(number):
            key = "".join(f"[{k}]" if isinstance(k, int) else f".{k}" for k in place)
            raise FieldError(f"{key.lstrip('.')} is {number}; it must be a finite number", *place)


def _numbers_with_places(
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
        yield from _numbers_with_places(part, (*place, key))
