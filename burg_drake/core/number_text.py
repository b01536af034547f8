"""Numbers as text for display: three digits, thousands separators."""

from __future__ import annotations

import math

MISSING_NUMBER = "-"
"""Stands for an unknown number."""
NO_VALUE = "·"
"""Stands for zero, or for a value that does not exist, in tables of counts and figures."""


def format_number(value: float | None, decimals: int | None = None) -> str:
    """A number, in at most eight characters unless decimals are asked for.

    Args:
        value: the number; None and NaN mean unknown.
        decimals: number of decimals below 100,000; three significant digits if None, or above.
    """
    if value is None or math.isnan(value):
        return MISSING_NUMBER
    if math.isinf(value):
        return "inf" if value > 0.0 else "-inf"
    if decimals is not None and abs(value) < 1e5:
        return f"{round(value, decimals) + 0.0:.{decimals}f}"
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.3g}")
    if 1e-3 <= abs(rounded) < 1e3:
        return f"{rounded:g}"
    if 1e3 <= abs(rounded) < 1e6:
        return f"{rounded:,.0f}"
    digits, _, exponent = f"{value:.2e}".partition("e")
    return f"{float(digits):g}e{int(exponent)}"


def format_count(value: int | None) -> str:
    """A whole number; from a billion on, three digits of it."""
    if value is None:
        return MISSING_NUMBER
    return f"{value:,}" if abs(value) < 1_000_000_000 else format_number(float(value))


def count_with_noun(count: int, noun: str) -> str:
    """A count with its noun, such as `1 object` and `2,000 objects`."""
    return f"{format_count(count)} {noun}{'' if count == 1 else 's'}"


def format_percent(share: float) -> str:
    """A share (0 to 1) as a percentage."""
    if math.isnan(share):
        return MISSING_NUMBER
    return f"{100 * share:.0f} %" if share in (0.0, 1.0) else f"{100 * share:.1f} %"


def format_duration(seconds: float) -> str:
    """A duration [s] with three digits and a unit."""
    if math.isnan(seconds):
        return MISSING_NUMBER
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if seconds >= size:
            return f"{format_number(seconds / size)} {unit}"
    return f"{format_number(seconds * 1e6)} µs"
