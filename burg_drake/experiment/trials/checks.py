"""Checks of what people write into a trials file; errors lead to the line."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime

from burg_drake.core import FieldError, nearest, quoted


def require_least(value: int, least: int, name: str) -> None:
    """Refuses a number of a document that is too small."""
    if value < least:
        raise FieldError(f"{name} is {value}; it must be at least {least}", name)


def require_known(name: str, known: Iterable[str], what: str, *place: str | int) -> None:
    """Refuses a name that nothing goes by; `what` says of what kind it is."""
    known = list(known)
    if name not in known:
        raise FieldError(f"there is no {what} {quoted(name)}; {nearest(name, known)}", *place)


def require_time(text: str, name: str) -> None:
    """Refuses a time that is not ISO 8601; an empty one is not known."""
    try:
        if text:
            datetime.fromisoformat(text)
    except ValueError as error:
        raise FieldError(
            f"{name} is {quoted(text)}; write it as in 2026-05-04T16:30:00+02:00", name
        ) from error
