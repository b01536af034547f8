"""A trial of the whole arm as a Meshcat recording, from home to the lifted object."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat

from burg_drake.core import Array
from burg_drake.motion.plans import Plan
from burg_drake.simulation.trials import ArmTrial, TrialResult
from burg_drake.visualization.meshcat import aim_at
from burg_drake.visualization.scenes.replay import FRAMES_PER_SECOND, VIEW, play_in_a_loop
from burg_drake.visualization.scenes.scene import draw_board, robot_points, scene_points

SLOPE = 0.37
"""By how much the eye looks down, compared with ahead."""
POSTURES = 25
"""Of the planned motion that have to be in view."""


def record_arm_trial(
    trial: ArmTrial,
    instance: str,
    X_OG: Array,
    plan: Plan,
    meshcat: Meshcat,
    *,
    friction: float | None = None,
    mass: float | None = None,
) -> TrialResult:
    """Executes a plan once more and leaves the recording in Meshcat, where it plays in a loop.

    Args:
        trial: as that to be shown, and in `meshcat`. With `transfer` the arm is shown from its home
            posture on; with `Engine.whole_trial` to the end, beyond the moment at which the
            outcome was decided.
        instance: name of the target in the scene.
        X_OG: (4, 4) grasp in the target's frame.
        plan: leads to it.
        meshcat: where the trial is shown.
        friction, mass: as in the trial to be shown.

    Returns:
        What became of the trial.

    Raises:
        InvalidInputError: as `ArmTrial.run`.
    """
    scene, station = trial.scene, trial.station
    draw_board(scene, station, meshcat, labels=False)
    arm = station.document.arm
    assert arm is not None  # ArmTrial has seen to it
    forward = _across(arm.X_WA.matrix()[:3, 3], trial.X_WG(instance, X_OG)[:3, 3])
    points = [scene_points(scene, station), _motion_points(trial, plan)]
    aim_at(meshcat, np.vstack(points), forward)
    meshcat.StartRecording(FRAMES_PER_SECOND, set_visualizations_while_recording=False)
    result = trial.run(instance, X_OG, plan, friction=friction, mass=mass)
    meshcat.StopRecording()
    play_in_a_loop(meshcat)
    return result


def _across(p_WA: Array, p_WG: Array) -> Array:
    """Direction (3,) in which arm base and grasp are seen from the side, neither hiding the
    other."""
    ahead = (p_WG - p_WA)[:2]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    across = np.array([-ahead[1], ahead[0]])
    if across @ VIEW < 0.0:
        across = -across
    return -np.array([*(0.9 * across + 0.45 * ahead), SLOPE])


def _motion_points(trial: ArmTrial, plan: Plan) -> Array:
    """(N, 3) points around the robot on its planned way [m]."""
    built = trial.diagram
    context = built.diagram.CreateDefaultContext()
    plant_context = built.plant.GetMyMutableContextFromRoot(context)
    q_robot = built.plant.GetPositions(plant_context)
    places = [joint.position_start() for joint in built.arm_joints]
    q = plan.whole.q
    points = []
    for row in np.unique(np.linspace(0, len(q) - 1, POSTURES).astype(int)):
        q_robot[places] = q[row]
        built.plant.SetPositions(plant_context, q_robot)
        points.append(robot_points(built, context))
    return np.vstack(points)
