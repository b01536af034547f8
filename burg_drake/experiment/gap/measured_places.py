"""The scene as it was measured before a trial, with what measuring errors would make impossible put
right: objects that float or sink a little, and such that overlap a little."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from burg_drake.core import Array, BurgError, rotation_angle
from burg_drake.experiment.gap.displacement import displaced_scene
from burg_drake.experiment.gap.placement_noise import moved
from burg_drake.experiment.trials import ObjectPlace
from burg_drake.scene.document import TOUCH_TOLERANCE, Scene, SceneIssue

HEIGHT_ERROR = 0.005
"""An object that stands as planned but for so much of its height was measured wrongly [m]."""
TILT_ERROR = math.radians(5.0)
"""The same for its tilt; what is tilted more has fallen over."""
MAX_SEPARATING_SHIFT = 0.005
"""Largest distance by which objects that were measured within each other are moved apart [m]."""
TRIES = 20
OVER_THE_EDGE = 0.05
"""An object may stand over the board's edge by so much; the board is paper [m]."""

Issues = Callable[[Scene], Iterable[SceneIssue]]


@dataclass(frozen=True, eq=False)
class MeasuredScene:
    """What was made of the measurements.

    Attributes:
        scene: the scene; None if it cannot be, and then `reason` says why.
        notes: what was not taken as measured, one clause each.
        reason: one line; empty if there is a scene.
    """

    scene: Scene | None
    notes: tuple[str, ...] = ()
    reason: str = ""


def measured_scene(
    scene: Scene, placement: Mapping[str, ObjectPlace], issues: Issues
) -> MeasuredScene:
    """The scene with its free objects where they were measured.

    Args:
        scene: as planned.
        placement: where they stood, by instance. What is uncertain or was not seen stays as it was
            planned, and so does what is not named.
        issues: what is wrong with a scene, such as `SceneCheck.issues`.
    """
    unknown = [name for name in placement if name not in (*scene.instances, *scene.background)]
    if unknown:
        return MeasuredScene(None, (), f"the scene has no {unknown[0]!r}, although it was measured")
    X_SO: dict[str, Array] = {}
    notes: list[str] = []
    for name in scene.instances:
        place = placement.get(name)
        if place is None or place.status != "measured" or place.X_SO is None:
            why = "not measured" if place is None else place.status.replace("_", " ")
            notes.append(f"{name} as planned ({why if why != 'measured' else 'no pose'})")
            continue
        X_SO[name], note = upright(scene.X_SO(name), place.X_SO.matrix())
        notes += [f"{name} {note}"] if note else []
    try:
        return _pushed_apart(scene, X_SO, issues, notes)
    except BurgError as error:
        return MeasuredScene(None, tuple(notes), " ".join(str(error).split()))


def upright(target: Array, measured: Array) -> tuple[Array, str]:
    """A measured pose with height and tilt of the planned one, where they differ by no more than
    measuring errors.

    An object stands in one of its stable poses: what a measurement can tell is its place and its
    turn about the vertical.

    Args:
        target, measured: (4, 4) poses in the scene frame.

    Returns:
        The pose, and what was left out of the measured one; nothing if less than 0.1 mm and 0.1
        degrees.
    """
    if np.array_equal(target, measured):
        return target, ""
    R_turned = _about_z(measured[:3, :3] @ target[:3, :3].T) @ target[:3, :3]
    tilt = float(rotation_angle(R_turned.T @ measured[:3, :3]))
    height = float(measured[2, 3] - target[2, 3])
    if tilt > TILT_ERROR or abs(height) > HEIGHT_ERROR:
        return measured, ""
    X = measured.copy()
    X[:3, :3], X[2, 3] = R_turned, target[2, 3]
    parts = []
    if abs(height) > 1e-4:
        parts.append(f"{1e3 * abs(height):.1f} mm {'lower' if height > 0 else 'higher'}")
    if tilt > math.radians(0.1):
        parts.append(f"upright by {math.degrees(tilt):.1f} degrees")
    return X, f"{' and '.join(parts)} than measured" if parts else ""


def _about_z(R: Array) -> Array:
    """(3, 3) the rotation about z that is nearest to R."""
    angle = math.atan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1])
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _pushed_apart(
    scene: Scene, X_SO: dict[str, Array], issues: Issues, notes: list[str]
) -> MeasuredScene:
    """The scene with overlapping objects moved apart, if they are within each other by little."""
    start = displaced_scene(scene, X_SO)
    now, shift = start, {name: np.zeros(3) for name in scene.instances}
    for _ in range(TRIES):
        errors = [issue for issue in issues(now) if _is_error(issue)]
        if not errors:
            break
        for issue in errors:
            if issue.kind != "overlap" or issue.other not in scene.instances:
                return MeasuredScene(None, tuple(notes), issue.message)
            half = _half_overlap(now, issue)
            shift[issue.instance] += half
            shift[issue.other] -= half
        far = [name for name, p in shift.items() if np.linalg.norm(p) > MAX_SEPARATING_SHIFT]
        if far:
            return MeasuredScene(None, tuple(notes), errors[0].message)
        now = displaced_scene(
            scene, {n: moved(start, n, shift[n], 0.0) for n in {*X_SO, *_shifted(shift)}}
        )
    else:
        return MeasuredScene(None, tuple(notes), errors[0].message)
    notes += [
        f"{name} moved by {1e3 * np.linalg.norm(shift[name]):.1f} mm, out of another object"
        for name in _shifted(shift)
    ]
    return MeasuredScene(now, tuple(notes))


def _is_error(issue: SceneIssue) -> bool:
    """Whether a trial would be another one than that of the measured scene. The board is paper;
    what hovers falls, and only much of it is another scene."""
    if issue.kind == "out_of_bounds":
        return issue.amount > OVER_THE_EDGE
    return issue.is_error or issue.amount > HEIGHT_ERROR


def _half_overlap(scene: Scene, issue: SceneIssue) -> Array:
    """(3,) half of the way that brings an object out of another one, along the board [m]."""
    one, other = (_middle(scene, name) for name in (issue.instance, issue.other))
    direction = (one - other) * (1.0, 1.0, 0.0)
    length = float(np.linalg.norm(direction))
    unit = direction / length if length > 1e-9 else np.array([1.0, 0.0, 0.0])
    return unit * (issue.amount - 0.9 * TOUCH_TOLERANCE) / 2.0


def _middle(scene: Scene, name: str) -> Array:
    entry, X_SO = scene.entry(name), scene.X_SO(name)
    return X_SO[:3, :3] @ (np.add(entry.lower, entry.upper) / 2.0) + X_SO[:3, 3]


def _shifted(shift: Mapping[str, Array]) -> list[str]:
    return [name for name, p in shift.items() if np.any(p)]
