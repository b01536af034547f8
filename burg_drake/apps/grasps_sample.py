from __future__ import annotations

from typing import Any


def add_to(group: Any) -> None:
    """Adds the verb."""
