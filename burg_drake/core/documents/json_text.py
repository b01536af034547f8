"""JSON, read within bounds: every JSON that comes from outside is read here."""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.core.errors import DocumentError, quoted
from burg_drake.core.files import DOCUMENT, Limits, read_text

DIGITS = 100
"""Of a whole number, at most. States of random generators have 39, floats 309; Python itself
refuses 4,300."""

_STRING = re.compile(rb'"[^"\\]*+(?:\\.[^"\\]*+)*+"?', re.DOTALL)
"""Never steps back, so that a text without an end takes no longer than another one."""
_STEPS = np.zeros(256, dtype=np.int8)
_STEPS[list(b"[{")] = 1
_STEPS[list(b"]}")] = -1


def load_json(path: str | Path, limits: Limits = DOCUMENT) -> Any:
    """The value of a JSON file.

    Raises:
        DocumentError: it cannot be read, is not JSON, is beyond the limits, or a mapping has a key
            twice; the message names the file, and the line where that is known.
    """
    return parse_json(read_text(path, limits), str(path), limits)


def parse_json(text: str, name: str, limits: Limits = DOCUMENT) -> Any:
    """As `load_json`, from text; `name` stands for the file in messages."""
    _check_extent(text, name, limits)

    def whole(digits: str) -> int:
        if len(digits) > DIGITS:
            line = text.count("\n", 0, text.find(digits)) + 1
            raise DocumentError(
                f"{name}:{line}: {quoted(digits)} has more digits than the {DIGITS} that a whole"
                " number may have"
            )
        return int(digits)

    def mapping(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        result = dict(pairs)
        if len(result) < len(pairs):
            twin = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
            raise DocumentError(f"{name}: {quoted(twin)} appears twice in the same mapping")
        return result

    try:
        return json.loads(text, parse_int=whole, object_pairs_hook=mapping)
    except json.JSONDecodeError as error:
        raise DocumentError(f"{name}:{error.lineno}: not valid JSON: {error.msg}") from error


def _check_extent(text: str, name: str, limits: Limits) -> None:
    """Counts values and levels before anything is built."""
    opened = text.count("[") + text.count("{")
    if opened + text.count(",") > limits.values:
        raise DocumentError(f"{name}: more than {limits.values:,} values; is it the right file?")
    if opened <= limits.depth:
        return
    structure = np.frombuffer(_STRING.sub(b"", text.encode()), dtype=np.uint8)
    steps = _STEPS[structure]
    depth = np.cumsum(steps[steps != 0], dtype=np.int64)
    if depth.max(initial=0) > limits.depth:
        raise DocumentError(f"{name}: nested more than {limits.depth} levels deep")
