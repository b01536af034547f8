"""Common mistakes in grasp poses of other projects, and their corrections."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from burg_drake.core import (
    Array,
    GraspSet,
    UnknownNameError,
    inverse,
    list_names,
    make_pose,
    provenance_parts,
    quaternion_from_rotation,
    rotation_from_quaternion,
    rotation_from_rpy,
    suggest_names,
)
from burg_drake.formats import GRASP_FORMATS, GraspFormat, Gripper, ImportedGrasps, PoseFrame


def _turn_grasps(X_MG: Array, X_GF: Array, axis: str, degrees: float) -> Array:
    """Grasps (..., 4, 4) turned about the origin of the file's frame F."""
    rpy = np.deg2rad(degrees) * np.array([axis == name for name in "xyz"])
    X_GO = make_pose(p_AB=X_GF[..., :3, 3])
    turned: Array = X_MG @ X_GO @ make_pose(rotation_from_rpy(rpy)) @ inverse(X_GO)
    return turned


def _replace_rotations(X: Array, R: Array) -> Array:
    return make_pose(R, X[..., :3, 3])


def _shift_quaternions(X: Array, shift: int) -> Array:
    """Poses with the elements wxyz of their quaternions rolled by `shift`."""
    flat = quaternion_from_rotation(X[..., :3, :3].reshape(-1, 3, 3))
    R = rotation_from_quaternion(np.roll(flat, shift, axis=-1))
    return _replace_rotations(X, R.reshape(*X.shape[:-2], 3, 3))


POSE_CORRECTIONS: Mapping[str, tuple[Callable[[Array], Array], str]] = {
    "inverse": (inverse, "with each pose inverted"),
    "transposed": (
        lambda X: _replace_rotations(X, np.swapaxes(X[..., :3, :3], -1, -2)),
        "with each rotation transposed",
    ),
    "wxyz": (
        lambda X: _shift_quaternions(X, -1),
        "with quaternions that are in the order w, x, y, z",
    ),
    "xyzw": (
        lambda X: _shift_quaternions(X, 1),
        "with quaternions that are in the order x, y, z, w",
    ),
    "y_up": (lambda X: _quarter_turn(90.0) @ X, "with y up in the frame that they are measured in"),
    "z_up": (
        lambda X: _quarter_turn(-90.0) @ X,
        "with z up in the frame that they are measured in, where the object has y",
    ),
    "millimetres": (
        lambda X: make_pose(X[..., :3, :3], X[..., :3, 3] / 1000.0),
        "with lengths in millimetres",
    ),
}
"""Corrections of poses (..., 4, 4) in the file's convention, with descriptions."""
HALF_WIDTHS = "half_widths"
MIN_LIKELY_GRASPS = 8  # Minimum number of examined grasps for a likely mistake.
_TURN_PATTERN = re.compile(r"turn:([xyz])([+-]?\d+(?:\.\d+)?)")
_FORWARD_PATTERN = re.compile(r"forward:([+-]?\d+(?:\.\d+)?)")


def _quarter_turn(degrees: float) -> Array:
    return make_pose(rotation_from_rpy(np.deg2rad([degrees, 0.0, 0.0])))


@dataclass(frozen=True)
class FileReading:
    """How to read a file.

    Attributes:
        format: format of the file; None to detect it by content.
        correction: corrections of mistakes in the file, such as `("turn:z90",)`; see
            `correct_poses`.
    """

    format: str | None = None
    correction: tuple[str, ...] = ()


def check_corrections(correction: Iterable[str]) -> tuple[str, ...]:
    """Returns the corrections if all are known.

    Raises:
        UnknownNameError: a correction is unknown.
    """
    names = tuple(correction)
    for name in names:
        plain = name in POSE_CORRECTIONS or name == HALF_WIDTHS
        if not (plain or _TURN_PATTERN.fullmatch(name) or _FORWARD_PATTERN.fullmatch(name)):
            known = [*POSE_CORRECTIONS, HALF_WIDTHS]
            raise UnknownNameError(
                f"there is no correction {name!r}; {suggest_names(name, known)}, a turn such as"
                " turn:z90, or a distance along the approach in millimetres such as forward:103.4"
            ).about("correction")
    return names


def correct_poses(X_MG: Array, X_GF: Array, correction: Sequence[str]) -> Array:
    """Applies corrections to grasps, one after the other.

    Args:
        X_MG: (..., 4, 4) grasps as read, in their reference frame M.
        X_GF: (..., 4, 4) the file's grasp frame F in G, as assumed when reading.
        correction: such as `("turn:z90", "forward:103.4")`. A turn is about an axis of G through
            the origin of F; `forward` is along the approach after the corrections before it.

    Returns:
        (..., 4, 4) grasps.
    """
    X = X_MG
    for name in correction:
        if turn := _TURN_PATTERN.fullmatch(name):
            X = _turn_grasps(X, X_GF, turn[1], float(turn[2]))
        elif forward := _FORWARD_PATTERN.fullmatch(name):
            X = X @ make_pose(p_AB=(0.0, 0.0, float(forward[1]) / 1000.0))
        elif name in POSE_CORRECTIONS:
            X = POSE_CORRECTIONS[name][0](X @ X_GF) @ inverse(X_GF)
    return X


def correct_grasps(
    imported: ImportedGrasps, gripper: Gripper, correction: Iterable[str]
) -> ImportedGrasps:
    """Applies corrections to grasps read from a file; see `correct_poses`.

    Args:
        imported: grasps as read.
        gripper: hand that they were read for.
        correction: names of `POSE_CORRECTIONS`, `half_widths`, which doubles widths, and forms such
            as `turn:z90` and `forward:103.4`.

    Raises:
        UnknownNameError: a correction is unknown.
    """
    names = check_corrections(correction)
    grasps = imported.grasps
    provenance = _without_correction(grasps.provenance)
    if not names:
        return replace(imported, grasps=replace(grasps, provenance=provenance))
    X_MG = correct_poses(grasps.X_OG, frames_of(grasps, gripper), names)
    width = grasps.width * (2.0 if HALF_WIDTHS in names else 1.0)
    provenance["correction"] = list(names)
    return replace(imported, grasps=with_poses(grasps, X_MG, width=width, provenance=provenance))


def with_poses(grasps: GraspSet, X_OG: Array, **changes: Any) -> GraspSet:
    """A copy of the grasps with other poses (N, 4, 4), their new identifiers, and other changed
    fields.
    """
    names = ("object", "width", "score", "provenance", "columns")
    return GraspSet.create(X_OG, **{name: getattr(grasps, name) for name in names} | changes)


def _without_correction(provenance: Mapping[str, Any]) -> dict[str, Any]:
    """A provenance without corrections applied before the grasps were saved to this file."""
    found = {key: value for key, value in provenance.items() if key != "correction"}
    parts = found.get("parts")
    if isinstance(parts, Mapping):
        found["parts"] = {k: _without_correction(p) if p else p for k, p in parts.items()}
    elif isinstance(parts, (list, tuple)):
        found["parts"] = [_without_correction(part) for part in provenance_parts(found)]
    return found


def correction_of(grasps: GraspSet) -> tuple[str, ...]:
    """The correction with which a set was read, by its provenance."""
    provenances = (grasps.provenance, *provenance_parts(grasps.provenance))
    return next((tuple(p["correction"]) for p in provenances if p.get("correction")), ())


def frames_of(grasps: GraspSet, gripper: Gripper) -> Array:
    """(N, 4, 4) poses in G of the grasp frame in a set's file."""
    return format_of_set(grasps).frames(grasps, gripper)


def format_of_set(grasps: GraspSet) -> GraspFormat:
    """The format from which a set was read, by its provenance; else our own format."""
    provenances = (grasps.provenance, *provenance_parts(grasps.provenance))
    names = [found.get("format") for found in provenances]
    known = (name for name in names if isinstance(name, str) and name in GRASP_FORMATS)
    return GRASP_FORMATS[next(known, "burg_drake")]


@dataclass(frozen=True)
class Mistake:
    """A way in which grasps may have been misread.

    Attributes:
        words: description of the correction, such as "turned by 90 degrees about the approach".
        correction: the correction as `correct_poses` takes it.
        frame: true reference frame of the poses, if only that is the mistake.
        camera: whether the camera's pose is the mistake.
        step: whether its distance is a step of the search instead of the offset of a known frame.
    """

    words: str
    correction: tuple[str, ...] = ()
    frame: PoseFrame | None = None
    camera: Array | None = field(default=None, compare=False)
    step: bool = False

    @property
    def turn(self) -> tuple[str, ...]:
        """Turns of the correction."""
        return tuple(name for name in self.correction if name.startswith("turn:"))

    @property
    def forward(self) -> float:
        """Distance along the approach [mm]."""
        return sum(
            float(m[1]) for name in self.correction if (m := _FORWARD_PATTERN.fullmatch(name))
        )

    @property
    def moves_frame(self) -> bool:
        """Whether it changes the grasp frame of a file by turns and a distance."""
        kinds = ("turn:", "forward:")
        return bool(self.correction) and all(name.startswith(kinds) for name in self.correction)

    @property
    def is_known_offset(self) -> bool:
        """Whether it only moves the grasp frame of a file to the origin of another known frame."""
        return bool(self.forward) and not self.turn and not self.step

    @property
    def changes_reading(self) -> bool:
        """Whether it changes how rotations and poses are read, without a distance."""
        return bool(self.correction) and not self.forward


def usual_mistakes(format: GraspFormat, gripper: Gripper) -> list[Mistake]:
    """Mistakes to look for, the most common first.

    Turns are by right angles and by the angle between the Panda's flange and hand; 180 degrees
    about the approach only exchanges the fingers and is left out. Distances are offsets between the
    origins of known frames, and steps.

    Args:
        format: format as which the grasps were read.
        gripper: the hand.
    """
    origin = _frame_offset_mm(format, gripper)
    base = round(1e3 * gripper.X_HG[2, 3], 2)
    origins = [_frame_offset_mm(known, gripper) for known in GRASP_FORMATS.values()]
    origins.append(-1e3 * gripper.tip)
    known = {round(o - origin, 2) for o in origins} | {base, -base}
    first = sorted((base, -base), key=lambda d: (abs(d + origin - base), -d))
    distances = [d for d in dict.fromkeys([*first, *sorted(known, key=abs)]) if d]
    quarter, flange = ("turn:z90",), (("turn:z45",), ("turn:z-45",))
    others = [
        (*first, *then)
        for first in (("turn:x180",), ("turn:x90",), ("turn:x-90",), ("turn:y90",), ("turn:y-90",))
        for then in ((), quarter)
    ]
    found = [_frame_mistake(quarter, 0.0)]
    found += [_frame_mistake((), d) for d in distances]
    found += [_frame_mistake(turn, 0.0) for turn in others]
    found += [Mistake(words, (name,)) for name, (_, words) in POSE_CORRECTIONS.items()]
    found += [_frame_mistake(turn, d) for turn, d in product((quarter, *others), distances)]
    found += [_frame_mistake(turn, d) for turn, d in product(flange, (0.0, base)) if turn or d]
    found += [
        replace(_frame_mistake(turn, d), step=True)
        for turn, d in product(((), quarter), np.arange(-120.0, 121.0, 5.0).tolist())
        if d and d not in distances
    ]
    return list(dict.fromkeys(found))


def _frame_offset_mm(format: GraspFormat, gripper: Gripper) -> float:
    """Distance of the origin of a format's frame behind G [mm]."""
    return -1e3 * float(format.X_GF(gripper)[2, 3])


def _frame_mistake(turn: tuple[str, ...], forward: float) -> Mistake:
    """A mistake in the grasp frame of a file."""
    # Axes of G.
    axis_words = {
        "z": "the approach",
        "x": "the closing direction",
        "y": "the axis across approach and closing direction",
    }
    words = [
        f"turned by {float(m[2]):g} degrees about {axis_words[m[1]]}"
        for name in turn
        if (m := _TURN_PATTERN.fullmatch(name))
    ]
    if forward:
        way = "forward" if forward > 0.0 else "back"
        words.append(f"moved {way} by {abs(forward):g} mm along the approach")
    moved = (f"forward:{forward:g}",) if forward else ()
    return Mistake(" and ".join(words), (*turn, *moved))


@dataclass(frozen=True)
class MistakeFound:
    """A mistake found in a set of grasps.

    Attributes:
        mistake: the mistake.
        before, after: number of grasps that fit before and after the correction.
        count: number of examined grasps.
        total: number of grasps in the set.
        likeness: titles of formats with the grasp frame of the corrected grasps.
        format: another format for the same file that corrects the mistake.
        alternatives: other corrections that fit as well, in words.
        reach_mm: smallest and largest distance along the approach that fits as well [mm].
        given: correction with which the grasps were read.
        only: instance or object that alone shows the mistake; empty if all do.
    """

    mistake: Mistake
    before: int
    after: int
    count: int
    total: int
    likeness: tuple[str, ...] = ()
    format: str = ""
    alternatives: tuple[str, ...] = ()
    reach_mm: tuple[float, float] | None = None
    given: tuple[str, ...] = ()
    only: str = ""

    @property
    def is_likely(self) -> bool:
        """Whether nearly all grasps fit after the correction, and after no other one."""
        enough = self.count >= MIN_LIKELY_GRASPS and self.after >= 0.9 * self.count
        return enough and not self.alternatives

    def text(self, format_option: str = "--grasps-format") -> str:
        """Sentences about the mistake, its certainty, and the option that corrects it.

        Args:
            format_option: name of the caller's option for the file format.
        """
        sentences = [self._finding_sentence()]
        if self.reach_mm is not None and self.reach_mm[0] < self.reach_mm[1]:
            low, high = sorted(map(abs, self.reach_mm))
            sentences.append(f"Any distance from {low:g} to {high:g} mm fits equally well.")
        if self.likeness:
            sentences.append(f"Files of {list_names(self.likeness)} have their grasps that way.")
        if self.alternatives:
            sentences.append(f"Equally many fit {' or '.join(self.alternatives)}.")
        return " ".join([*sentences, self._remedy(format_option)])

    def options(self, format_option: str = "--grasps-format") -> list[str]:
        """Command-line options of the correction; none if it needs a rewritten file."""
        mistake = self.mistake
        only = ["--only", self.only] if self.only else []
        if mistake.camera is not None:
            return []
        if mistake.frame is not None:
            return ["--grasps-frame", "scene" if mistake.frame == "world" else mistake.frame, *only]
        if self.format:
            return [format_option, self.format, *only]
        return ["--correction", ",".join((*self.given, *mistake.correction)), *only]

    def _finding_sentence(self) -> str:
        words = self.mistake.words
        others = f" that were checked, of {self.total} in all," if self.total > self.count else ""
        grasps = f"grasps of {self.only}" if self.only else "grasps"
        return (
            f"As they were read, {self.before} of the {self.count} {grasps}{others} fit:"
            " the open hand is clear of the object, and its pads close on it. "
            f"{words[0].upper()}{words[1:]}, {self.after} of {self.count} fit."
        )

    def _remedy(self, format_option: str) -> str:
        likely = "very likely" if self.is_likely else "perhaps"
        if self.mistake.camera is not None:
            return (
                f"The pose of the camera is {likely} wrong; give the right one with --camera-pose."
            )
        correction = " ".join(self.options(format_option))
        return f"The file {likely} means that; {correction} reads it that way."
