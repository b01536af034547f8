"""Answers of planners: checked, and read as grasps in the scene frame.

An answer comes from other people's code. Whatever it holds, it is read or refused with one line.
`burg_planner` tells what an answer holds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.benchmark.burg_planner import Observation
from burg_drake.core import (
    MAX_POSE_COORDINATE,
    Array,
    InvalidInputError,
    inverse,
    quote_value,
    suggest_names,
)
from burg_drake.evaluation import Mistake, correct_poses
from burg_drake.formats import GRASP_FORMATS, GraspFormat, Gripper, nearest_rigid

POSE_ENTRIES = {"X_CG": "camera", "X_WG": "world", "X_SG": "scene"}
"""Entries for the poses of an answer, and the frame that they are measured in."""
OTHER_ENTRIES = ("score", "width", "frame", "time", "observation")
"""All other entries of an answer."""
MAX_WORKSPACE_DISTANCE = 1.0
"""Grasps farther from the workspace than this are taken for errors [m]."""


class AnswerError(InvalidInputError):
    """An answer of a planner that cannot be used; the message names the likely mix-up."""


class FarGraspsError(AnswerError):
    """Most grasps of an answer are far away from the workspace."""


@dataclass(frozen=True, eq=False)
class PlannedGrasps:
    """Grasps of an answer, best first.

    Attributes:
        X_SG: (N, 4, 4) grasps in the scene frame, of the grasp frame G of burg_drake.
        width: (N,) distance between the object's two sides [m]; NaN if not given.
        score: (N,) higher is better; N, N - 1, ... if not given. Equal scores keep their order.
        time: time that planning took [s]; NaN if not given.
        notes: what is odd about the answer, one sentence each.
    """

    X_SG: Array
    width: Array
    score: Array
    time: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class AnsweredPoses:
    """Poses as an answer gives them.

    Attributes:
        entry: the entry that holds them, of `POSE_ENTRIES`.
        format: format with the grasp frame F of the poses.
        X_MG: (N, 4, 4) grasps of G in the frame M of the entry.
        X_SM: (4, 4) pose of M in the scene frame.
        notes: what was changed, one sentence each.
    """

    entry: str
    format: GraspFormat
    X_MG: Array
    X_SM: Array
    notes: tuple[str, ...] = ()


def read_answer(
    answer: Mapping[str, Any],
    observation: Observation,
    gripper: Gripper,
    *,
    max_grasps: int = 100_000,
) -> PlannedGrasps:
    """Reads the answer of a planner.

    Args:
        answer: anything that a planner returned.
        observation: the observation that the planner was given.
        gripper: the hand.
        max_grasps: largest number of grasps.

    Raises:
        AnswerError: the answer cannot be used.
    """
    poses = read_poses(answer, observation, gripper, max_grasps=max_grasps)
    count, notes = len(poses.X_MG), list(poses.notes)
    named = _plain(answer.get("observation"))
    if named is not None and not (isinstance(named, str) and named == observation.id):
        raise AnswerError(
            f"the answer is for observation {quote_value(named)}, but the planner was given"
            f" {observation.id!r}; does it return the answer to an earlier image?"
        )
    score = np.arange(count, 0.0, -1.0)
    if answer.get("score") is not None:
        score = _numbers(answer["score"], "score", count)
        if not np.isfinite(score).all():
            raise AnswerError(
                f"{(~np.isfinite(score)).sum()} of {count} scores are NaN or infinite; leave these"
                " grasps out, or give them the lowest score"
            )
    width, width_notes = _read_widths(answer.get("width"), count, gripper)
    X_SG = poses.X_SM @ poses.X_MG
    far = workspace_distance(X_SG, observation) > MAX_WORKSPACE_DISTANCE
    if far.sum() > 0.5 * count:
        raise FarGraspsError(_far_message(poses, far, observation, gripper))
    if far.any():
        notes.append(
            f"{far.sum()} of {count} grasps are more than {MAX_WORKSPACE_DISTANCE:g} m away from"
            " the workspace; they count as grasps that fail."
        )
    order = np.argsort(-score, kind="stable")
    return PlannedGrasps(
        X_SG=X_SG[order],
        width=width[order],
        score=score[order],
        time=_read_time(answer.get("time")),
        notes=(*notes, *width_notes),
    )


def read_poses(
    answer: Mapping[str, Any],
    observation: Observation,
    gripper: Gripper,
    *,
    max_grasps: int = 100_000,
) -> AnsweredPoses:
    """Reads only the poses of an answer, wherever they are; for arguments see `read_answer`.

    Raises:
        AnswerError: the answer has unknown entries, or no poses that can be used.
    """
    entry = _pose_entry(answer)
    format = _read_frame(answer.get("frame"))
    given = pose_array(answer[entry], entry)
    if len(given) > max_grasps:
        raise AnswerError(f"{entry} has {len(given)} grasps; return the best, {max_grasps} at most")
    _require_rigid(given, entry)
    try:
        X_MF, notes = nearest_rigid(given, entry)
    except InvalidInputError as error:
        raise AnswerError(str(error)) from error
    return AnsweredPoses(
        entry=entry,
        format=format,
        X_MG=X_MF @ inverse(format.X_GF(gripper)),
        X_SM=frame_pose(entry, observation),
        notes=tuple(f"{note}." for note in notes),
    )


def pose_array(value: Any, entry: str) -> Array:
    """The array (N, 4, 4) of an entry; its numbers are not checked.

    Raises:
        AnswerError: it has another type or shape.
    """
    array = _as_numbers(value, entry)
    if array.size == 0 and array.shape[:1] in ((0,), ()):
        return np.empty((0, 4, 4))
    if array.shape[1:] == (4, 4) and array.ndim == 3:
        return array.astype(float)
    advice = {
        (4, 4): "put a single pose into an array of shape (1, 4, 4)",
        (3, 4): "add the row 0 0 0 1 to each pose",
        (17,): "rows of GraspNet have position and rotation in columns 13-15 and 4-12",
        (16,): f"{entry}.reshape(-1, 4, 4) makes matrices of the rows",
        (7,): "make matrices of positions and quaternions",
        (6,): "make matrices of positions and rotation vectors or angles",
        (3, 3): "a pose has a position beside its rotation",
    }
    shape = array.shape if array.shape == (4, 4) else array.shape[1:]
    hint = f"; {advice[shape]}" if shape in advice else ""
    raise AnswerError(f"{entry} has shape {array.shape}; expected (N, 4, 4){hint}")


def frame_pose(entry: str, observation: Observation) -> Array:
    """`X_SM` (4, 4): pose in the scene frame of the frame M that an entry is measured in."""
    X_SW = inverse(observation.X_WS)
    X_SM = {"X_CG": X_SW @ observation.X_WC, "X_WG": X_SW, "X_SG": np.eye(4)}
    return np.asarray(X_SM[entry])


def frame_mistakes(entry: str, observation: Observation) -> dict[Mistake, str]:
    """Mistakes in the frame that poses are measured in, with the line that corrects each.

    Args:
        entry: the entry of the poses, of `POSE_ENTRIES`.
        observation: gives the poses of camera and world.

    Returns:
        Mistakes whose `camera` is the true pose in S of the frame of the poses; the lines are
        Python with numpy.
    """
    X_SM, X_SC = frame_pose(entry, observation), frame_pose("X_CG", observation)
    X_MC = inverse(X_SM) @ X_SC
    opengl, opengl_line = np.diag([1.0, -1.0, -1.0, 1.0]), "np.diag([1.0, -1.0, -1.0, 1.0])"
    X_forward, X_backward = "observation.X_WC", "np.linalg.inv(observation.X_WC)"
    if entry == "X_SG":
        X_forward, X_backward = "np.linalg.inv(observation.X_CS)", "observation.X_CS"
    X_repeated = X_MC
    if entry == "X_CG":
        X_repeated, X_forward = inverse(observation.X_WC), X_backward
    else:
        opengl_line = f"{X_forward} @ {opengl_line} @ {X_backward}"
    found = {
        Mistake(
            f"measured in the {name} frame", camera=frame_pose(other, observation)
        ): f'return {{"{other}": {entry}}}  # in place of {{"{entry}": {entry}}}'
        for other, name in POSE_ENTRIES.items()
        if other != entry
    }
    in_opengl = Mistake(
        "measured in OpenGL's camera frame, with y up and z backward",
        camera=X_SC @ opengl @ inverse(X_MC),
    )
    wrong_way = Mistake(
        "moved by the pose of the camera the wrong way round", camera=X_SM @ X_repeated @ X_repeated
    )
    found[in_opengl] = f"{entry} = {opengl_line} @ {entry}"
    found[wrong_way] = f"{entry} = {X_forward} @ {X_forward} @ {entry}"
    return _with_different_cameras(found, X_SM)


def _with_different_cameras(found: dict[Mistake, str], X_SM: Array) -> dict[Mistake, str]:
    """The mistakes that differ from one another and from the pose (4, 4) of M as stated."""
    different, kept = [X_SM], {}
    for mistake, line in found.items():
        X = mistake.camera
        if X is not None and not any(np.allclose(X, other, atol=1e-6) for other in different):
            different.append(X)
            kept[mistake] = line
    return kept


def workspace_distance(X_SG: Array, observation: Observation) -> Array:
    """(N,) distance of grasps (N, 4, 4) in S from the box of the workspace [m]."""
    low, high = np.asarray(observation.bounds, dtype=float)
    p_SG = X_SG[:, :3, 3]
    outside = np.maximum(0.0, np.maximum(low - p_SG, p_SG - high))
    return np.asarray(np.linalg.norm(outside, axis=-1))


def _far_message(
    poses: AnsweredPoses, far: NDArray[np.bool_], observation: Observation, gripper: Gripper
) -> str:
    """Says that grasps are far away, and how they might be meant."""
    max_near = 0.2  # Distance from the workspace of grasps that are meant [m].
    min_median_distance = 20.0  # Median distance from the origin of M, read as metres.
    mistakes = [*frame_mistakes(poses.entry, observation), Mistake("inverted", ("inverse",))]
    if np.median(np.linalg.norm(poses.X_MG[:, :3, 3], axis=-1)) > min_median_distance:
        mistakes.insert(0, Mistake("in millimetres", ("millimetres",)))
    X_GF = poses.format.X_GF(gripper)
    near = {}
    for mistake in mistakes:
        X_SM = poses.X_SM if mistake.camera is None else mistake.camera
        X_SG = X_SM @ correct_poses(poses.X_MG, X_GF, mistake.correction)
        near[mistake] = (workspace_distance(X_SG, observation) < max_near).mean()
    best = max(near.values())
    meant = [mistake.words for mistake in mistakes if near[mistake] >= max(0.5, 0.9 * best)]
    found = f"; if they are {' or '.join(meant[:2])}, most lie in it" if meant else ""
    return (
        f"{far.sum()} of {len(far)} grasps of {poses.entry} are more than"
        f" {MAX_WORKSPACE_DISTANCE:g} m away from the workspace{found}; give metres, in the"
        f" {POSE_ENTRIES[poses.entry]} frame"
    )


def _pose_entry(answer: Mapping[str, Any]) -> str:
    """The one entry with poses; refuses unknown entries."""
    if not isinstance(answer, Mapping):
        raise AnswerError(
            f"the planner returned {type(answer).__name__}; return a dict with one of"
            f" {', '.join(POSE_ENTRIES)}"
        )
    known = (*POSE_ENTRIES, *OTHER_ENTRIES)
    for name in answer:
        if not isinstance(name, str) or name not in known:
            hint = suggest_names(str(name)[:100], known, ordered=True)
            if isinstance(name, str) and (right := f"X_{name[3:4]}{name[2:3]}") in POSE_ENTRIES:
                hint = f"return the inverse of these poses, {right}"
            raise AnswerError(f"the answer has an unknown entry {quote_value(name)}; {hint}")
    entries = [name for name in POSE_ENTRIES if answer.get(name) is not None]
    if len(entries) != 1:
        frames = ", ".join(f"{name} in the {frame} frame" for name, frame in POSE_ENTRIES.items())
        found = "no poses" if not entries else f"poses in {' and '.join(entries)}"
        raise AnswerError(f"the answer has {found}; return one of {frames}, shape (N, 4, 4)")
    return entries[0]


def _read_frame(value: Any) -> GraspFormat:
    """The format with the grasp frame that an answer names; ours if it names none."""
    name = "burg_drake" if value is None else _plain(value)
    if not isinstance(name, str) or name not in GRASP_FORMATS:
        hint = suggest_names(quote_value(name).strip("'").lower(), GRASP_FORMATS)
        raise AnswerError(
            f"frame {quote_value(name)} of the answer is not the grasp frame of a project; {hint}"
        )
    return GRASP_FORMATS[name]


def _read_widths(value: Any, count: int, gripper: Gripper) -> tuple[Array, tuple[str, ...]]:
    """(N,) widths [m], and notes about impossible ones."""
    if value is None:
        return np.full(count, np.nan), ()
    width = _numbers(value, "width", count)
    impossible = (width < 0.0) | (width > MAX_POSE_COORDINATE)
    if impossible.any():
        raise AnswerError(
            f"{int(impossible.sum())} of {count} widths are negative or infinite; a width is the"
            " distance between the object's two sides in metres, NaN if unknown"
        )
    opening = gripper.opening[1]
    wide = width > opening + 1e-6  # rounding of single precision
    if not wide.any():
        return width, ()
    unit = "; are they in millimetres?" if np.nanmedian(width) > 1.0 else "."
    return width, (
        f"{wide.sum()} of {count} widths are more than the {opening:g} m to which the hand opens,"
        f" up to {np.nanmax(width):.4g} m{unit}",
    )


def _read_time(value: Any) -> float:
    """The time that planning took [s]."""
    if value is None:
        return float("nan")
    number = _plain(value)
    if isinstance(number, (bool, np.bool_)) or not isinstance(number, (int, float, np.number)):
        raise AnswerError(f"time {quote_value(number)} of the answer is not a number of seconds")
    try:
        seconds = float(number)
    except (OverflowError, TypeError):
        seconds = float("inf")
    if not 0.0 <= seconds < float("inf"):
        raise AnswerError(f"time {seconds:g} of the answer is not a number of seconds from 0")
    return seconds


def _numbers(value: Any, name: str, count: int) -> Array:
    """One number for each grasp (N,)."""
    array = _as_numbers(value, name)
    if count == 0 and array.size == 0:
        return np.empty(0)
    if array.shape != (count,):
        hint = f"; {name}[:, 0] has it" if array.shape == (count, 1) else ""
        raise AnswerError(
            f"{name} has shape {array.shape}, but there are {count} grasps; expected"
            f" ({count},){hint}"
        )
    return array.astype(float)


def _as_numbers(value: Any, name: str) -> NDArray[Any]:
    """The array of an entry, of integers or floats."""
    try:
        array = np.asarray(value)
    except Exception as error:  # of anybody's class of arrays
        text = " ".join(str(error).split())[:200]
        raise AnswerError(f"{name} cannot be made an array of numbers: {text}") from error
    if array.dtype.kind not in "iuf":
        what = f"an array of {array.dtype}" if array.ndim else quote_value(value)
        raise AnswerError(f"{name} is {what}; give an array of numbers")
    return array


def _plain(value: Any) -> Any:
    """The value of an array without dimensions; else the value itself."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def is_transposed(X: Array) -> NDArray[np.bool_]:
    """(N,) which matrices (N, 4, 4) have their position in the last row in place of the column."""
    row, column = (np.abs(v - (0.0, 0.0, 0.0, 1.0)).max(axis=-1) for v in (X[:, 3], X[:, :, 3]))
    return np.asarray((row > 1e-6) & (column <= 1e-6))


def is_left_handed(X: Array) -> NDArray[np.bool_]:
    """(N,) which poses (N, 4, 4) have three orthogonal axes that are left-handed."""
    off = _orthonormal_error(X)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray((off < 1e-3) & (np.linalg.det(X[:, :3, :3]) < 0.0))


def _orthonormal_error(X: Array) -> Array:
    """(N,) largest deviation of R' R from the identity."""
    R = X[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # numbers of any size
        off = np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(axis=(1, 2), initial=0.0)
    return np.where(np.isnan(off), np.inf, off)


def _require_rigid(X: Array, entry: str) -> None:
    """Refuses matrices (N, 4, 4) that are no poses, with the likely mix-up."""
    max_error = 1e-3  # of R' R from identity, as of poses with 3 to 4 decimals
    count = len(X)

    def refuse(bad: Any, what: str) -> None:
        if bad.any():
            first = int(np.argmax(bad))
            raise AnswerError(
                f"{bad.sum()} of {count} poses of {entry} {what} (the first is {entry}[{first}])"
            )

    with np.errstate(invalid="ignore"):
        wild = ~np.isfinite(X).all(axis=(1, 2)) | (np.abs(X) > MAX_POSE_COORDINATE).any(axis=(1, 2))
    refuse(wild, "have NaN, infinite or huge numbers; leave these grasps out")
    refuse(~X.any(axis=(1, 2)), "are all zero; leave out the padding")
    refuse(
        is_transposed(X),
        f"are transposed: the position is in the last row; return {entry}.transpose(0, 2, 1)",
    )
    last = np.abs(X[:, 3] - (0.0, 0.0, 0.0, 1.0)).max(axis=-1, initial=0.0)
    refuse(last > 1e-6, "have a last row that is not 0 0 0 1")
    mirrored = is_left_handed(X)
    cause = (
        "an axis is mirrored, or two are swapped, such as y and z"
        if mirrored.all()
        else "the sign of an axis from eigenvectors or singular vectors was not checked"
    )
    refuse(mirrored, f"are left-handed, with determinant -1: {cause}")
    off = _orthonormal_error(X)
    scale = np.linalg.norm(X[:, :3, 0], axis=-1)
    unscaled = X.copy()
    unscaled[:, :3, :3] /= np.maximum(scale, 1e-12)[:, None, None]
    scaled = (off > max_error) & (_orthonormal_error(unscaled) < max_error)
    length = scale[scaled].max(initial=0.0)
    refuse(scaled, f"have axes of length {length:.4g}, in place of 1; leave out the scale")
    refuse(
        off > max_error,
        f"have axes that are not orthonormal, off by up to {off.max(initial=0.0):.2g}; normalize"
        " them, and make them perpendicular to one another",
    )
