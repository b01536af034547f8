"""Entries as browsers send them: read, or refused with a word why. Nothing here trusts the
sender."""

from __future__ import annotations

import math
from datetime import datetime
from http import HTTPStatus
from typing import Any

from burg_drake.core import BurgError, RequestError, quoted
from burg_drake.core.grasps import RealOutcome
from burg_drake.experiment.pages import LabEntry
from burg_drake.experiment.trials import real_outcome

FIELDS = {
    "plan": str,
    "number": int,
    "replaces": str,
    "outcome": str,
    "time": str,
    "operator": str,
    "note": str,
    "width_mm": float,
}
LONGEST = {"note": 2000, "operator": 100}
"""Characters; of all others 64."""
WIDEST_MM = 10_000.0


def lab_entry(body: dict[str, Any], plan: str) -> LabEntry:
    """The entry in the body of a request.

    Args:
        body: what was sent.
        plan: of the trials file that is served.

    Raises:
        RequestError: a field is unknown, missing, or no such value; another plan.
    """
    for name, value in body.items():
        if name not in FIELDS:
            raise _bad(f"an entry has no {quoted(name)}; it has {', '.join(FIELDS)}")
        if value is not None and not _fits(FIELDS[name], value):
            raise _bad(f"{name} must be a {FIELDS[name].__name__}, not {quoted(value)}")
        if isinstance(value, str):
            _require_line(name, value)
    for name in ("plan", "number", "replaces", "time"):
        if body.get(name) is None:
            raise _bad(f"an entry needs {name}")
    if body["plan"] != plan:
        raise RequestError(HTTPStatus.CONFLICT, "this entry is of another trials file")
    return LabEntry(
        number=body["number"],
        replaces=body["replaces"],
        outcome=_outcome(body.get("outcome")),
        time=_time(body["time"]),
        operator=(body.get("operator") or "").strip(),
        note=(body.get("note") or "").strip(),
        width_mm=_width(body.get("width_mm")),
    )


def trial_number(body: dict[str, Any]) -> int:
    """`number` of a request that is about a trial.

    Raises:
        RequestError: there is none.
    """
    number = body.get("number")
    if not _fits(int, number):
        raise _bad(f"number must be that of a trial, not {quoted(number)}")
    return int(body["number"])


def _fits(kind: type, value: Any) -> bool:
    if isinstance(value, bool):
        return False
    return isinstance(value, (int, float) if kind is float else kind)


def _require_line(name: str, value: str) -> None:
    """Refuses what is too long, and what is not a text: parts of characters, control characters."""
    most = LONGEST.get(name, 64)
    if len(value) > most:
        raise _bad(f"{name} has {len(value)} characters; at most {most}")
    if any(0xD800 <= ord(c) < 0xE000 or (ord(c) < 32 and c not in "\n\t") for c in value):
        raise _bad(f"{name} has characters that are no text")


def _outcome(value: str | None) -> RealOutcome | None:
    if value is None:
        return None
    try:
        return real_outcome(value)
    except BurgError as error:
        raise _bad(str(error)) from error


def _time(value: str) -> str:
    try:
        moment = datetime.fromisoformat(value)
    except ValueError:
        moment = None
    if moment is None or moment.tzinfo is None:
        raise _bad(f"time {quoted(value)} is not a date and time with its zone")
    return moment.isoformat(timespec="seconds")


def _width(value: float | None) -> float | None:
    if value is None:
        return None
    if not math.isfinite(value) or not 0.0 <= value <= WIDEST_MM:
        raise _bad(f"width_mm must be from 0 to {WIDEST_MM:g}, not {quoted(value)}")
    return float(value)


def _bad(message: str) -> RequestError:
    return RequestError(HTTPStatus.BAD_REQUEST, message)
