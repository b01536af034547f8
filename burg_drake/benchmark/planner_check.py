"""Check of a planner: its grasps of a box and a can tell whether frames and units are right.

The mistakes are those of grasp files, and are found in the same way: by the correction after which
the open hand is clear of the objects and the pads close on them. Mistakes in the frame that the
poses are measured in, and matrices that are no poses, are added here.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.benchmark.answers import (
    POSE_ENTRIES,
    AnsweredPoses,
    AnswerError,
    FarGraspsError,
    PlannedGrasps,
    frame_mistakes,
    is_left_handed,
    is_transposed,
    pose_array,
    read_answer,
    read_poses,
)
from burg_drake.benchmark.burg_planner import Observation
from burg_drake.benchmark.observing import SceneCamera
from burg_drake.benchmark.planners import PlannerError
from burg_drake.cameras import sensor
from burg_drake.core import Array, GraspSet, Pose, inverse
from burg_drake.dataset import camera_looking_at
from burg_drake.evaluation import (
    Mistake,
    MistakeFound,
    correct_poses,
    examine_grasps,
    group_by_instance,
    held_instances,
    width_ratios,
)
from burg_drake.formats import GRASP_FORMATS, Gripper, axis_along
from burg_drake.objects import load_library
from burg_drake.scene import Instance, Scene, SceneDocument, place_objects
from burg_drake.station import Station, StationLike, as_station, station_gripper

MAX_CHECKED_GRASPS = 200
"""Number of the best grasps of an answer that are looked at."""
MIN_HIDDEN_GRASPS = 4
"""Number of grasps, all of one object, that have to show a mistake that other grasps do not."""

Ask = Callable[[Observation, Scene, Station], Mapping[str, Any]]
"""Asks a planner; returns its answer, unread."""


@dataclass(frozen=True, kw_only=True)
class PlannerCheck:
    """What the grasps of a planner show.

    Attributes:
        count: number of grasps in the answer.
        fits: number of grasps that fit as returned, and number of those that were tried. A grasp
            fits if the open hand is clear of the object and the pads close on it.
        problems: mistakes of the planner: a sentence each, and where there is one the line of
            Python that corrects it, on a line of its own.
        time: time that the answer took [s].
        notes: what else is odd, one sentence each.
    """

    count: int = 0
    fits: tuple[int, int] = (0, 0)
    problems: tuple[str, ...]
    time: float = math.nan
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class CheckScene:
    """The scene that planners are checked on: a carton and a can, both standing.

    Attributes:
        scene: the scene.
        station: station with the hand.
        observation: what the planner is given.
    """

    scene: Scene
    station: Station
    observation: Observation

    @property
    def gripper(self) -> Gripper:
        """The hand."""
        return station_gripper(self.station)


def make_check_scene(station: StationLike = "panda_tabletop") -> CheckScene:
    """Renders the scene for a check.

    The carton is 60 mm wide and 158 mm long, so that a hand fits it in one direction only. The
    camera looks along no axis of the scene.

    Raises:
        MissingDependencyError: a system library of the renderer is missing.
    """
    station = as_station(station)
    document = SceneDocument(
        name="planner_check",
        library="household",
        instances=(
            Instance(object="box", X_SO=Pose(translation=(0.2, 0.2, 0.0), rpy_deg=(0, 0, 25.0))),
            Instance(object="can", X_SO=Pose(translation=(0.42, 0.17, 0.0))),
        ),
    )
    scene = place_objects(document, load_library("household"), Path("planner_check.yaml"))
    depth_sensor = sensor("d435")
    camera = SceneCamera(
        intrinsics=depth_sensor.depth_camera((848, 480)),
        X_SC=camera_looking_at(np.array([0.3, 0.2, 0.08]), 0.75, np.pi / 4.0, np.deg2rad(-70.0)),
        depth_range=depth_sensor.depth_range,
    )
    return CheckScene(scene, station, camera.observe(scene, station))


def check_planner(ask: Ask, station: StationLike = "panda_tabletop") -> PlannerCheck:
    """Asks a planner for grasps of a box and a can, and looks for the mistakes in them.

    Args:
        ask: asks the planner, such as `ask` of an open planner.
        station: station with the hand.

    Raises:
        MissingDependencyError: a system library of the renderer is missing.
    """
    seen = make_check_scene(station)
    begun = time.perf_counter()
    try:
        answer = ask(seen.observation, seen.scene, seen.station)
    except PlannerError as error:
        return PlannerCheck(problems=(f"{error}.",), time=time.perf_counter() - begun)
    taken = time.perf_counter() - begun
    found = check_answer(answer, seen)
    return found if math.isfinite(found.time) else replace(found, time=taken)


def check_answer(answer: Mapping[str, Any], seen: CheckScene) -> PlannerCheck:
    """Looks for the mistakes in an answer.

    Args:
        answer: anything that a planner returned.
        seen: the scene that it was given.
    """
    answer, problems = _repair_matrices(answer)
    try:
        read = read_answer(answer, seen.observation, seen.gripper)
        far = False
    except AnswerError as error:
        read, far = None, isinstance(error, FarGraspsError)
        problems = [*problems, f"{_sentence(str(error))}."]
    try:
        poses = read_poses(answer, seen.observation, seen.gripper)
    except AnswerError:
        return PlannerCheck(problems=tuple(problems))
    if not len(poses.X_MG):
        problems.append(
            "There are no grasps, although a carton and a can stand in full view; has the planner"
            " read the depth in metres, and the images as color (H, W, 3) and depth (H, W)?"
        )
        return PlannerCheck(problems=tuple(problems), time=_time(read))
    search = _PlannerSearch(poses, read, seen)
    fits, found = search.examine()
    if found is not None:
        problems = problems[:-1] if far else problems
        problems.append(_problem(found, poses, seen))
    problems += search.width_problems(found)
    notes = () if read is None else read.notes
    return PlannerCheck(
        count=len(poses.X_MG),
        fits=fits,
        problems=tuple(problems),
        time=_time(read),
        notes=notes if found else (*notes, *_fit_notes(fits)),
    )


class _PlannerSearch:
    """Search for the mistake in the poses of an answer, and in its widths."""

    def __init__(self, poses: AnsweredPoses, read: PlannedGrasps | None, seen: CheckScene) -> None:
        """Prepares the best grasps.

        Args:
            poses: poses as given, in the order of the answer.
            read: the answer, best first; None if it was refused.
            seen: the scene.
        """
        self._poses, self._seen = poses, seen
        best = slice(0, MAX_CHECKED_GRASPS)
        self._X_MG = poses.X_MG[best]
        self._width = np.full(len(self._X_MG), np.nan)
        if read is not None:
            self._X_MG = inverse(poses.X_SM) @ read.X_SG[best]
            self._width = read.width[best]

    def examine(self) -> tuple[tuple[int, int], MistakeFound | None]:
        """Number of grasps that fit as returned and of those tried, and the mistake in poses."""
        fits, found = self._examine(self._as_returned)
        if found is not None:
            return fits, found
        return fits, self._hidden_mistake(fits)

    def _examine(
        self, grasps: Mapping[str, GraspSet]
    ) -> tuple[tuple[int, int], MistakeFound | None]:
        frames = [*frame_mistakes(self._poses.entry, self._seen.observation)]
        return examine_grasps(grasps, self._seen.station, self._seen.scene, frames)

    def _hidden_mistake(self, fits: tuple[int, int]) -> MistakeFound | None:
        """A mistake that grasps of one object do not show, as turned ones of a can fit as well: it
        is that of the others if nearly all grasps fit after its correction.

        Args:
            fits: number of grasps that fit as returned, and of those tried.
        """
        fitting, tried = fits
        for name, grasps in self._as_returned.items():
            _, found = self._examine({name: grasps})
            if found is None or found.after < MIN_HIDDEN_GRASPS:
                continue
            (after, _), _ = self._examine(self._by_instance(self._corrected(found.mistake)))
            if after >= max(0.9 * tried, fitting + MIN_HIDDEN_GRASPS):
                return replace(found, before=fitting, after=after, count=tried, only="")
        return None

    def width_problems(self, found: MistakeFound | None) -> list[str]:
        """What is wrong with the widths, after the correction of the poses."""
        if not (self._width > 0.0).any():
            return []
        grasps = self._as_returned
        if found is not None:
            grasps = self._by_instance(self._corrected(found.mistake))
        ratios = width_ratios(grasps, self._seen.station, self._seen.scene)
        if len(ratios) < 3:
            return []
        units = (
            (0.35, 0.6, "half of the distance between the object's two sides", "2.0 * width"),
            (350.0, 600.0, "half widths in millimetres", "2.0 * width / 1000.0"),
            (700.0, 2000.0, "in millimetres", "width / 1000.0"),
            (70.0, 200.0, "in centimetres", "width / 100.0"),
        )
        return [
            f"The widths are {words}, at {count} of the {len(ratios)} grasps that touch an object."
            f" Add to the planner:\n    width = {line}"
            for low, high, words, line in units
            if (count := int(((low < ratios) & (ratios < high)).sum())) >= 0.8 * len(ratios)
        ]

    @cached_property
    def _as_returned(self) -> dict[str, GraspSet]:
        return self._by_instance(self._poses.X_SM @ self._X_MG)

    def _corrected(self, mistake: Mistake) -> Array:
        """(N, 4, 4) grasps in the scene frame after a correction."""
        if mistake.camera is not None:
            return np.asarray(mistake.camera @ self._X_MG)
        X_GF = self._poses.format.X_GF(self._seen.gripper)
        X_MG = correct_poses(self._X_MG, X_GF, mistake.correction)
        return np.asarray(self._poses.X_SM @ X_MG)

    def _by_instance(self, X_SG: Array) -> dict[str, GraspSet]:
        """Grasps (N, 4, 4) in the scene frame, given to the instances that they hold."""
        scene = self._seen.scene
        how = {"format": self._poses.format.name, "X_SM": self._poses.X_SM.tolist()}
        grasps = GraspSet.create(X_SG, object="", width=self._width, provenance=how)
        owner, _ = held_instances(scene, X_SG, self._seen.gripper)
        return group_by_instance(scene, grasps, X_SG, owner)


def _repair_matrices(answer: Mapping[str, Any]) -> tuple[Mapping[str, Any], list[str]]:
    """The answer with matrices made poses where the mistake is clear, and the problems."""
    problems: list[str] = []
    if not isinstance(answer, Mapping):
        return answer, problems
    for entry in POSE_ENTRIES:
        if answer.get(entry) is None:
            continue
        try:
            X = pose_array(answer[entry], entry)
        except AnswerError:
            continue
        if len(X) and is_transposed(X).mean() > 0.5:
            X = X.transpose(0, 2, 1)
            problems.append(
                f"The matrices {entry} are transposed: the position is in the last row. Add to the"
                f" planner:\n    {entry} = {entry}.transpose(0, 2, 1)"
            )
        mirrored = is_left_handed(X)
        if mirrored.any():
            X = X.copy()
            X[mirrored, :3, 1] = np.cross(X[mirrored, :3, 2], X[mirrored, :3, 0])
            problems.append(
                f"{mirrored.sum()} of {len(X)} grasps have left-handed axes, with determinant -1:"
                " an axis is mirrored, or two are swapped. Add to the planner:\n"
                f"    {entry}[:, :3, 1] = np.cross({entry}[:, :3, 2], {entry}[:, :3, 0])"
            )
        if problems:
            answer = {**answer, entry: X}
    return answer, problems


def _problem(found: MistakeFound, poses: AnsweredPoses, seen: CheckScene) -> str:
    """The mistake, its evidence, and the line that corrects it."""
    grasps = f"grasps of the {found.only}" if found.only else "grasps"
    certain = "" if found.is_likely else " perhaps"
    fault = _fault_words(found.mistake, poses, seen.gripper)
    sentences = [
        f"The {grasps} are{certain} {fault}. As returned, {found.before} of the {found.count} that"
        f" were tried fit, and after the correction {found.after}."
    ]
    if found.reach_mm is not None and found.reach_mm[0] < found.reach_mm[1]:
        low, high = sorted(map(abs, found.reach_mm))
        sentences.append(f"Any distance from {low / 1e3:g} to {high / 1e3:g} m fits equally well.")
    if found.alternatives:
        sentences.append(f"Equally many fit {' or '.join(found.alternatives)}.")
    names = _frame_names(found)
    frame = f' this line, or "frame": "{names[0]}" to the answer' if names else ""
    line = _correction_line(found.mistake, poses, seen)
    return " ".join([*sentences, f"Add to the planner{frame}:\n    {line}"])


def _frame_names(found: MistakeFound) -> list[str]:
    """Names of the formats that have their grasps like those that were found."""
    return [format.name for format in GRASP_FORMATS.values() if format.title in found.likeness]


def _fault_words(mistake: Mistake, poses: AnsweredPoses, gripper: Gripper) -> str:
    """What is wrong with the grasps, to follow "the grasps are"."""
    if not mistake.moves_frame:
        return _FAULTS.get("".join(mistake.correction), mistake.words)
    words = []
    if mistake.turn == ("turn:x180",):
        words.append("turned around: z points out of the scene, against the approach")
    elif len(mistake.turn) == 1 and mistake.turn[0].startswith("turn:z"):
        degrees = abs(float(mistake.turn[0].removeprefix("turn:z")))
        words.append(f"turned by {degrees:g} degrees about the approach")
    elif mistake.turn:
        X_GF = poses.format.X_GF(gripper)
        is_now, expected = (
            f"{axis_along(X, (0.0, 0.0, 1.0))} along the approach and"
            f" {axis_along(X, (1.0, 0.0, 0.0))[1:]} along the closing direction"
            for X in (inverse(_frame_correction(mistake, X_GF)) @ X_GF, X_GF)
        )
        words.append(f"turned: their frame has {is_now}, in place of {expected}")
    if mistake.forward:
        way = "behind" if mistake.forward > 0.0 else "ahead of"
        place = f"{abs(mistake.forward) / 1e3:g} m {way} the point midway between the pads"
        if abs(mistake.forward - 1e3 * gripper.X_HG[2, 3]) < 15.0:
            place += ", at the flange or the body of the hand"
        words.append(place)
    return " and ".join(words)


def _frame_correction(mistake: Mistake, X_GF: Array) -> Array:
    """`X_GN` (4, 4): pose of the right grasp frame in the grasp frame as returned."""
    return correct_poses(np.eye(4), X_GF, mistake.correction)


_FAULTS = {
    "inverse": "inverted: they hold the pose of the camera in the grasp frame",
    "transposed": "given with transposed rotations",
    "wxyz": "made of quaternions in the order w, x, y, z, read as x, y, z, w",
    "xyzw": "made of quaternions in the order x, y, z, w, read as w, x, y, z",
    "y_up": "measured in a frame with y up",
    "z_up": "measured in a frame with z up in place of y",
    "millimetres": "given in millimetres",
}
"""What is wrong, by the correction of the poses."""


def _correction_line(mistake: Mistake, poses: AnsweredPoses, seen: CheckScene) -> str:
    """The line of Python that corrects a mistake."""
    entry = poses.entry
    lines = frame_mistakes(entry, seen.observation)
    if mistake in lines:
        return lines[mistake]
    fixed = {
        "inverse": f"{entry} = np.linalg.inv({entry})",
        "transposed": f"{entry}[:, :3, :3] = {entry}[:, :3, :3].transpose(0, 2, 1)",
        "wxyz": "quaternion = quaternion[:, [1, 2, 3, 0]]  # before the rotations are made of it",
        "xyzw": "quaternion = quaternion[:, [3, 0, 1, 2]]  # before the rotations are made of it",
        "millimetres": f"{entry}[:, :3, 3] /= 1000.0",
    }
    X_GF = poses.format.X_GF(seen.gripper)
    if not mistake.moves_frame:
        name = mistake.correction[0]
        if name in fixed:
            return fixed[name]
        X = correct_poses(np.eye(4), np.eye(4), mistake.correction)
        return f"{entry} = {_matrix_text(X)} @ {entry}"
    if not mistake.turn and poses.format.name == "burg_drake":
        return f"{entry}[:, :3, 3] += {mistake.forward / 1e3:g} * {entry}[:, :3, 2]"
    X_FN = inverse(X_GF) @ _frame_correction(mistake, X_GF) @ X_GF
    return f"{entry} = {entry} @ {_matrix_text(X_FN)}"


def _matrix_text(X: Array) -> str:
    """A matrix as Python with numpy."""
    rows = [f"[{', '.join(f'{v:g}' for v in row)}]" for row in np.round(X, 6) + 0.0]
    return f"np.array([{', '.join(rows)}])"


def _fit_notes(fits: tuple[int, int]) -> tuple[str, ...]:
    """A note if so few grasps fit that frames cannot be told to be right."""
    min_tried, min_share = 3, 1.0 / 3.0
    count, tried = fits
    if count >= min_share * tried:
        few = f"Only {count} of {tried} grasps fit, too few to be sure that the frames are right."
        return () if tried >= min_tried else (few,)
    return (
        f"Cannot tell whether the frames are right: {count} of {tried} grasps fit as returned, and"
        " no usual mistake explains why.",
    )


def _time(read: PlannedGrasps | None) -> float:
    return math.nan if read is None else read.time


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] if not text.startswith("X_") else text
