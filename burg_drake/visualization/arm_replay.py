"""A trial of the whole arm as a Meshcat recording, from home to the lifted object."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.core.frames import Array
from burg_drake.motion.trajectory import Plan
from burg_drake.scene.scene import Scene
from burg_drake.simulation.arm_trial import ArmTrial
from burg_drake.simulation.result import TrialResult
from burg_drake.simulation.trial_settings import DEFAULT_TRIAL, TrialSettings
from burg_drake.station.engine import ENGINES, Engine
from burg_drake.station.station import Station
from burg_drake.visualization.replay import FRAMES_PER_SECOND, VIEW, play_in_a_loop
from burg_drake.visualization.scene_view import draw_board

DISTANCE, CAMERA_HEIGHT = 1.5, 0.55
"""Of the camera from and above the middle between arm and grasp [m]."""
MIDDLE_HEIGHT = 0.30
"""Of that above the lower of the two [m]."""


def record_arm_trial(
    scene: Scene,
    station: Station,
    instance: str,
    X_OG: Array,
    plan: Plan,
    meshcat: Meshcat,
    *,
    engine: Engine = ENGINES["standard"],
    settings: TrialSettings = DEFAULT_TRIAL,
    friction: float | None = None,
    mass: float | None = None,
) -> TrialResult:
    """Executes a plan once more and leaves the recording in Meshcat, where it plays in a loop.

    The arm is shown from its home posture on, and to the end, beyond the moment at which the
    outcome was decided.

    Args:
        scene, station: as in the trial to be shown.
        instance: name of the target in the scene.
        X_OG: (4, 4) grasp in the target's frame.
        plan: leads to it.
        meshcat: where to show it.
        engine, settings, friction, mass: as in the trial to be shown.

    Returns:
        What became of the whole trial, which began at home.

    Raises:
        InvalidInputError: as `ArmTrial.run`.
    """
    engine = replace(engine, whole_trial=True)
    trial = ArmTrial(
        scene, station, engine=engine, settings=settings, transfer=True, meshcat=meshcat
    )
    draw_board(scene, station, meshcat, labels=False)
    arm = station.document.arm
    assert arm is not None  # ArmTrial has seen to it
    _aim(meshcat, arm.X_WA.matrix()[:3, 3], trial.X_WG(instance, X_OG)[:3, 3])
    meshcat.StartRecording(FRAMES_PER_SECOND, set_visualizations_while_recording=False)
    result = trial.run(instance, X_OG, plan, friction=friction, mass=mass)
    meshcat.StopRecording()
    play_in_a_loop(meshcat)
    return result


def _aim(meshcat: Meshcat, p_WA: Array, p_WG: Array) -> None:
    """Looks at arm base and grasp from the side, so that neither hides the other."""
    ahead = (p_WG - p_WA)[:2]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    across = np.array([-ahead[1], ahead[0]])
    if across @ VIEW < 0.0:
        across = -across
    middle = (p_WA + p_WG) / 2.0
    middle[2] = min(p_WA[2], p_WG[2]) + MIDDLE_HEIGHT
    way = np.array([*(0.9 * across + 0.45 * ahead) * DISTANCE, CAMERA_HEIGHT])
    meshcat.SetCameraPose(middle + way, middle)
