"""A trial of the hand alone or of the whole arm as a Meshcat recording that plays in a loop."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np
from pydrake.geometry import Meshcat, MeshcatAnimation

from burg_drake.core import Array, MarginNames, display_order, format_column_values
from burg_drake.motion import Plan
from burg_drake.simulation import ArmTrial, HandTrial, MujocoTrial, TrialResult
from burg_drake.station import FloatingHand
from burg_drake.visualization.meshcat_drawing import aim_at
from burg_drake.visualization.scene_view import draw_board, robot_points, scene_points

FRAMES_PER_SECOND = 32.0
PREFERRED_HEADING = (0.73, -0.68)
"""Preferred heading from the grasp to the camera, in the world: across from an arm."""
CAMERA_DISTANCE = 0.80
"""Horizontal distance of the camera from the grasp, in metres. Farther objects do not hide it."""
SIGHT_CLEARANCE = 0.10
"""Preferred clearance of other objects from the line of sight, in metres."""
REPLAY_MARGINS = display_order(
    (
        *("lift", "slip", "tilt", "pad_force", "patch_area", "others_moved", "others_turned"),
        *("pushed", "tracking_error"),
    ),
    MarginNames.trial,
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
    """Executes a grasp again and records it in Meshcat, where it plays in a loop.

    If the open hand collides, shows it instead, at the pose in collision: the grasp, or the start
    of the approach.

    Args:
        trial: built like the trial to be shown, and in `meshcat`. With `Engine.whole_trial` it is
            shown to its end, beyond the moment at which its outcome was decided.
        instance: name of the target in the scene.
        X_OG: (4, 4) grasp in the target's frame.
        meshcat: where the trial is shown.
        friction, mass, lift: as in the trial to be shown.

    Returns:
        Result of the trial, the same as without recording.

    Raises:
        InvalidInputError: as `HandTrial.run`.
    """
    scene, station = trial.scene, trial.station
    X_WG = trial.X_WG(instance, X_OG)
    hand = _show_start(trial, _start_pose(trial, instance, X_WG))
    draw_board(scene, station, meshcat, labels=False)
    others = [trial.diagram.X_WO(name)[:3, 3] for name in scene.instances if name != instance]
    offset = camera_offset(X_WG, np.reshape(others, (-1, 3)))
    steps = [path.length * path.direction_W for path in trial.lift_paths(X_WG, lift)]
    on_way = [hand + p_W for p_W in np.cumsum(steps, axis=0)]
    aim_at(meshcat, np.vstack([scene_points(scene, station), hand, *on_way]), -offset)
    with _recording(meshcat):
        result = trial.run(instance, X_OG, friction=friction, mass=mass, lift=lift)
    if result.margins.end_time > 0.0:
        _publish_loop(meshcat)
    return result


@contextlib.contextmanager
def _recording(meshcat: Meshcat) -> Iterator[None]:
    """Records what the block shows."""
    meshcat.StartRecording(FRAMES_PER_SECOND, set_visualizations_while_recording=False)
    yield
    meshcat.StopRecording()


def _publish_loop(meshcat: Meshcat) -> None:
    """Publishes the recording as a loop."""
    recording = meshcat.get_mutable_recording()
    recording.set_autoplay(True)
    recording.set_loop_mode(MeshcatAnimation.LoopMode.kLoopRepeat)
    recording.set_repetitions(10_000)
    meshcat.PublishRecording()


def camera_offset(X_WG: Array, p_WB: Array) -> Array:
    """Displacement (3,) of the camera from the grasp, in the axes of the world [m].

    Looks across the closing direction, not from behind the hand, past other objects (M, 3), and
    otherwise from about `PREFERRED_HEADING`.
    """
    camera_height = 0.42  # Metres.
    angle = np.deg2rad(np.arange(0.0, 360.0, 15.0))
    headings = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    closing, approach = X_WG[:3, 0], X_WG[:3, 2]
    cost = (
        (headings @ closing) ** 2
        + 1.5 * np.maximum(headings @ -approach, 0.0)
        + 0.3 * np.array([min(_count_view_blockers(X_WG[:3, 3], h, p_WB), 2) for h in headings])
        + 0.25 * (1.0 - headings[:, :2] @ PREFERRED_HEADING)
    )
    return CAMERA_DISTANCE * headings[np.argmin(cost)] + (0.0, 0.0, camera_height)


def _count_view_blockers(p_WG: Array, heading: Array, p_WB: Array) -> int:
    """Number of points (M, 3) within `SIGHT_CLEARANCE` of the horizontal line of sight."""
    offset = (p_WB - p_WG) * (1.0, 1.0, 0.0)
    along = offset @ heading
    beside = np.linalg.norm(offset - along[:, None] * heading, axis=1)
    return int(((along > 0.02) & (along < CAMERA_DISTANCE) & (beside < SIGHT_CLEARANCE)).sum())


def describe_trial(result: TrialResult) -> list[str]:
    """Lines of text with the outcome and its margins."""
    min_displacement = 5e-5  # Metres. Smaller displacements are not listed.
    margins = result.margins
    lines = [result.outcome.value.replace("_", " ")]
    if result.blocker:
        depth = f", {margins.overlap * 1e3:.1f} mm deep" if margins.overlap > 0.0 else ""
        lines[0] += f" ({result.blocker}{depth})"
    if result.reason:
        lines.append(result.reason)
    figures = format_column_values(margins.of_trial(), REPLAY_MARGINS)
    moved = sorted(result.displacements.items(), key=lambda item: -item[1])
    pushed = [f"{name} {far * 1e3:.1f} mm" for name, far in moved if far >= min_displacement]
    lines += [figures] if figures else []
    lines += [f"touched against the plan: {result.touched}"] if result.touched else []
    lines += [f"moved {', '.join(pushed)}"] if pushed else []
    return lines + ([f"toppled {result.toppled}"] if result.toppled else [])


def _start_pose(trial: HandTrial | MujocoTrial, instance: str, X_WG: Array) -> Array:
    """Pose (4, 4) of the hand to show before the trial: the grasp; or the start of the approach if
    the hand collides only there."""
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
    """Executes a plan again and records it in Meshcat, where it plays in a loop.

    Args:
        trial: built like the trial to be shown, and in `meshcat`. With `transfer` the arm is shown
            from its home posture on; with `Engine.whole_trial` to the end, beyond the moment at
            which the outcome was decided.
        instance: name of the target in the scene.
        X_OG: (4, 4) grasp in the target's frame.
        plan: plan to the grasp.
        meshcat: Meshcat to record in.
        friction, mass: as in the trial to be shown.

    Returns:
        Result of the trial.

    Raises:
        InvalidInputError: as `ArmTrial.run`.
    """
    scene, station = trial.scene, trial.station
    draw_board(scene, station, meshcat, labels=False)
    arm = station.document.arm
    assert arm is not None  # ArmTrial has seen to it
    forward = _side_view_direction(arm.X_WA.matrix()[:3, 3], trial.X_WG(instance, X_OG)[:3, 3])
    points = [scene_points(scene, station), _motion_points(trial, plan)]
    aim_at(meshcat, np.vstack(points), forward)
    with _recording(meshcat):
        result = trial.run(instance, X_OG, plan, friction=friction, mass=mass)
    _publish_loop(meshcat)
    return result


def _side_view_direction(p_WA: Array, p_WG: Array) -> Array:
    """Viewing direction (3,) from the side of arm base and grasp, so that neither hides the
    other."""
    slope = 0.37  # Downward over horizontal part of the direction of view.
    ahead = (p_WG - p_WA)[:2]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    across = np.array([-ahead[1], ahead[0]])
    if across @ PREFERRED_HEADING < 0.0:
        across = -across
    return -np.array([*(0.9 * across + 0.45 * ahead), slope])


def _motion_points(trial: ArmTrial, plan: Plan) -> Array:
    """(N, 3) points around the robot along its planned motion [m]."""
    max_postures = 25  # Of the planned motion, to have in view.
    built = trial.diagram
    context = built.diagram.CreateDefaultContext()
    plant_context = built.plant.GetMyMutableContextFromRoot(context)
    q_robot = built.plant.GetPositions(plant_context)
    places = [joint.position_start() for joint in built.arm_joints]
    q = plan.whole.q
    points = []
    for row in np.unique(np.linspace(0, len(q) - 1, max_postures).astype(int)):
        q_robot[places] = q[row]
        built.plant.SetPositions(plant_context, q_robot)
        points.append(robot_points(built, context))
    return np.vstack(points)
