"""`burg-drake grasps`: sample, score, look at, compare and exchange grasps."""

from __future__ import annotations

from typing import Any

from burg_drake.apps.grasps import convert, sample, score, show, stats
from burg_drake.apps.options import add_group


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "grasps", "sample, score, show, convert and compare grasps")
    for module in (sample, score, show, convert, stats):
        module.add_to(group)
