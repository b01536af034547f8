"""Options made from settings dataclasses, and settings made from options."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from dataclasses import MISSING, Field
from typing import Any, TypeVar

from burg_drake import core
from burg_drake.apps.options.values import MAX_COUNT, number, two_numbers, whole_number

Settings = TypeVar("Settings")


def add_settings_options(
    parser: Any, settings: type, *names: str, unset: bool = False, shown_default: Any = None
) -> None:
    """Adds an option for each of the given fields.

    Args:
        parser: or group of options, to add the options to.
        settings: the dataclass.
        names: names of the fields; all declared fields if empty.
        unset: whether the value is None if not given, as the default comes from elsewhere; the
            help then shows no default.
        shown_default: default in the help in spite of `unset`.
    """
    known = core.declared_fields(settings)
    options_of = {name: declaration.option(name) for name, (_, declaration) in known.items()}
    for name in names or tuple(known):
        field, declaration = known[name]
        options: dict[str, Any] = {"help": declaration.help.format(**options_of)}
        default = shown_default if unset else default_in_unit(field, declaration)
        if field.type == "bool":
            options["action"] = "store_true"
        else:
            options |= {"default": None if unset else default, **_value_options(field, declaration)}
            if default is not None and "(default" not in declaration.help:
                options["help"] += f" (default: {_value_text(default)})"
        option = declaration.option(name)
        parser.add_argument(*declaration.flags, option, **options)


def _value_options(field: Field[Any], declaration: core.Setting) -> dict[str, Any]:
    """Keyword arguments of `add_argument` for an option with a value."""
    if declaration.choices:
        return {"choices": declaration.choices}
    found: dict[str, Any] = {"type": _value_parser(field, declaration)}
    unit = "" if declaration.unit is None else declaration.unit.name.upper()
    found["metavar"] = declaration.metavar or unit or "N"
    if isinstance(declaration.metavar, tuple):
        found["nargs"] = len(declaration.metavar)
    return found


def default_in_unit(field: Field[Any], declaration: core.Setting) -> Any:
    """The default of a field in the unit of its option; None if it has none."""
    value = None if field.default is MISSING else field.default
    if declaration.unit is None or value is None:
        return value
    return float(f"{declaration.unit.from_si(value):.12g}")


def _value_text(value: Any) -> str:
    """A default as typed on the command line."""
    if isinstance(value, tuple):
        return "x".join(map(str, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def settings_from(
    arguments: argparse.Namespace, settings: type[Settings], **others: Any
) -> Settings:
    """Settings from options; a field without an option keeps its default.

    Args:
        arguments: parsed arguments.
        settings: the dataclass.
        others: values of fields that do not come from one option.
    """
    return settings(**(fields_from_options(arguments, settings) | others))


def fields_from_options(arguments: argparse.Namespace, settings: type) -> dict[str, Any]:
    """The values of fields that are given by options, in SI units."""
    given: dict[str, Any] = {}
    for name, (field, declaration) in core.declared_fields(settings).items():
        destination = core.option_name(settings, name)[2:].replace("-", "_")
        value = getattr(arguments, destination, None)
        if value is None:
            continue
        unit = declaration.unit
        given[name] = value if unit is None else unit.to_si(value)
        if isinstance(value, list):
            given[name] = tuple(value)
        elif field.default is True:
            given[name] = not value
    return given


def _value_parser(field: Field[Any], declaration: core.Setting) -> Callable[[str], Any]:
    """The parser for the value of an option."""
    kind = str(field.type).partition(" ")[0]
    if kind == "int":
        low, high = int(declaration.low or 0), int(declaration.high or MAX_COUNT)
        return lambda text: whole_number(text, low, high)
    if field.type == "tuple[int, int]":
        return two_numbers
    if kind in ("float", "Vector3"):
        return lambda text: parse_in_range(text, declaration)
    return str


def parse_in_range(text: str, declaration: core.Setting) -> float:
    """A number within the bounds of a setting; finite, unless the setting may be infinite.

    Raises:
        argparse.ArgumentTypeError: the text is no such number.
    """
    value = math.inf if declaration.infinite and text.lower() == "inf" else number(text)
    low, above, high = declaration.low, declaration.above, declaration.high
    above_low = (above is None or value > above) and (low is None or value >= low)
    if above_low and (high is None or value <= high):
        return value
    if high is None:
        what = f"above {above:g}" if above is not None else f"below {low:g}"
        raise argparse.ArgumentTypeError(
            f"{core.shorten_text(text)} is {'not ' if above is not None else ''}{what}"
        )
    unit = "" if declaration.unit is None else f" {declaration.unit.name}"
    lowest = -math.inf if low is None else low
    bounds = f"above {above:g}, at most" if above is not None else f"from {lowest:g} to"
    raise argparse.ArgumentTypeError(
        f"{core.shorten_text(text)} is not {declaration.noun} {bounds} {high:g}{unit}"
    )
