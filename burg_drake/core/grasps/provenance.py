"""How sets of grasps say where they come from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def parts_of(provenance: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The provenances of the sets that a set was joined of, which `parts` lists or has by name."""
    parts = provenance.get("parts")
    if isinstance(parts, Mapping):
        parts = list(parts.values())
    return [p for p in parts if isinstance(p, Mapping)] if isinstance(parts, (list, tuple)) else []
