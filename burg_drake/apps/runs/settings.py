"""What the options of `evaluate` ask for, of one scene and of many alike."""

from __future__ import annotations

import argparse
from typing import Any

from burg_drake.apps.options import DEFAULT_APPROACH_ANGLE
from burg_drake.apps.options import grasps_per_object


def asked_settings(arguments: argparse.Namespace) -> dict[str, Any]:
    """Arguments of `evaluation.cascade.evaluate`: those that need no scene or station."""
    return {
        "grasps_per_object": grasps_per_object(arguments),
        "approach_angle_deg": arguments.approach_angle or DEFAULT_APPROACH_ANGLE,
        "blind": arguments.blind,
        "only": arguments.only,
        "engine": arguments.engine,
        "seed": arguments.seed,
        "workers": arguments.workers,
        "shard": arguments.shard,
        "table": arguments.table,
        "retry_failed": arguments.retry_failed,
        "progress": not arguments.quiet,
    }
