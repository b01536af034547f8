"""Settings declared once: what a field of a settings dataclass says about itself.

The command line makes its options of it, see `apps.options`; so that name, unit, range and meaning
of a setting are said in one place, beside the code that uses it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass, field, fields
from typing import Any

KEY = "setting"
"""Of a field's metadata."""


@dataclass(frozen=True)
class ShownUnit:
    """A unit that people give, where a field has SI.

    Attributes:
        name: of the unit; ends the option's name.
        to_si: brings a value to SI.
        from_si: and back.
    """

    name: str
    to_si: Callable[[float], float]
    from_si: Callable[[float], float]


LARGEST_SEED = (1 << 64) - 1
"""Documents have seeds of at most 64 bits."""
MILLIMETRES = ShownUnit("mm", lambda x: 1e-3 * x, lambda x: 1e3 * x)
THOUSANDTHS = ShownUnit("mm", lambda x: x / 1000.0, lambda x: 1000.0 * x)
"""Millimetres by division, as motions and gaps have been written to files: it may differ from the
product in the last digit, and hashes tell."""
DEGREES = ShownUnit("deg", math.radians, math.degrees)
PERCENT = ShownUnit("percent", lambda x: x / 100.0, lambda x: 100.0 * x)


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
    unit: ShownUnit | None = None
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
    return field(default=default, metadata={KEY: Setting(help=help, **more)})


def declared(settings: type) -> dict[str, tuple[Field[Any], Setting]]:
    """The fields of a settings dataclass that say something about themselves, by name."""
    return {f.name: (f, f.metadata[KEY]) for f in fields(settings) if KEY in f.metadata}


def option_of(settings: type, name: str) -> str:
    """The long option of a declared field, such as `--lift-mm`."""
    return declared(settings)[name][1].option(name)
