"""A trial as a Meshcat recording that plays in a loop, live or in a saved page."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from burg_drake.core import Array
from burg_drake.core.grasps import TRIAL_MARGINS, shown_figures, shown_order
from burg_drake.simulation.mujoco import MujocoTrial
from burg_drake.simulation.trials import HandTrial, TrialResult
from burg_drake.station.diagram import FloatingHand
from burg_drake.visualization.meshcat import aim_at
from burg_drake.visualization.scenes.scene import draw_board, robot_points, scene_points

FRAMES_PER_SECOND = 32.0
LOOPS = 10_000
VIEW = (0.73, -0.68)
"""Heading from the grasp to the camera that is preferred, in the world: across from an arm."""
DISTANCE, CAMERA_HEIGHT = 0.80, 0.42
"""The eye looks down in this proportion [m]; objects farther from the grasp than that do not hide
it."""
SHOWN = 5e-5
"""Displacements from here on are told [m]."""
CLEAR_VIEW = 0.10
"""How far other objects should be beside the line of sight [m]."""


FIGURES = shown_order(
    (
        *("lift", "slip", "tilt", "pad_force", "patch_area", "others_moved", "others_turned"),
        *("pushed", "tracking_error"),
    ),
    TRIAL_MARGINS,
    without=(
        "overlap",  # with what the hand is in
        "clearance",  # of the open hand, before anything moves
        "end_time",  # seen
        "tracking_distance",  # as the error of the joints
    ),
)
"""Margins of a trial that are shown, in this order."""


def record_trial(
    trial: HandTrial | MujocoTrial,
    instance: str,
    X_OG: Array,
    meshcat: Meshcat,
    *,
    friction: float | None = None,
    mass: float | None = None,
    lift: float | None = None,
) -> TrialResult:
    """Executes a grasp once more and leaves the recording in Meshcat, where it plays in a loop.

    A grasp whose open hand collides leaves a still picture of that, where it does: at the grasp, or
    where the approach begins.

    Args:
        trial: as that to be shown, and in `meshcat`. With `Engine.whole_trial` it is shown to its
            end, beyond the moment at which its outcome was decided.
        instance: name of the target in the scene.
        X_OG: (4, 4) grasp in the target's frame.
        meshcat: where the trial is shown.
        friction, mass, lift: as in the trial to be shown.

    Returns:
        What became of the trial; the same as without a picture.

    Raises:
        InvalidInputError: as `HandTrial.run`.
    """
    scene, station = trial.scene, trial.station
    X_WG = trial.X_WG(instance, X_OG)
    hand = _show_start(trial, _still_pose(trial, instance, X_WG))
    draw_board(scene, station, meshcat, labels=False)
    others = [trial.diagram.X_WO(name)[:3, 3] for name in scene.instances if name != instance]
    offset = camera_offset(X_WG, np.reshape(others, (-1, 3)))
    steps = [path.length * path.direction_W for path in trial.lift_paths(X_WG, lift)]
    on_way = [hand + p_W for p_W in np.cumsum(steps, axis=0)]
    aim_at(meshcat, np.vstack([scene_points(scene, station), hand, *on_way]), -offset)
    meshcat.StartRecording(FRAMES_PER_SECOND, set_visualizations_while_recording=False)
    result = trial.run(instance, X_OG, friction=friction, mass=mass, lift=lift)
    meshcat.StopRecording()
    if result.margins.end_time > 0.0:
        play_in_a_loop(meshcat)
    return result


def play_in_a_loop(meshcat: Meshcat) -> None:
    """Publishes what was recorded."""
    recording = meshcat.get_mutable_recording()
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    recording.set_repetitions(LOOPS)
    meshcat.PublishRecording()


def camera_offset(X_WG: Array, p_WB: Array) -> Array:
    """From the grasp towards the eye (3,) in the axes of the world [m].

    Looks across the closing direction, not from behind the hand, past other objects (M, 3), and
    otherwise from about `VIEW`.
    """
    angle = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    headings = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    closing, approach = X_WG[:3, 0], X_WG[:3, 2]
    cost = (
        (headings @ closing) ** 2
        + 1.5 * np.maximum(headings @ -approach, 0.0)
        + 0.3 * np.array([min(_blocks_view(X_WG[:3, 3], h, p_WB), 2) for h in headings])
        + 0.25 * (1.0 - headings[:, :2] @ VIEW)
    )
    return DISTANCE * headings[np.argmin(cost)] + (0.0, 0.0, CAMERA_HEIGHT)


def _blocks_view(p_WG: Array, heading: Array, p_WB: Array) -> int:
    """How many points (M, 3) are less than `CLEAR_VIEW` beside the horizontal line of sight."""
    offset = (p_WB - p_WG) * (1.0, 1.0, 0.0)
    along = offset @ heading
    beside = np.linalg.norm(offset - along[:, None] * heading, axis=1)
    return int(((along > 0.02) & (along < DISTANCE) & (beside < CLEAR_VIEW)).sum())


def describe(result: TrialResult) -> list[str]:
    """The outcome and its margins as lines for people."""
    margins = result.margins
    lines = [result.outcome.value.replace("_", " ")]
    if result.blocker:
        depth = f", {margins.overlap * 1e3:.1f} mm deep" if margins.overlap > 0.0 else ""
        lines[0] += f" ({result.blocker}{depth})"
    if result.reason:
        lines.append(result.reason)
    figures = shown_figures(margins.of_trial(), FIGURES)
    moved = sorted(result.displacements.items(), key=lambda item: -item[1])
    pushed = [f"{name} {far * 1e3:.1f} mm" for name, far in moved if far >= SHOWN]
    lines += [figures] if figures else []
    lines += [f"touched against the plan: {result.touched}"] if result.touched else []
    lines += [f"moved {', '.join(pushed)}"] if pushed else []
    return lines + ([f"toppled {result.toppled}"] if result.toppled else [])


def _still_pose(trial: HandTrial | MujocoTrial, instance: str, X_WG: Array) -> Array:
    """Where (4, 4) the hand is seen before the trial: at the grasp, or where the approach begins if
    it is clear at the grasp, but not there."""
    X_WF = trial.X_WG_start(X_WG)
    at_grasp, at_start = (trial.clearance.check(instance, X).outcome for X in (X_WG, X_WF))
    return X_WF if at_grasp is None and at_start is not None else X_WG


def _show_start(trial: HandTrial | MujocoTrial, X_WG: Array) -> Array:
    """Shows the hand at a pose; returns points (N, 3) around it [m]."""
    station_diagram = trial.diagram
    context = station_diagram.diagram.CreateDefaultContext()
    plant_context = station_diagram.plant.GetMyMutableContextFromRoot(context)
    FloatingHand(station_diagram).place(plant_context, X_WG)
    station_diagram.diagram.ForcedPublish(context)
    return robot_points(station_diagram, context)
