"""Executes a recorded trial again, and compares outcome and margins bit for bit."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from burg_drake.core import (
    INSTANCE_PREFIXES,
    JUDGING_PACKAGES,
    BurgError,
    InvalidInputError,
    MarginNames,
    Margins,
    MissingDependencyError,
    Mode,
    RecordedFields,
    Stage,
    UnknownNameError,
    Verdict,
    format_column_values,
    resolve_reference,
    software_versions,
)
from burg_drake.evaluation.judge import StationJudge, build_judge, judge_grasp, mode_for
from burg_drake.evaluation.results_table import RecordedTrial
from burg_drake.evaluation.run_document import DEVICE_ENTRY, HASH_DIGITS
from burg_drake.evaluation.run_folder import RUN_FILE, load_run
from burg_drake.evaluation.trial_origin import (
    TrialOrigin,
    motion_text,
    protocol_of,
    recorded_motion_text,
)
from burg_drake.motion import Plan
from burg_drake.scene import Scene, load_scene
from burg_drake.simulation import TrialResult, describe_devices, find_devices
from burg_drake.station import Engine, GraspMotion, Station, load_station

CPU_DEVICE = "cpu"
"""Name and description of Warp's CPU device."""
Document = TypeVar("Document", Scene, Station)
DocumentSource = tuple[str, Callable[[], Document]]


@dataclass(frozen=True)
class TrialInputs:
    """Scene and station on which a trial is replayed.

    Attributes:
        scene, station: the scene and station that were found.
        notes: differences from the recorded documents, in words; empty if there are none.
    """

    scene: Scene
    station: Station
    notes: tuple[str, ...] = ()


def find_inputs(
    origin: TrialOrigin,
    where: str,
    folder: Path,
    *,
    scene: str | None = None,
    station: str | None = None,
    force: bool = False,
) -> TrialInputs:
    """Loads the scene and station of a recorded trial, identified by their content hashes.

    Args:
        origin: origin that the row records.
        where: name of the row, for messages.
        folder: folder of the table; if it is the row's run, its copies come first.
        scene, station: files to use instead.
        force: also accept documents with another content.

    Raises:
        InvalidInputError: a document is missing, or has another content; the message says which
            one is needed.
    """
    scenes: list[DocumentSource[Scene]]
    stations: list[DocumentSource[Station]]
    scene_path, station_path = scene or origin.scene, station or origin.station
    scenes = [(scene_path, lambda: load_scene(_existing_file(scene_path, "scenes")))]
    stations = [(station_path, lambda: load_station(_existing_file(station_path, "stations")))]
    if origin.run and (folder / RUN_FILE).exists():
        run = load_run(folder)
        if run.document.hash == origin.run:
            scenes[:0] = [] if scene else [("the run's copy", run.scene)]
            stations[:0] = [] if station else [("the run's copy", run.station)]
    found = {
        "scene": _find_document("scene", origin, scenes, force),
        "station": _find_document("station", origin, stations, force),
    }
    missing = {kind: text for kind, text in found.items() if isinstance(text, str)}
    if missing:
        by_force = ["force"] if any("by force" in text for text in missing.values()) else []
        raise InvalidInputError(f"{where} needs {'; and '.join(missing.values())}").about(
            *missing, *by_force
        )
    notes = tuple(note for _, note in found.values() if note)
    return TrialInputs(found["scene"][0], found["station"][0], notes)


def _existing_file(reference: str, kind: str) -> Path:
    """Path of a document; if it does not exist, the error lists no alternatives."""
    try:
        return resolve_reference(reference, kind)
    except UnknownNameError as error:
        raise UnknownNameError(f"{reference} does not exist") from error


def _find_document(
    kind: str, origin: TrialOrigin, sources: Sequence[DocumentSource[Any]], force: bool
) -> Any:
    """Finds the document with the recorded content.

    Returns:
        The document, and a note if `force` accepted one with another content; or, if none was
        found, a text that says which one is needed.
    """
    content = origin.scene_content if kind == "scene" else origin.station_content
    problems: list[str] = []
    other = None
    for name, load in sources:
        try:
            document = load()
        except BurgError as error:
            problems.append(str(error))
            continue
        if document.content.startswith(content):
            return document, ""
        problems.append(f"{name} has content {document.content[:HASH_DIGITS]}")
        other = other or document
    found = "; ".join(problems)
    if other is not None and force:
        return other, f"the {kind} is not the one of the trial (content {content}): {found}"
    meant = "objects and their library count" if kind == "scene" else "robot models count"
    copy = f"a copy is {kind}.yaml in the folder of run {origin.run}"
    go_on = f", or replay on {other.path} by force" if other is not None else ""
    return (
        f"the {kind} with content {content} ({meant}), but {found}; give its file ({copy}){go_on}"
    )


@dataclass(frozen=True)
class Difference:
    """A result that differs from the recorded one.

    Attributes:
        name: name of the result.
        recorded, now: values of the result; NaN or an empty text if there is none.
    """

    name: str
    recorded: float | str
    now: float | str

    @property
    def rounding(self) -> bool:
        """Whether rounding by a program that rewrote the table explains the difference."""
        if isinstance(self.recorded, str) or isinstance(self.now, str):
            return False
        spreadsheet_tolerance = 1e-14  # Spreadsheets write 15 digits.
        return math.isclose(self.recorded, self.now, rel_tol=spreadsheet_tolerance)

    def __str__(self) -> str:
        return f"{self.name}: recorded {self.recorded!r}, now {self.now!r}"


@dataclass(frozen=True)
class ReplayEngine:
    """Engine that gives recorded trials their verdicts again.

    Attributes:
        engine: the recorded engine; or that of the same physics on the CPU.
        device: device of an engine with parallel trials, see `BatchTrial`.
        description: its name with versions, see `describe_devices`; empty for other engines.
    """

    engine: Engine
    device: str | None = None
    description: str = ""

    def __str__(self) -> str:
        if not self.engine.parallel:
            return f"engine {self.engine.name} on the CPU"
        where = "Warp's CPU device" if self.description == CPU_DEVICE else self.description
        return f"engine {self.engine.name} on {where}"

    def repeats_bits(self, origin: TrialOrigin) -> bool:
        """Whether it has the same results as the recorded engine, to the bit, if the versions of
        all packages are the same."""
        if not origin.engine.parallel:
            return True
        recorded = origin.versions.get(DEVICE_ENTRY, "").replace(" ", "_")
        return self.engine.parallel and self.description.replace(" ", "_") == recorded


def replay_engine(origin: TrialOrigin) -> ReplayEngine:
    """The recorded engine; for one with parallel trials, that of the same physics on the CPU if
    this machine lacks a device of the recorded kind: a card, or Warp's CPU device."""
    if not origin.engine.parallel:
        return ReplayEngine(origin.engine)
    device = CPU_DEVICE if origin.versions.get(DEVICE_ENTRY) == CPU_DEVICE else None
    try:
        found = find_devices(device)
    except (InvalidInputError, MissingDependencyError):
        return ReplayEngine(origin.engine.serial)
    return ReplayEngine(origin.engine, device, describe_devices(found))


def rerun(
    scene: Scene,
    station: Station,
    trial: RecordedTrial,
    origin: TrialOrigin,
    engine: ReplayEngine | None = None,
) -> tuple[Verdict, Plan | None]:
    """Judges a grasp again with the recorded settings.

    The arm is checked only if it decided the outcome, or executed the grasp.

    Args:
        scene, station: scene and station to judge on.
        trial: the recorded trial.
        origin: its origin.
        engine: engine that judges; `replay_engine` if None.

    Returns:
        The verdict, and the plan if the arm executed one.

    Raises:
        InvalidInputError: this release lacks a setting, or the scene is invalid.
    """
    judge = judge_of_trial(scene, station, trial, origin, engine or replay_engine(origin))
    verdict = judge_grasp(judge, trial.candidate)
    return verdict, judge.plan


def judge_of_trial(
    scene: Scene,
    station: Station,
    trial: RecordedTrial,
    origin: TrialOrigin,
    engine: ReplayEngine | None = None,
) -> StationJudge:
    """The cheapest judge that gives a recorded trial its verdict again.

    Args:
        scene, station, trial, origin: see `rerun`.
        engine: engine that judges. If None, trials are executed one by one on the CPU; then results
            differ by rounding if it was executed on a graphics card.
    """
    engine = engine or ReplayEngine(origin.engine.serial)
    return build_judge(
        scene,
        station,
        engine=engine.engine,
        mode=mode_for(station, decisive_mode(trial, origin)),
        settings=origin.settings(),
        device=engine.device,
    )


def decisive_mode(trial: RecordedTrial, origin: TrialOrigin) -> Mode:
    """Cheapest mode that leads to the same verdict."""
    stage = None if trial.verdict is None else trial.verdict.stage
    by_hand = stage is Stage.CLEAR or (origin.mode == "reach" and stage is Stage.EXECUTED)
    return "hand" if by_hand else origin.mode


def differences(recorded: Verdict, now: Verdict) -> list[Difference]:
    """Results that differ in any bit, except times and arm configurations."""
    there, here = _compared_results(recorded), _compared_results(now)
    if "clearance" not in there:  # recorded by a release that did not measure it
        here.pop("clearance", None)
    name = MarginNames.lift_height
    if math.isnan(recorded.margins.get(name, math.nan)):  # likewise, or a trial without stages
        here.pop(name, None)
    if math.isnan(recorded.margins.get("others_turned", math.nan)):  # centres of mass were measured
        there, here = (_drop_object_motions(found) for found in (there, here))
    # The arm may have passed a grasp on, and is not asked again.
    for name in MarginNames.arm_screen:
        if name not in here:
            there.pop(name, None)
    found = []
    for name in {**there, **here}:
        empty = "" if isinstance(there.get(name, here.get(name)), str) else math.nan
        a, b = there.get(name, empty), here.get(name, empty)
        if _float_bits(a) != _float_bits(b):
            found.append(Difference(name, a, b))
    return found


def comparison(found: Sequence[Difference], origin: TrialOrigin, engine: ReplayEngine) -> list[str]:
    """Differences as lines of text; `as recorded` if there are none.

    Args:
        found: the differences.
        origin: origin of the recorded trial.
        engine: engine that has judged again.
    """
    if not found:
        return ["as recorded"]
    if all(difference.rounding for difference in found):
        names = ", ".join(difference.name for difference in found)
        return [f"as recorded, except for the last digits of {names}, which the table rounds"]
    has_other_outcome = any(one.name == "outcome" for one in found)
    if not has_other_outcome and not engine.repeats_bits(origin):
        return [f"as recorded, but for what {engine} rounds in another way", *map(str, found)]
    there = origin.versions
    here = software_versions({**JUDGING_PACKAGES, **origin.engine.packages})
    if engine.description:
        here[DEVICE_ENTRY] = engine.description
    changed = [
        f"{name} {there[name]}, now {here[name]}"
        for name in there
        if name in here and there[name].replace(" ", "_") != here[name].replace(" ", "_")
    ]
    versions = f" (with {'; '.join(changed)})" if changed else ""
    return [f"differs from what was recorded{versions}", *map(str, found)]


def _compared_results(verdict: Verdict) -> dict[str, float | str]:
    """Results that are compared, by displayed name, texts first."""
    found = {
        name: value
        for one in RecordedFields.verdict
        for name, value in one.replayed_values(getattr(verdict, one.name)).items()
    }
    if found.get("end_time") == 0.0:  # a trial that never began may lack an end time
        del found["end_time"]
    return dict(sorted(found.items(), key=lambda one: not isinstance(one[1], str)))


def _drop_object_motions(found: Mapping[str, float | str]) -> dict[str, float | str]:
    """Results without the distances and angles by which objects were moved and turned."""
    names = {"others_moved", "others_turned", "toppled", "pushed"}
    of_each = tuple(prefix.replace("_", " ") for prefix in INSTANCE_PREFIXES.values())
    return {k: v for k, v in found.items() if k not in names and not k.startswith(of_each)}


def _float_bits(value: float | str) -> str:
    return value if isinstance(value, str) else float(value).hex()


def arm_figures(verdict: Verdict) -> list[str]:
    """Margins of the arm's screen as lines of text; empty if the arm was not checked."""
    others = {*MarginNames.trial, MarginNames.lift_height}
    of_arm = [name for name in MarginNames.all if name not in others]
    figures = format_column_values(verdict.margins, of_arm)
    return [figures] if figures else []


def motion_figures(trial: RecordedTrial, origin: TrialOrigin) -> list[str]:
    """Motion of the hand as lines of text; empty for the default motion."""
    if protocol_of(origin.trial) == "shake":
        return [
            f"motion: {recorded_motion_text(origin.trial)}; shown in the frame of the hand, which"
            " therefore stands still"
        ]
    motion = origin.settings().motion
    if motion is None or motion == GraspMotion():
        return []
    whole = trial.lift is None or trial.lift >= motion.lift_height
    room = "" if whole else f"; there is room to lift it {1e3 * (trial.lift or 0.0):g} mm"
    return [f"motion: {motion_text(motion)}{room}"]


def as_result(verdict: Verdict) -> TrialResult:
    """Converts a verdict to the result of a trial."""
    trial_margins = Margins().of_trial().keys()
    margins = Margins(**{k: v for k, v in verdict.margins.items() if k in trial_margins})
    return TrialResult(outcome=verdict.outcome, **verdict.of_trial() | {"margins": margins})
