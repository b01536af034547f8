"""Check of a planner: its grasps of a carton and a can tell whether frames and units are right.

The mistakes are those of grasp files, and are found in the same way: by the correction after which
the open hand is clear of the objects and the pads close on them. Mistakes in the frame that the
poses are measured in, and matrices that are no poses, are added here.

A planner that returns few grasps gets further images, from the same camera. No two objects of all
images overlap: the grasps of all answers are judged together, as those of one scene.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from burg_drake.benchmark.answers import (
    OTHER_ENTRIES,
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
from burg_drake.core import Array, GraspSet, Outcome, Pose, count_with_noun, inverse
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
from burg_drake.geometry import Surface
from burg_drake.grasping import HandClearance, are_antipodal, grasp_contacts, jaws_of
from burg_drake.objects import load_library
from burg_drake.scene import Instance, Scene, SceneDocument, place_objects
from burg_drake.station import (
    Station,
    StationLike,
    as_station,
    build_station_diagram,
    station_gripper,
)

MAX_CHECKED_GRASPS = 100
"""Number of grasps that are looked at: the best of each answer, of all answers together."""
MIN_GRASPS = 20
"""Number of grasps from which on no further image is shown."""
MIN_FITTING_GRASPS = 3
"""Number of fitting grasps below which frames cannot be told to be right."""
MIN_HIDDEN_GRASPS = 3
"""Number of grasps, all of one object, that have to show a mistake that other grasps do not."""
CARTON_POSES = (((0.2, 0.2), 25.0), ((0.35, 0.34), 100.0), ((0.33, 0.06), 75.0))
"""Where the carton stands in each image, in the scene frame: position [m] and yaw [degrees]."""
CAN_POSITIONS = ((0.42, 0.17), (0.08, 0.08), (0.53, 0.33))
"""Where the can stands in each image, in the scene frame [m]."""

Ask = Callable[[Observation, Scene, Station], Mapping[str, Any]]
"""Asks a planner; returns its answer, unread."""


@dataclass(frozen=True, kw_only=True)
class PlannerCheck:
    """What the grasps of a planner show.

    Attributes:
        count: number of grasps in all answers.
        images: number of images that the planner was given.
        fits: number of grasps that fit as returned, and number of those that were tried. A grasp
            fits if the open hand is clear of the object and the pads close on it.
        problems: mistakes of the planner: a sentence each, and where there is one the line of
            Python that corrects it, on a line of its own.
        unclear: why the frames cannot be told to be right, one sentence each; empty if they are
            right, or if there is a problem.
        time: time that all answers took [s].
        notes: what else is odd, one sentence each.
    """

    count: int = 0
    images: int = 0
    fits: tuple[int, int] = (0, 0)
    problems: tuple[str, ...]
    unclear: tuple[str, ...] = ()
    time: float = math.nan
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class CheckScene:
    """The images that planners are checked on: of a carton and a can, both standing.

    Attributes:
        station: station with the hand.
        scenes: what each image shows. Objects of different scenes do not overlap.
        observations: what the planner is given, for each scene; the camera stands still.
    """

    station: Station
    scenes: tuple[Scene, ...]
    observations: tuple[Observation, ...]

    @property
    def gripper(self) -> Gripper:
        """The hand."""
        return station_gripper(self.station)

    def all_objects(self, count: int) -> Scene:
        """One scene with the objects of the first scenes."""
        scenes = self.scenes[:count]
        return _place([instance for scene in scenes for instance in scene.document.instances])


def make_check_scene(station: StationLike = "panda_tabletop") -> CheckScene:
    """Renders the images for a check.

    The carton is 60 mm wide and 158 mm long, so that a hand fits it in one direction only. The
    camera looks along no axis of the scene.

    Raises:
        MissingDependencyError: a system library of the renderer is missing.
    """
    station = as_station(station)
    depth_sensor = sensor("d435")
    camera = SceneCamera(
        intrinsics=depth_sensor.depth_camera((848, 480)),
        X_SC=camera_looking_at(np.array([0.3, 0.2, 0.08]), 0.75, np.pi / 4.0, np.deg2rad(-70.0)),
        depth_range=depth_sensor.depth_range,
    )
    scenes = []
    for k, ((carton, yaw), can) in enumerate(zip(CARTON_POSES, CAN_POSITIONS, strict=True)):
        X_SCarton = Pose(translation=(*carton, 0.0), rpy_deg=(0, 0, yaw))
        X_SCan = Pose(translation=(*can, 0.0))
        instances = [
            Instance(object="box", name=f"carton_{k}", X_SO=X_SCarton),
            Instance(object="can", name=f"can_{k}", X_SO=X_SCan),
        ]
        scenes.append(_place(instances))
    observations = tuple(camera.observe(scene, station) for scene in scenes)
    return CheckScene(station, tuple(scenes), observations)


def _place(instances: Sequence[Instance]) -> Scene:
    document = SceneDocument(name="planner_check", library="household", instances=tuple(instances))
    return place_objects(document, load_library("household"), Path("planner_check.yaml"))


def check_planner(ask: Ask, station: StationLike = "panda_tabletop") -> PlannerCheck:
    """Asks a planner for grasps of a carton and a can, and looks for the mistakes in them.

    Args:
        ask: asks the planner, such as `ask` of an open planner.
        station: station with the hand.

    Raises:
        MissingDependencyError: a system library of the renderer is missing.
    """
    seen = make_check_scene(station)
    begun = time.perf_counter()
    answers: list[Mapping[str, Any]] = []
    for scene, observation in zip(seen.scenes, seen.observations, strict=True):
        try:
            answers.append(ask(observation, scene, seen.station))
        except PlannerError as error:
            return PlannerCheck(
                images=len(answers) + 1,
                problems=(f"{error}.",),
                time=time.perf_counter() - begun,
            )
        if sum(one.count for one in _read_answers(answers, seen)) >= MIN_GRASPS:
            break
    taken = time.perf_counter() - begun
    found = check_answers(answers, seen)
    return found if math.isfinite(found.time) else replace(found, time=taken)


def check_answers(answers: Sequence[Mapping[str, Any]], seen: CheckScene) -> PlannerCheck:
    """Looks for the mistakes in answers.

    Args:
        answers: anything that a planner returned for each of the first images.
        seen: the images.
    """
    each = _read_answers(answers, seen)
    problems = next((list(one.problems) for one in each if one.problems), [])
    far = next(([one.far] for one in each if one.far), [])
    asked = PlannerCheck(
        images=len(each),
        problems=(),
        time=sum(math.nan if one.planned is None else one.planned.time for one in each),
        notes=tuple(dict.fromkeys(note for one in each for note in one.notes)),
    )
    readable = [one for one in each if one.poses is not None]
    if not readable:
        return replace(asked, problems=(*problems, *far))
    count = sum(one.count for one in readable)
    if not count:
        problems.append(
            "There are no grasps, although a carton and a can stand in full view; has the planner"
            " read the depth in metres, and the images as color (H, W, 3) and depth (H, W)?"
        )
        return replace(asked, problems=tuple(problems))
    search = _PlannerSearch([one for one in readable if one.count], len(each), seen)
    fits, found = search.examine()
    problems += far if found is None else [_problem(found, search.poses, seen)]
    problems += search.width_problems(found)
    entries = sorted({one.poses.entry for one in readable if one.count and one.poses})
    if len(entries) > 1:
        problems.append(
            f"Poses are in {' and '.join(entries)}, in different images; return the same entry for"
            " all. Only those like the first ones were looked at."
        )
    return replace(
        asked,
        count=count,
        fits=fits,
        problems=tuple(problems),
        unclear=() if problems else search.doubts(fits),
    )


def _read_answers(answers: Sequence[Mapping[str, Any]], seen: CheckScene) -> list[_Answer]:
    return [
        _Answer.read(answer, observation, seen.gripper)
        for answer, observation in zip(answers, seen.observations, strict=False)
    ]


@dataclass(frozen=True, eq=False)
class _Answer:
    """The answer to one image, as far as it can be read.

    Attributes:
        poses: the poses; None if they cannot be read.
        planned: the answer; None if it was refused.
        problems: its problems, but for `far`.
        far: that the grasps are far away; empty if they are not.
    """

    poses: AnsweredPoses | None
    planned: PlannedGrasps | None
    problems: tuple[str, ...]
    far: str = ""

    @property
    def count(self) -> int:
        """Number of grasps."""
        return 0 if self.poses is None else len(self.poses.X_MG)

    @property
    def notes(self) -> tuple[str, ...]:
        """What is odd about the answer."""
        return () if self.planned is None else self.planned.notes

    @classmethod
    def read(cls, answer: Mapping[str, Any], observation: Observation, gripper: Gripper) -> _Answer:
        """Reads an answer, whatever it is."""
        answer, problems = _repair_matrices(answer)
        planned, far = None, ""
        try:
            planned = read_answer(answer, observation, gripper)
        except FarGraspsError as error:
            far = f"{_sentence(str(error))}."
        except AnswerError as error:
            problems = [*problems, f"{_sentence(str(error))}."]
        try:
            poses = read_poses(answer, observation, gripper)
        except AnswerError:
            poses = None
        return cls(poses, planned, tuple(problems), far)


class _PlannerSearch:
    """Search for the mistake in the poses of all answers, and in their widths.

    Attributes:
        poses: poses of the first answer, of which entry and format are those of all.
    """

    def __init__(self, answers: Sequence[_Answer], images: int, seen: CheckScene) -> None:
        """Prepares the best grasps of each answer.

        Args:
            answers: answers with grasps. Of those that give poses in another frame than the first
                one, nothing is looked at.
            images: number of images that were answered.
            seen: the images.
        """
        assert answers[0].poses is not None
        self.poses = answers[0].poses
        self._seen, self._scene = seen, seen.all_objects(images)
        best = slice(0, MAX_CHECKED_GRASPS // images)
        X_MG, width = [], []
        for one in answers:
            assert one.poses is not None
            if (one.poses.entry, one.poses.format) != (self.poses.entry, self.poses.format):
                continue
            if one.planned is None:
                X_MG.append(one.poses.X_MG[best])
                width.append(np.full(len(X_MG[-1]), np.nan))
            else:
                X_MG.append(inverse(one.poses.X_SM) @ one.planned.X_SG[best])
                width.append(one.planned.width[best])
        self._X_MG, self._width = np.concatenate(X_MG), np.concatenate(width)
        _, first = np.unique(self._X_MG, axis=0, return_index=True)  # copies show nothing new
        self._X_MG, self._width = self._X_MG[np.sort(first)], self._width[np.sort(first)]

    def examine(self) -> tuple[tuple[int, int], MistakeFound | None]:
        """Number of grasps that fit as returned and of those tried, and the mistake in poses."""
        fits, found = self._examine(self._as_returned)
        if found is not None:
            return fits, found
        return fits, self._hidden_mistake(fits)

    def _examine(
        self, grasps: Mapping[str, GraspSet]
    ) -> tuple[tuple[int, int], MistakeFound | None]:
        frames = [*frame_mistakes(self.poses.entry, self._seen.observations[0])]
        return examine_grasps(grasps, self._seen.station, self._scene, frames)

    def _hidden_mistake(self, fits: tuple[int, int]) -> MistakeFound | None:
        """A mistake that grasps of one object do not show, as turned ones of a can fit as well: it
        is that of the others if nearly all grasps fit after its correction.

        Args:
            fits: number of grasps that fit as returned, and of those tried.
        """
        fitting, tried = fits
        for name in ("carton", "can"):
            _, found = self._examine(self._grasps_of(name))
            if found is None or found.after < MIN_HIDDEN_GRASPS:
                continue
            (after, _), _ = self._examine(self._by_instance(self._corrected(found.mistake)))
            if after >= max(0.9 * tried, fitting + MIN_HIDDEN_GRASPS):
                return replace(found, before=fitting, after=after, count=tried, only="")
        return None

    def doubts(self, fits: tuple[int, int]) -> tuple[str, ...]:
        """Why the frames cannot be told to be right, if so, and why grasps do not fit.

        Args:
            fits: number of grasps that fit as returned, and of those tried.
        """
        min_share = 1.0 / 3.0
        count, tried = fits
        causes = {name: Counter(self._causes(name)) for name in ("carton", "can")}
        if count < min_share * tried:
            doubt = (
                f"Cannot tell whether the frames are right: {count} of {tried} grasps fit as"
                " returned, and no usual mistake explains why."
            )
        elif count < MIN_FITTING_GRASPS:
            doubt = (
                f"Only {count} of {tried} grasps fit, too few to be sure that the frames are right."
            )
        elif not causes["carton"][""]:
            doubt = (
                "Cannot tell whether the frames are right: only grasps of the can fit, which also"
                " fit if they are turned about the approach."
            )
        else:
            return ()
        return (doubt, *(text for item in causes.items() if (text := _misfit_text(*item))))

    def _causes(self, name: str) -> Iterator[str]:
        """Why each grasp of an object does not fit; empty for those that do."""
        station, scene = self._seen.station, self._scene
        diagram = build_station_diagram(scene, station, robot="hand")
        jaws = jaws_of(station.hand, station.hand_model, station.packages)
        for instance, grasps in self._grasps_of(name).items():
            screen = HandClearance(diagram, bodies=[instance, "table"])
            blocked = screen.measure(instance, diagram.X_WO(instance) @ grasps.X_OG).outcome
            X_SG = scene.X_SO(instance) @ grasps.X_OG
            _, between = held_instances(scene, X_SG, self._seen.gripper, [instance])
            entry = scene.entry(instance)
            surface = Surface.of(scene.library.surface(scene.instance(instance).object))
            contacts = grasp_contacts(surface, grasps.X_OG, jaws)
            close = are_antipodal(contacts, grasps.X_OG, max(0.5, entry.friction))
            for k in range(len(grasps)):
                if blocked[k] == Outcome.COLLISION_TARGET:
                    yield "collides"
                elif close[k]:
                    yield ""
                elif blocked[k] == Outcome.COLLISION_TABLE:
                    yield "table"
                else:
                    yield "sides" if between[k] else "nothing"

    def width_problems(self, found: MistakeFound | None) -> list[str]:
        """What is wrong with the widths, after the correction of the poses."""
        if not (self._width > 0.0).any():
            return []
        grasps = self._as_returned
        if found is not None:
            grasps = self._by_instance(self._corrected(found.mistake))
        ratios = width_ratios(grasps, self._seen.station, self._scene)
        if len(ratios) < 3:
            return []
        units = (
            (0.35, 0.6, "half of the distance between the object's two sides", "2.0 * width"),
            (350.0, 600.0, "half widths in millimetres", "2.0 * width / 1000.0"),
            (700.0, 2000.0, "in millimetres", "width / 1000.0"),
            (70.0, 200.0, "in centimetres", "width / 100.0"),
        )
        problems = [
            f"The widths are {words}, at {count} of the {len(ratios)} grasps that touch an object."
            f" Correct it like this:\n    width = {line}"
            for low, high, words, line in units
            if (count := int(((low < ratios) & (ratios < high)).sum())) >= 0.8 * len(ratios)
        ]
        median = float(np.median(ratios))
        if not problems and not 0.35 < median < 3.0:
            problems.append(
                f"The widths are {median:.2g} times the distance between the object's two sides, at"
                " the median grasp; return that distance in metres."
            )
        return problems

    @cached_property
    def _as_returned(self) -> dict[str, GraspSet]:
        return self._by_instance(self.poses.X_SM @ self._X_MG)

    def _grasps_of(self, name: str) -> dict[str, GraspSet]:
        """Grasps as returned of the carton or the can, by instance."""
        grasps = self._as_returned
        return {key: part for key, part in grasps.items() if key.startswith(f"{name}_")}

    def _corrected(self, mistake: Mistake) -> Array:
        """(N, 4, 4) grasps in the scene frame after a correction."""
        if mistake.camera is not None:
            return np.asarray(mistake.camera @ self._X_MG)
        X_GF = self.poses.format.X_GF(self._seen.gripper)
        X_MG = correct_poses(self._X_MG, X_GF, mistake.correction)
        return np.asarray(self.poses.X_SM @ X_MG)

    def _by_instance(self, X_SG: Array) -> dict[str, GraspSet]:
        """Grasps (N, 4, 4) in the scene frame, given to the instances that they hold."""
        scene = self._scene
        how = {"format": self.poses.format.name, "X_SM": self.poses.X_SM.tolist()}
        grasps = GraspSet.create(X_SG, object="", width=self._width, provenance=how)
        owner, _ = held_instances(scene, X_SG, self._seen.gripper)
        return group_by_instance(scene, grasps, X_SG, owner)


def _misfit_text(name: str, causes: Counter[str]) -> str:
    """A sentence about the grasps of an object that do not fit; empty if all fit.

    Args:
        name: name of the object.
        causes: number of grasps by cause, see `_PlannerSearch._causes`.
    """
    words = {
        "collides": "the open hand collides with it",
        "table": "the open hand collides with the table",
        "nothing": "nothing is between the pads",
        "sides": "the pads do not close on opposite sides",
    }
    count, fitting = causes.total(), causes[""]
    if fitting == count:
        return "" if count else f"No grasp is near the {name}."
    reasons = [f"{words[cause]} at {number}" for cause, number in causes.most_common() if cause]
    grasps = count_with_noun(count, "grasp")
    return f"Of {grasps} of the {name}, {fitting} fit; {', '.join(reasons)}."


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
                " an axis is mirrored, or two are swapped. Correct it like this:\n"
                f"    {entry}[:, :3, 1] = np.cross({entry}[:, :3, 2], {entry}[:, :3, 0])"
            )
        if problems:
            answer = {**answer, entry: X}
    return answer, problems


def _problem(found: MistakeFound, poses: AnsweredPoses, seen: CheckScene) -> str:
    """The mistake, its evidence, and the line that corrects it."""
    only = found.only.partition("_")[0]
    grasps = f"grasps of the {only}" if only else "grasps"
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
    frame = f', or set "frame": "{names[0]}" in the answer' if names else ""
    line = _correction_line(found.mistake, poses, seen)
    return " ".join([*sentences, f"Correct it like this{frame}:\n    {line}"])


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
    lines = frame_mistakes(entry, seen.observations[0])
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


def _sentence(text: str) -> str:
    """A message as a sentence; it may begin with the name of an entry."""
    begins_with_entry = text.split(maxsplit=1)[0] in (*POSE_ENTRIES, *OTHER_ENTRIES)
    return text if begins_with_entry else text[:1].upper() + text[1:]
