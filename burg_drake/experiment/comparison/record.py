"""A comparison as plain data for other tools: stable keys, null for what is undefined."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

from burg_drake.experiment.comparison.comparison import Comparison


def comparison_json(comparison: Comparison, more: Mapping[str, Any] | None = None) -> str:
    """A comparison as JSON; keys are the names of the dataclasses' fields.

    Args:
        comparison: what is told.
        more: further keys.
    """
    return json.dumps(plain(comparison) | dict(more or {}), indent=2, allow_nan=False) + "\n"


def plain(value: Any) -> Any:
    """Dataclasses as mappings of all their fields, sequences as lists; numbers that are not finite
    are None."""
    if dataclasses.is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
