"""`burg-drake grasps`: sample, score, look at, compare and exchange grasps."""

from __future__ import annotations

from typing import Any

from burg_drake.apps import (
    grasps_convert,
    grasps_sample,
    grasps_score,
    grasps_show,
    grasps_stats,
)
from burg_drake.apps.arguments import add_group


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "grasps", "sample, score, look at, compare and exchange grasps")
    for module in (grasps_sample, grasps_score, grasps_show, grasps_convert, grasps_stats):
        module.add_to(group)
