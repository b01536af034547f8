"""`burg-drake printout`."""

from __future__ import annotations

from typing import Any


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
