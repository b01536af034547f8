"""Finds the common pose mistake of a grasp set by clearance of the hand and pad contacts."""

from __future__ import annotations

import contextlib
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    Array,
    BurgError,
    GraspSet,
    Outcome,
    content_hash,
    inverse,
    make_pose,
    rot_z,
)
from burg_drake.evaluation.campaign_folder import Campaign
from burg_drake.evaluation.grasp_sets.given_grasps import Owners, held_instances
from burg_drake.evaluation.grasp_sets.input import split_by_instance
from burg_drake.evaluation.grasp_sets.pose_mistakes import (
    HALF_WIDTHS,
    MIN_LIKELY_GRASPS,
    Mistake,
    MistakeFound,
    correct_poses,
    correction_of,
    format_of_set,
    frames_of,
    usual_mistakes,
)
from burg_drake.evaluation.run_folder import Run, load_run
from burg_drake.formats import GRASP_FORMATS, GraspFormat, PoseFrame
from burg_drake.objects import ObjectLibrary
from burg_drake.scene import Scene, SceneLike, as_scene
from burg_drake.station import Station, StationLike, as_station

if TYPE_CHECKING:
    from burg_drake.geometry import Surface
    from burg_drake.grasping import HandClearance
    from burg_drake.station import StationDiagram


class MistakeLimits:
    """Limits of the search, tuned on sets with and without mistakes.

    Up to 0.67 of random grasps fit after two corrections. Correct widths are 0.75 to 1.07 times the
    distance of the contacts, half widths half of that.
    """

    max_grasps = 100  # Maximum number of grasps of a set that are examined.
    min_fitting = 3  # Minimum number of grasps that fit after the correction.
    min_share = 0.6  # Minimum share of grasps that fit after the correction.
    min_share_combined = 0.8  # The same for two mistakes at once.
    min_share_about = 0.9  # The same for turns about the closing direction, and above max_closing.
    min_gain_about = 10.0  # Above this ratio such turns need only `min_share`.
    min_gain = 2.5  # Minimum ratio of fitting grasps after to before the correction.
    min_gained = 10  # Minimum number that fit only after, where more fit before.
    max_lost_share = 0.1  # Maximum ratio of grasps that fit only before to those only after.
    max_closing = 0.4  # Above this share of closing pads, grasps may be right and only poor.
    min_fitting_closing = 8  # Minimum number that fit after the correction above max_closing.
    tie_ratio = 0.9  # Mistakes are equally good if the ratio of their counts is above this.
    min_friction = 0.5  # Friction coefficient of the pads at least; other sets assume other ones.
    half_width_ratios = (0.35, 0.6)  # Width over contact distance of half widths.
    max_touched_share = 0.9  # Above this share of grasps that touched the object, poses are right.
    max_scenes = 3  # Maximum number of scenes of a run over many that are examined.
    millimetre_distance = 1.0  # Metres; beyond this median distance millimetres are tried.


CONTACT_OUTCOMES = [
    outcome.value
    for outcome in Outcome
    if outcome.held or outcome in (Outcome.SLIPPED, Outcome.DROPPED, Outcome.BLOCKED)
]
"""Outcomes of grasps at which both fingers have touched the object."""

Fits = NDArray[np.bool_]


def find_mistake(
    grasps: Mapping[str, GraspSet],
    station: StationLike,
    source: SceneLike | ObjectLibrary,
    frames: Sequence[Mistake] | None = None,
) -> MistakeFound | None:
    """Finds the common pose mistake of a grasp set, if it has one.

    Args:
        grasps: grasps in the frames of their objects, by instance of the scene or by object of the
            library. Their provenance says how a file was read.
        station: station with the hand.
        source: scene or library of the objects.
        frames: possible mistakes in the frame that the poses are measured in; those of files if
            None.

    Returns:
        The mistake whose correction makes most grasps fit, where few fit as read. If all grasps
        together show none, the likely mistake of the first object whose own grasps show one. None
        if there is none.
    """
    search = _open_search(grasps, station, source, frames)
    return None if search is None else _find_mistake(search)


def examine_grasps(
    grasps: Mapping[str, GraspSet],
    station: StationLike,
    source: SceneLike | ObjectLibrary,
    frames: Sequence[Mistake] | None = None,
) -> tuple[tuple[int, int], MistakeFound | None]:
    """Counts the grasps that fit, and finds the common mistake unless nearly all fit.

    A grasp fits if the open hand is clear of the object and the pads close on it.

    Args:
        grasps, station, source, frames: see `find_mistake`.

    Returns:
        Number of grasps that fit as read and number of those that were examined, and the mistake.
    """
    search = _open_search(grasps, station, source, frames)
    if search is None:
        return (0, 0), None
    fits = search.fitting_as_read(), search.count
    nearly_all = fits[0] >= MistakeLimits.min_share_about * fits[1]
    return fits, None if nearly_all else _find_mistake(search)


def _open_search(
    grasps: Mapping[str, GraspSet],
    station: StationLike,
    source: SceneLike | ObjectLibrary,
    frames: Sequence[Mistake] | None,
) -> _MistakeSearch | None:
    """The search over all grasps; None if there are none."""
    held = {name: part for name, part in grasps.items() if len(part)}
    if not held:
        return None
    source = source if isinstance(source, ObjectLibrary) else as_scene(source)
    return _MistakeSearch(held, as_station(station), source, frames)


def _find_mistake(search: _MistakeSearch) -> MistakeFound | None:
    """The mistake of all grasps, or else the likely mistake of the grasps of one object."""
    if found := _find_common_mistake(search):
        return found
    for name, part in search.parts():
        found = _find_common_mistake(part)
        if found and found.is_likely:  # among many objects, one may show a mistake by chance
            return replace(found, only=name)
    return None


def _find_common_mistake(search: _MistakeSearch) -> MistakeFound | None:
    mistakes = search.mistakes()
    alone, in_scene = search.fits(mistakes)
    found = _choose_mistake(search, mistakes, alone)
    if found is None and in_scene is not None:
        return _choose_mistake(search, mistakes, in_scene)
    return found


def mistake_notes(
    grasps: Mapping[str, GraspSet],
    station: Station,
    source: Scene | ObjectLibrary,
    *,
    format_option: str = "--grasps-format",
) -> tuple[str, ...]:
    """Notes about the common mistake of a grasp set, with the option that corrects it, and about
    half widths.

    Args:
        grasps, station, source: see `find_mistake`.
        format_option: name of the caller's option for the file format.
    """
    found = find_mistake(grasps, station, source)
    mistaken = () if found is None else (found.text(format_option),)
    halved = half_width_note(grasps, station, source)
    return (*mistaken, *([halved] if halved else []))


def given_hints(run: Run, asked: Run | Campaign | None = None) -> tuple[str, ...]:
    """The notes of `mistake_notes` on the given grasps of a run; none for sampled grasps.

    A line below each note has the command that evaluates the corrected grasps.

    Pose mistakes are searched only if both fingers missed the object at more than a few grasps.

    Args:
        run: run of one scene.
        asked: run whose command is repeated, of this scene or of many; `run` if None.
    """
    if run.document.grasps.origin != "given":
        return ()
    outcomes = run.rows().codes("outcome")
    touched = np.isin(outcomes.names, CONTACT_OUTCOMES)[outcomes.codes]
    hints = []
    with contextlib.suppress(BurgError):
        scene, station = run.scene(), run.station()
        grasps = split_by_instance(
            run.candidates.grasps.with_columns(instance=run.candidates.instance)
        )
        if touched.sum() < MistakeLimits.max_touched_share * len(touched):
            found = find_mistake(grasps, station, scene)
            if found is not None:
                hints.append(found.text() + _repeat_command(asked or run, found.options()))
        if halved := half_width_note(grasps, station, scene):
            options = ["--correction", ",".join((*run.document.grasps.correction, HALF_WIDTHS))]
            hints.append(halved + _repeat_command(asked or run, options))
    return tuple(hints)


def campaign_hints(campaign: Campaign) -> tuple[str, ...]:
    """The notes of `given_hints` on a run over many scenes with grasps from one file.

    They are those of the first scene with a mistake, among the few scenes at which the fingers most
    often missed the object.
    """
    if campaign.document.grasps.origin != "given":
        return ()
    rows = campaign.rows(["outcome"])
    codes, texts = rows.codes("outcome")
    missed = ~np.isin(texts, CONTACT_OUTCOMES)[codes]
    by_scene = np.bincount(rows.run[missed], minlength=len(campaign.names))
    for k in np.argsort(-by_scene, kind="stable")[: MistakeLimits.max_scenes].tolist():
        name = campaign.names[k]
        with contextlib.suppress(BurgError):
            hints = given_hints(load_run(campaign.folder(name)), campaign)
            if hints:
                return tuple(f"Scene {name}: {hint}" for hint in hints)
    return ()


def _repeat_command(run: Run | Campaign, options: Sequence[str]) -> str:
    """The command that evaluates again with further options.

    It writes to another folder, as the first folder keeps its verdicts.
    """
    words = shlex.split(run.document.command)
    if not options or words[:2] != ["burg-drake", "evaluate"] or not _has_grasp_file(words):
        return " Evaluate them again in another folder."
    only = ["--only"] if "--only" in options else []
    kept = _drop_options(words, "-o", "--output", "--shard", *only)
    command = shlex.join([*kept, *options, "-o", f"{run.path}_corrected"])
    return f" This command evaluates them again:\n{command}"


def _has_grasp_file(words: Sequence[str]) -> bool:
    """Whether the grasps of a command can be read again (not from a pipe)."""
    files = [value for word, value in pairwise(words) if word == "--grasps"]
    files += [word.partition("=")[2] for word in words if word.startswith("--grasps=")]
    return any(Path(file).is_file() and not file.startswith("/dev/") for file in files)


def _drop_options(words: Sequence[str], *options: str) -> list[str]:
    """The words of a command without some of its options, each with one value."""
    before = ["", *words]
    return [
        word
        for word, previous in zip(words, before, strict=False)
        if word not in options and previous not in options and word.partition("=")[0] not in options
    ]


def half_width_note(
    grasps: Mapping[str, GraspSet], station: Station, source: Scene | ObjectLibrary
) -> str:
    """A note if most widths are half of the distance of the contacts; else ""."""
    ratios = width_ratios(grasps, station, source)
    low, high = MistakeLimits.half_width_ratios
    half = int(((low < ratios) & (ratios < high)).sum())
    if half < max(MistakeLimits.min_fitting, MistakeLimits.min_share_combined * len(ratios)):
        return ""
    return (
        f"The widths of {half} of the {len(ratios)} grasps that were checked are half of"
        " the distance between the contacts. They are very likely those of one finger;"
        f" --correction {HALF_WIDTHS} reads them that way."
    )


def width_ratios(
    grasps: Mapping[str, GraspSet], station: Station, source: Scene | ObjectLibrary
) -> Array:
    """(N,) ratios of width to distance of the contacts, of up to `MistakeLimits.max_grasps` grasps
    of each object that have a width and touch the object.

    Args:
        grasps, station, source: see `find_mistake`.
    """
    from burg_drake.grasping import grasp_contacts

    test, ratios = _cached_fit_test(station, source), [np.empty(0)]
    for name, part in grasps.items():
        known = np.flatnonzero(part.width > 0.0)[: MistakeLimits.max_grasps]
        contacts = grasp_contacts(test.surface(name), part.X_OG[known], test.jaws)
        apart = np.linalg.norm(contacts.p_OC[:, 1] - contacts.p_OC[:, 0], axis=-1)
        ratios.append(part.width[known][contacts.touching] / apart[contacts.touching])
    return np.concatenate(ratios)


class _MistakeSearch:
    """Examined grasps of a set, as read and after the correction of each mistake."""

    def __init__(
        self,
        grasps: Mapping[str, GraspSet],
        station: Station,
        source: Scene | ObjectLibrary,
        frames: Sequence[Mistake] | None = None,
    ) -> None:
        from burg_drake.station import station_gripper

        self._given, self._station, self._source = grasps, station, source
        self._frames = frames
        self._gripper = gripper = station_gripper(station)
        self._scene = source if isinstance(source, Scene) else None
        self._test = _cached_fit_test(station, source)
        first = next(iter(grasps.values()))
        how = first.provenance
        X_SM = how.get("X_SM")
        self._X_SM = None if X_SM is None or self._scene is None else np.array(X_SM, dtype=float)
        if self._X_SM is None and self._scene is not None:
            grasps = _one_instance_each(grasps, self._scene)
        self.format = format_of_set(first)
        self.correction = correction_of(first)
        self.total = sum(len(part) for part in grasps.values())
        picked = _spread_rows(grasps)
        self._name = np.repeat([*picked], [len(rows) for rows in picked.values()])
        X_OG = np.concatenate([grasps[name].X_OG[rows] for name, rows in picked.items()])
        self._X_GF = np.concatenate(
            [frames_of(grasps[name], gripper)[rows] for name, rows in picked.items()]
        )
        self._X_MG = X_OG
        if self._X_SM is not None:
            self._X_MG = inverse(self._X_SM) @ self._X_SO(self._name) @ X_OG

    @property
    def count(self) -> int:
        """Number of examined grasps."""
        return len(self._name)

    def mistakes(self) -> list[Mistake]:
        """Mistakes that are possible for the examined grasps."""
        # A camera's optical frame (OpenCV) in its body frame (ROS, x forward).
        optical_rotation = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
        found = usual_mistakes(self.format, self._gripper)
        distance = np.median(np.linalg.norm(self._X_MG[:, :3, 3], axis=-1))
        if distance < MistakeLimits.millimetre_distance:
            found = [mistake for mistake in found if mistake.correction != ("millimetres",)]
        if self._frames is not None:
            return [*found, *self._frames]
        if self._scene is None:
            return found
        if self._X_SM is None:
            return [*found, Mistake("measured in the frame of the scene", frame="world")]
        found.append(Mistake("measured in the frame of their object", frame="object"))
        if not np.allclose(self._X_SM, np.eye(4)):
            found += [
                Mistake("with the pose of the camera inverted", camera=inverse(self._X_SM)),
                Mistake(
                    "with a camera whose pose is that of a body whose x points forward",
                    camera=self._X_SM @ make_pose(optical_rotation),
                ),
            ]
        return found

    def fits(self, mistakes: Sequence[Mistake]) -> tuple[Fits, Fits | None]:
        """Which grasps fit their object as read (row 0) and after each of K corrections.

        Returns:
            (K + 1, N) which grasps fit, and which also are clear of the rest of the scene; the
            latter None without a scene.
        """
        meant = [self._X_MG, *(self._corrected_poses(mistake) for mistake in mistakes)]
        placed = self._in_object_frames(np.stack(meant))
        for k, mistake in enumerate(mistakes, 1):
            if mistake.frame is not None:
                placed[k] = self._from_frame(mistake.frame)
        names = np.concatenate([name for name, _ in placed])
        X_OG = np.concatenate([X for _, X in placed])
        alone, clear = self._test(names, X_OG)
        shape = (len(placed), self.count)
        alone = alone.reshape(shape)
        return alone, None if clear is None else alone & clear.reshape(shape)

    def parts(self) -> Iterator[tuple[str, _MistakeSearch]]:
        """Searches over the grasps of each of several objects with many grasps, by its name."""
        for name, part in self._given.items() if len(self._given) > 1 else ():
            if len(part) >= MIN_LIKELY_GRASPS:
                yield name, _MistakeSearch({name: part}, self._station, self._source, self._frames)

    @cached_property
    def _as_read(self) -> tuple[Owners, Array]:
        """Instances or objects of the grasps as read, and the grasps in object frames."""
        return self._in_object_frames(self._X_MG[None])[0]

    def fitting_as_read(self) -> int:
        """Number of grasps that fit their object as read."""
        return int(self._test(*self._as_read)[0].sum())

    @cached_property
    def closing_share(self) -> float:
        """Share of the grasps as read at which the pads close on the object, regardless of
        collisions.
        """
        return float(self._test.pads_close(*self._as_read).mean())

    def keeps_closing_line(self, mistake: Mistake) -> bool:
        """Whether a correction keeps the closing line of the fingers."""
        if not mistake.moves_frame:
            return False
        X_GN = correct_poses(np.eye(4), self.format.X_GF(self._gripper), mistake.correction)
        return bool(np.abs([X_GN[1:3, 0], X_GN[1:3, 3]]).max() < 1e-3)

    def _corrected_poses(self, mistake: Mistake) -> Array:
        """(N, 4, 4) grasps in M after the correction of their poses or of the camera."""
        if mistake.camera is not None and self._X_SM is not None:
            return np.asarray(inverse(self._X_SM) @ mistake.camera @ self._X_MG)
        return correct_poses(self._X_MG, self._X_GF, mistake.correction)

    def _in_object_frames(self, X_MG: Array) -> list[tuple[Owners, Array]]:
        """Instances or objects of grasps (K, N, 4, 4) in M, and the grasps in object frames."""
        if self._X_SM is None or self._scene is None:
            return [(self._name, X) for X in X_MG]
        X_SG = (self._X_SM @ X_MG).reshape(-1, 4, 4)
        names, _ = held_instances(self._scene, X_SG, self._gripper)  # one call, as it reads meshes
        X_OG = inverse(self._X_SO(names)) @ X_SG
        return list(zip(names.reshape(len(X_MG), -1), X_OG.reshape(X_MG.shape), strict=True))

    def _from_frame(self, frame: PoseFrame) -> tuple[Owners, Array]:
        """Instances and grasps if the poses are measured in another frame than M."""
        if frame == "object":
            return self._as_object_frame_poses()
        return self._name, inverse(self._X_SO(self._name)) @ self._X_MG

    def _as_object_frame_poses(self) -> tuple[Owners, Array]:
        """The poses taken as measured in the frame of the one object that most grasps fit."""
        assert self._scene is not None
        among = list(self._scene.instances)
        names = np.repeat(among, self.count)
        fits, _ = self._test(names, np.tile(self._X_MG, (len(among), 1, 1)))
        best = among[int(fits.reshape(len(among), -1).sum(axis=1).argmax())]
        return np.full(self.count, best), self._X_MG

    def _X_SO(self, names: Owners) -> Array:
        assert self._scene is not None
        poses = {name: self._scene.X_SO(name) for name in set(names.tolist())}
        return np.stack([poses[name] for name in names.tolist()])

    def is_supported(self, mistake: Mistake, before: Fits, after: Fits) -> bool:
        """Whether enough grasps fit after a correction to report the mistake.

        Args:
            mistake: the mistake.
            before, after: (N,) which grasps fit as read and after the correction.
        """
        about, n = self.keeps_closing_line(mistake), int(after.sum())
        if self.closing_share <= MistakeLimits.max_closing or about:
            combined = mistake.step or bool(mistake.turn and mistake.forward)
            share = MistakeLimits.min_share_combined if combined else MistakeLimits.min_share
            if about and not self._fit_only_after(before, n):
                share = MistakeLimits.min_share_about
            least = max(MistakeLimits.min_fitting, share * self.count)
        elif mistake.changes_reading:
            least = max(
                MistakeLimits.min_fitting_closing, MistakeLimits.min_share_about * self.count
            )
        elif mistake.is_known_offset and self._fit_only_after(before, n):
            least = MistakeLimits.min_share_about * self.count
        else:
            return False
        if n < least or n >= MistakeLimits.min_gain * before.sum():
            return bool(n >= least)
        gained, lost = int((after & ~before).sum()), int((before & ~after).sum())
        enough = (
            gained >= MistakeLimits.min_gained and lost <= MistakeLimits.max_lost_share * gained
        )
        nearly_all = n >= MistakeLimits.min_share_about * self.count
        return enough and mistake.changes_reading and nearly_all

    def _fit_only_after(self, before: Fits, after: int) -> bool:
        """Whether nearly all of the grasps that fit after a correction do not fit as read."""
        gained = after >= MistakeLimits.min_gain_about * before.sum()
        return after >= MIN_LIKELY_GRASPS and bool(gained)

    def formats_alike(self, mistake: Mistake) -> tuple[GraspFormat, ...]:
        """Other formats with the grasp frame of the corrected grasps."""
        if not mistake.moves_frame:
            return ()
        X_GF = self.format.X_GF(self._gripper)
        X_GF = inverse(correct_poses(np.eye(4), X_GF, mistake.correction)) @ X_GF
        same = (X_GF, make_pose(rot_z(np.pi)) @ X_GF)  # fingers are exchangeable
        return tuple(
            format
            for format in GRASP_FORMATS.values()
            if format.name != self.format.name
            and any(np.allclose(X, format.X_GF(self._gripper), atol=1e-4) for X in same)
        )


class _FitTest:
    """Test for grasps that fit: the open hand is clear of the object, and its pads close on it."""

    def __init__(self, station: Station, source: Scene | ObjectLibrary) -> None:
        from burg_drake.grasping import jaws_of

        self._station, self._source = station, source
        self.jaws = jaws_of(station.hand, station.hand_model, station.packages)
        self._screens: dict[str, HandClearance] = {}
        self._surfaces: dict[str, Surface] = {}

    def __call__(self, names: Owners, X_OG: Array) -> tuple[Fits, Fits | None]:
        """(N,) which grasps fit their object, and which are clear of the rest of the scene."""
        fits = np.zeros(len(names), dtype=bool)
        clear = np.zeros(len(names), dtype=bool)
        for name in dict.fromkeys(names.tolist()):
            mine = np.flatnonzero(names == name)
            X_WO = self._X_WO(name)
            free = mine[self._screen(name).is_clear(X_WO @ X_OG[mine])]
            held = free[self.pads_close(names[free], X_OG[free])]
            fits[held] = True
            if self._scene_clearance is not None:
                clear[held] = self._scene_clearance.is_clear(X_WO @ X_OG[held])
        return fits, None if self._scene_clearance is None else clear

    def pads_close(self, names: Owners, X_OG: Array) -> Fits:
        """(N,) at which grasps the pads close on their object, regardless of collisions."""
        from burg_drake.grasping import are_antipodal, grasp_contacts

        closing = np.zeros(len(names), dtype=bool)
        for name in dict.fromkeys(names.tolist()):
            mine = names == name
            contacts = grasp_contacts(self.surface(name), X_OG[mine], self.jaws)
            friction = max(
                MistakeLimits.min_friction, self._library.entry(self._object(name)).friction
            )
            closing[mine] = are_antipodal(contacts, X_OG[mine], friction)
        return closing

    @cached_property
    def _diagram(self) -> StationDiagram | None:
        """Diagram of the scene, if there is one."""
        from burg_drake.station import build_station_diagram

        if not isinstance(self._source, Scene):
            return None
        return build_station_diagram(self._source, self._station, robot="hand")

    @cached_property
    def _scene_clearance(self) -> HandClearance | None:
        from burg_drake.grasping import HandClearance

        return None if self._diagram is None else HandClearance(self._diagram)

    @property
    def _library(self) -> ObjectLibrary:
        return self._source.library if isinstance(self._source, Scene) else self._source

    def _object(self, name: str) -> str:
        return self._source.instance(name).object if isinstance(self._source, Scene) else name

    def _X_WO(self, name: str) -> Array:
        return np.eye(4) if self._diagram is None else self._diagram.X_WO(name)

    def _screen(self, name: str) -> HandClearance:
        from burg_drake.grasping import HandClearance, hand_clearance_alone

        if name not in self._screens:
            self._screens[name] = (
                hand_clearance_alone(self._library, name, self._station)
                if self._diagram is None
                else HandClearance(self._diagram, bodies=[name])
            )
        return self._screens[name]

    def surface(self, name: str) -> Surface:
        from burg_drake.geometry import Surface

        object = self._object(name)
        if object not in self._surfaces:
            self._surfaces[object] = Surface.of(self._library.surface(object))
        return self._surfaces[object]


_FIT_TEST_CACHE: dict[str, _FitTest] = {}
"""Last tests by station and source: a command asks about the same scene several times."""


def _cached_fit_test(station: Station, source: Scene | ObjectLibrary) -> _FitTest:
    """The test for a station and a source, built once while the same ones are asked for."""
    max_kept = 2
    library = source.library if isinstance(source, Scene) else source
    key = content_hash(station.content, source.content, str(library.root.resolve()))
    test = _FIT_TEST_CACHE.get(key)
    if test is None:
        test = _FitTest(station, source)
        for old in list(_FIT_TEST_CACHE)[: 1 - max_kept]:
            _FIT_TEST_CACHE.pop(old, None)
        _FIT_TEST_CACHE[key] = test
    return test


def _choose_mistake(
    search: _MistakeSearch, mistakes: Sequence[Mistake], fits: Fits
) -> MistakeFound | None:
    """The mistake whose correction makes most grasps fit; None if too few fit.

    Args:
        search: search with the grasps.
        mistakes: K mistakes.
        fits: (K + 1, N) which grasps fit as read and after each correction.
    """
    before = int(fits[0].sum())
    count = {
        mistake: int(after.sum())
        for mistake, after in zip(mistakes, fits[1:], strict=True)
        if search.is_supported(mistake, fits[0], after)
    }
    if not count:
        return None
    best = max(count.values())
    named = [m for m in count if not m.step]
    top = max((count[m] for m in named), default=0)
    good = [m for m in named if count[m] == top >= MistakeLimits.tie_ratio * best]
    chosen = good[0] if good else next(m for m in count if count[m] == best)
    reach = None
    if chosen.forward and chosen.moves_frame:
        adjacent = _adjacent_mistakes(chosen, count, MistakeLimits.tie_ratio * best)
        known = [m for m in count if m in adjacent and not m.step and m.forward]
        middle = 0.5 * (adjacent[0].forward + adjacent[-1].forward)
        chosen = known[0] if known else min(adjacent, key=lambda m: abs(m.forward - middle))
        reach = (adjacent[0].forward, adjacent[-1].forward)
    alike = search.formats_alike(chosen)
    return MistakeFound(
        chosen,
        before,
        count[chosen],
        search.count,
        search.total,
        likeness=tuple(format.title for format in alike),
        format=_other_reader(search.format.name, [format.name for format in alike]),
        alternatives=tuple(
            m.words
            for m in good
            if m != chosen and not (m.moves_frame and chosen.moves_frame and m.turn == chosen.turn)
        )[:2],
        reach_mm=reach,
        given=search.correction,
    )


def _adjacent_mistakes(
    chosen: Mistake, count: Mapping[Mistake, int], least: float
) -> list[Mistake]:
    """Mistakes with the same turn and adjacent distances whose corrections fit about as well."""
    same = [m for m in count if m.moves_frame and m.turn == chosen.turn]
    line = sorted(same, key=lambda mistake: mistake.forward)
    low = high = line.index(chosen)
    while low > 0 and count[line[low - 1]] >= least:
        low -= 1
    while high + 1 < len(line) and count[line[high + 1]] >= least:
        high += 1
    return line[low : high + 1]


def _other_reader(name: str, others: Sequence[str]) -> str:
    """Another format by which a file of format `name` can be read; "" if none."""
    interchangeable = ("isaac_grasp", "graspgen_yaml")  # Formats that can be read as one another.
    if name not in interchangeable:
        return ""
    return next((other for other in others if other in interchangeable), "")


def _one_instance_each(grasps: Mapping[str, GraspSet], scene: Scene) -> dict[str, GraspSet]:
    """The grasps of one instance of each object, as all its instances get the same grasps."""
    chosen: dict[str, str] = {}
    for name in grasps:
        chosen.setdefault(scene.instance(name).object, name)
    return {name: grasps[name] for name in chosen.values()}


def _spread_rows(grasps: Mapping[str, GraspSet]) -> dict[str, NDArray[np.int64]]:
    """Rows of the grasps to examine, by name of a set, spread evenly over the promising ones."""
    promising = {name: _promising_rows(part) for name, part in grasps.items()}
    total = sum(map(len, promising.values()))
    count = min(MistakeLimits.max_grasps, total)
    chosen = np.unique(np.linspace(0, total - 1, count).astype(int))
    found, begin = {}, 0
    for name, rows in promising.items():
        mine = chosen[(chosen >= begin) & (chosen < begin + len(rows))] - begin
        begin += len(rows)
        if len(mine):
            found[name] = rows[mine]
    return found


def _promising_rows(grasps: GraspSet) -> NDArray[np.int64]:
    """Rows of promising grasps; data sets contain failures, and networks predict poor grasps.

    Promising are the successes, if all scores are 0 or 1 and enough are 1; else the half with the
    highest scores, but at least `MistakeLimits.max_grasps`.
    """
    score = np.where(np.isfinite(grasps.score), grasps.score, -np.inf)
    success = score == 1.0
    known = np.unique(score)
    if np.array_equal(known, (0.0, 1.0)) and success.sum() >= MistakeLimits.min_fitting:
        return np.flatnonzero(success)
    count = max(MistakeLimits.max_grasps, len(grasps) // 2)
    return np.sort(np.argsort(-score, kind="stable")[:count])
