"""`burg-drake trials`: grasps tried on the robot, from their choice to the last entry.

Each verb has a module of its own.
"""

from __future__ import annotations

from typing import Any

from burg_drake.apps import (
    trials_export,
    trials_plan,
    trials_record,
    trials_restore,
    trials_serve,
    trials_sheet,
    trials_show,
)
from burg_drake.apps.arguments import add_group

VERBS = (
    trials_plan,
    trials_sheet,
    trials_export,
    trials_serve,
    trials_record,
    trials_show,
    trials_restore,
)


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(
        verbs, "trials", "choose grasps for the robot, and record what became of them"
    )
    for module in VERBS:
        module.add_to(group)
