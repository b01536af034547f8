"""`burg-drake trials`: grasps tried on the robot, from their choice to the last entry.

Each verb has a module of its own.
"""

from __future__ import annotations

from typing import Any

from burg_drake.apps.options import add_group
from burg_drake.apps.trials import export, plan, record, restore, serve, sheet, show

VERBS = (
    plan,
    sheet,
    export,
    serve,
    record,
    show,
    restore,
)


def add_to(verbs: Any) -> None:
    """Adds the verbs."""
    group = add_group(verbs, "trials", "plan, export and record trials on your robot")
    for module in VERBS:
        module.add_to(group)
