"""What the options of `evaluate` ask for, of one scene and of many alike."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from burg_drake.apps.options import grasps_per_object, settings_from

if TYPE_CHECKING:
    from burg_drake.core.grasps import Mode
    from burg_drake.evaluation.records import EvaluationSettings
    from burg_drake.station.document import GraspMotion


def requested_settings(
    arguments: argparse.Namespace, mode: Mode, motion: GraspMotion
) -> EvaluationSettings:
    """The settings that options ask for, on a station that has this mode and motion."""
    from burg_drake.evaluation.records import EvaluationSettings

    return settings_from(
        arguments,
        EvaluationSettings,
        grasps_per_object=grasps_per_object(arguments),
        only=arguments.only,
        mode=mode,
        motion=motion,
        scene_reports=arguments.scene_reports,
    )
