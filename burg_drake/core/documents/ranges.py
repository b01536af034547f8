"""Ranges of settings, so that what a document or a row asks for ends in bounded time."""

from __future__ import annotations

from collections.abc import Mapping

from burg_drake.core.errors import FieldError

Ranges = Mapping[str, tuple[float, float]]
"""Smallest and largest value by name of the field."""


def require_ranges(settings: object, ranges: Ranges, what: str = "") -> None:
    """Refuses values outside of their range.

    Args:
        settings: dataclass with the fields.
        ranges: of its fields.
        what: the settings are of, for messages; nothing where the field's name says enough.

    Raises:
        FieldError: a value is outside, or not a number.
    """
    of = f" of {what}" if what else ""
    for name, (low, high) in ranges.items():
        if not low <= (value := getattr(settings, name)) <= high:
            raise FieldError(f"{name}{of} is {value:g}; it must be {low:g} to {high:g}", name)
