"""Scenes with objects away from their planned poses, by random errors or as measured.

The robot moves to the planned grasp, so X_WG stays. With O the frame of an object as planned and D
its frame as displaced, the object is grasped at X_DG = inv(X_WD) X_WO X_OG.

Random placement errors follow from the seed, the object's name and the number of the scene. Errors
that make objects overlap or leave the board are redrawn. Measured poses are corrected where
measuring errors make objects float, sink or overlap a little.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from burg_drake.core import (
    Array,
    BurgError,
    InvalidInputError,
    Pose,
    Units,
    inverse,
    portable_reference,
    rng_from,
    rot_z,
    rotation_angle,
    setting,
)
from burg_drake.evaluation import Candidates
from burg_drake.experiment.trials.trial_sheet import ObjectPlace
from burg_drake.scene import TOUCH_TOLERANCE, Scene, SceneIssue, save_scene


def displaced_scene(scene: Scene, X_SO: Mapping[str, Array]) -> Scene:
    """A scene with some free objects displaced.

    Args:
        scene: as planned.
        X_SO: (4, 4) poses in the scene frame by name of an instance. Poses that equal the planned
            ones bit for bit change nothing; if all do, the scene itself is returned.
    """
    instances = tuple(
        replace(instance, X_SO=Pose.from_matrix(X_SO[name], quaternion=True))
        if name in X_SO and not np.array_equal(X_SO[name], instance.X_SO.matrix())
        else instance
        for name, instance in scene.instances.items()
    )
    if instances == scene.document.instances:
        return scene
    document = replace(scene.document, instances=instances, origin=None)
    return Scene(document, scene.library, scene.path)


def save_displaced_scene(scene: Scene, path: Path) -> None:
    """Writes a scene to its own file, with the path of its library relative to the file.

    Raises:
        InvalidInputError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    library = portable_reference(scene.library.root, path.parent)
    save_scene(replace(scene.document, library=library), path)


def grasps_as_commanded(planned: Scene, displaced: Scene, instance: str, X_OG: Array) -> Array:
    """(N, 4, 4) or (4, 4) grasps in the frame of the displaced object, for a hand that moves to the
    planned poses.

    Args:
        planned, displaced: the scene as planned and as displaced.
        instance: the target.
        X_OG: (N, 4, 4) or (4, 4) grasps as planned; returned unchanged if the object is not
            displaced.
    """
    X_SO, X_SD = planned.X_SO(instance), displaced.X_SO(instance)
    if np.array_equal(X_SO, X_SD):
        return X_OG
    X_DO = inverse(X_SD) @ X_SO
    moved: Array = X_DO @ X_OG
    moved[..., 3, :] = (0.0, 0.0, 0.0, 1.0)
    return moved


def candidates_as_commanded(planned: Scene, displaced: Scene, candidates: Candidates) -> Candidates:
    """Applies `grasps_as_commanded` to all grasps of a run; ids stay the same."""
    X_OG = candidates.grasps.X_OG.copy()
    for name in np.unique(candidates.instance).tolist():
        rows = candidates.instance == name
        X_OG[rows] = grasps_as_commanded(planned, displaced, name, X_OG[rows])
    return Candidates(replace(candidates.grasps, X_OG=X_OG), candidates.instance)


MAX_PLACEMENT_DRAWS = 200
"""Maximum number of draws for one object. If all are rejected, the object stays as planned."""


@dataclass(frozen=True, kw_only=True)
class PlacementNoise:
    """Random errors of object placement.

    Attributes:
        place: standard deviation along x and along y of the scene frame [m].
        turn: standard deviation of the turn about z [rad].
        seed: random seed of the errors.
    """

    place: float = setting(
        0.002,
        "standard deviation along x and y",
        unit=Units.millimetres_by_division,
        name="placement_sd_mm",
        low=0,
    )
    turn: float = setting(
        math.radians(2.0),
        "standard deviation about the vertical",
        unit=Units.degrees,
        name="placement_sd_deg",
        low=0,
    )
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("place", "turn"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InvalidInputError(
                    f"noise of the {name} is {getattr(self, name):g}; give 0 or more"
                )


@dataclass(frozen=True, eq=False)
class NoisyScene:
    """A scene with randomly displaced objects.

    Attributes:
        scene: the scene.
        draws: number of redraws of each object.
        kept: objects that stay as planned, because all `MAX_PLACEMENT_DRAWS` draws were rejected.
    """

    scene: Scene
    draws: dict[str, int]
    kept: tuple[str, ...] = ()

    @property
    def redrawn(self) -> int:
        """Number of rejected draws."""
        return sum(self.draws.values())


def noisy_scene(
    scene: Scene,
    noise: PlacementNoise,
    number: int,
    issues: Callable[[Scene], Iterable[SceneIssue]],
) -> NoisyScene:
    """Displaces every free object.

    Args:
        scene: as planned, without errors.
        noise: placement errors.
        number: number of the displaced scene, from which the errors follow, as from the seed.
        issues: finds the issues of a scene, such as `SceneCheck.issues`. Issues of the planned
            scene are ignored.

    Returns:
        A scene without errors: objects involved in an error are drawn again.
    """
    if noise.place == noise.turn == 0.0:
        return NoisyScene(scene, dict.fromkeys(scene.instances, 0))
    draws = dict.fromkeys(scene.instances, 0)
    while True:
        X_SO = {
            name: draw_displaced_pose(scene, name, noise, number, draws[name])
            for name in scene.instances
            if draws[name] < MAX_PLACEMENT_DRAWS
        }
        drawn = displaced_scene(scene, X_SO)
        rejected = _objects_to_redraw(issues(drawn), X_SO)
        if not rejected:
            kept = tuple(name for name in draws if name not in X_SO)
            return NoisyScene(drawn, draws, kept)
        for name in rejected:
            draws[name] += 1


def draw_displaced_pose(
    scene: Scene, name: str, noise: PlacementNoise, number: int, draw: int
) -> Array:
    """(4, 4) pose of an object in the scene frame with random errors of position and of turn about
    the vertical through its middle.
    """
    rng = rng_from("placement noise", noise.seed, name, number, draw)
    x, y, turn = rng.standard_normal(3)
    return move_on_board(scene, name, noise.place * np.array([x, y, 0.0]), noise.turn * float(turn))


def move_on_board(scene: Scene, name: str, p_S: Array, angle: float) -> Array:
    """(4, 4) pose of an object in the scene frame, moved by `p_S` (3,) [m] and turned by `angle`
    [rad] about the vertical through the middle of its box."""
    X_SO = scene.X_SO(name)
    if angle == 0.0 and not np.any(p_S):
        return X_SO
    p_SM, R = _object_center(scene, name), rot_z(angle)
    X = X_SO.copy()
    X[:3, :3] = R @ X_SO[:3, :3]
    X[:3, 3] = p_SM + R @ (X_SO[:3, 3] - p_SM) + p_S
    return X


def _objects_to_redraw(issues: Iterable[SceneIssue], movable: Iterable[str]) -> set[str]:
    """Movable objects involved in errors; of an overlap both objects."""
    pairs = ((issue.instance, issue.other) for issue in issues if issue.is_error)
    return {name for pair in pairs for name in pair}.intersection(movable)


MAX_HEIGHT_ERROR = 0.005  # metres; a larger difference in height is real
MAX_TILT_ERROR = math.radians(5.0)  # an object with a larger tilt has fallen over

Issues = Callable[[Scene], Iterable[SceneIssue]]
"""Finds the issues of a scene, such as `SceneCheck.issues`."""


@dataclass(frozen=True, eq=False)
class MeasuredScene:
    """A scene built from measured poses.

    Attributes:
        scene: the scene; None if it is impossible.
        notes: deviations from the measurements, one clause each.
        reason: reason for an impossible scene, one line; empty if there is a scene.
    """

    scene: Scene | None
    notes: tuple[str, ...] = ()
    reason: str = ""


def measured_scene(
    scene: Scene, placement: Mapping[str, ObjectPlace], issues: Issues
) -> MeasuredScene:
    """Builds the scene with its free objects at their measured poses.

    Args:
        scene: as planned.
        placement: measured placement by instance. Objects that are uncertain, not seen or not
            listed stay as planned.
        issues: finds the issues of a scene, such as `SceneCheck.issues`.
    """
    unknown = [name for name in placement if name not in (*scene.instances, *scene.background)]
    if unknown:
        return MeasuredScene(None, (), f"the scene has no {unknown[0]!r}, although it was measured")
    X_SO: dict[str, Array] = {}
    notes: list[str] = []
    for name in scene.instances:
        place = placement.get(name)
        if place is None or place.status != "measured" or place.X_SO is None:
            reason = "not measured" if place is None else place.status.replace("_", " ")
            notes.append(f"{name} as planned ({reason if reason != 'measured' else 'no pose'})")
            continue
        X_SO[name], note = correct_height_and_tilt(scene.X_SO(name), place.X_SO.matrix())
        notes += [f"{name} {note}"] if note else []
    try:
        return _separate_objects(scene, X_SO, issues, notes)
    except BurgError as error:
        return MeasuredScene(None, tuple(notes), " ".join(str(error).split()))


def correct_height_and_tilt(planned: Array, measured: Array) -> tuple[Array, str]:
    """Replaces height and tilt of a measured pose by the planned ones, if they differ by measuring
    errors only.

    An object stands in one of its stable poses, so a measurement only tells its position and its
    turn about the vertical.

    Args:
        planned, measured: (4, 4) poses in the scene frame.

    Returns:
        The pose, and a description of the correction; empty below 0.1 mm and 0.1 degrees.
    """
    if np.array_equal(planned, measured):
        return planned, ""
    R_turned = _rotation_about_z(measured[:3, :3] @ planned[:3, :3].T) @ planned[:3, :3]
    tilt = float(rotation_angle(R_turned.T @ measured[:3, :3]))
    height = float(measured[2, 3] - planned[2, 3])
    if tilt > MAX_TILT_ERROR or abs(height) > MAX_HEIGHT_ERROR:
        return measured, ""
    X = measured.copy()
    X[:3, :3], X[2, 3] = R_turned, planned[2, 3]
    parts = []
    if abs(height) > 1e-4:
        parts.append(f"{1e3 * abs(height):.1f} mm {'lower' if height > 0 else 'higher'}")
    if tilt > math.radians(0.1):
        parts.append(f"upright by {math.degrees(tilt):.1f} degrees")
    return X, f"{' and '.join(parts)} than measured" if parts else ""


def _rotation_about_z(R: Array) -> Array:
    """(3, 3) rotation about z nearest to R."""
    angle = math.atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _separate_objects(
    scene: Scene, X_SO: dict[str, Array], issues: Issues, notes: list[str]
) -> MeasuredScene:
    """Moves slightly overlapping objects of a scene apart."""
    max_iterations = 20
    max_shift = 0.005  # metres
    start = displaced_scene(scene, X_SO)
    separated, shift = start, {name: np.zeros(3) for name in scene.instances}
    for _ in range(max_iterations):
        errors = [issue for issue in issues(separated) if _is_significant(issue)]
        if not errors:
            break
        for issue in errors:
            if issue.kind != "overlap" or issue.other not in scene.instances:
                return MeasuredScene(None, tuple(notes), issue.message)
            half = _half_overlap(separated, issue)
            shift[issue.instance] += half
            shift[issue.other] -= half
        if any(np.linalg.norm(p) > max_shift for p in shift.values()):
            return MeasuredScene(None, tuple(notes), errors[0].message)
        moved = {*X_SO, *_shifted_objects(shift)}
        poses = {name: move_on_board(start, name, shift[name], 0.0) for name in moved}
        separated = displaced_scene(scene, poses)
    else:
        return MeasuredScene(None, tuple(notes), errors[0].message)
    notes += [
        f"{name} moved by {1e3 * np.linalg.norm(shift[name]):.1f} mm, out of another object"
        for name in _shifted_objects(shift)
    ]
    return MeasuredScene(separated, tuple(notes))


def _is_significant(issue: SceneIssue) -> bool:
    """Whether an issue makes a trial in the measured scene differ from the real trial. The board is
    paper, so objects may stand beside it; a hovering object falls, which matters only if it falls
    far.
    """
    if issue.kind == "out_of_bounds":
        return issue.amount > 0.05  # metres
    return issue.is_error or issue.amount > MAX_HEIGHT_ERROR


def _half_overlap(scene: Scene, issue: SceneIssue) -> Array:
    """(3,) half the displacement along the board that separates two overlapping objects [m]."""
    one, other = (_object_center(scene, name) for name in (issue.instance, issue.other))
    direction = (one - other) * (1.0, 1.0, 0.0)
    length = float(np.linalg.norm(direction))
    unit = direction / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    return unit * (issue.amount - 0.9 * TOUCH_TOLERANCE) / 2.0


def _object_center(scene: Scene, name: str) -> Array:
    entry, X_SO = scene.entry(name), scene.X_SO(name)
    return X_SO[:3, :3] @ (np.add(entry.lower, entry.upper) / 2.0) + X_SO[:3, 3]


def _shifted_objects(shift: Mapping[str, Array]) -> list[str]:
    return [name for name, p in shift.items() if np.any(p)]
