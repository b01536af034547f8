"""The document of a run, `run.yaml`, and the comparison of two runs or calls by what decides results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, Protocol

from burg_drake.core import Among, InvalidInputError, Mode, content_hash, data_root, list_names
from burg_drake.evaluation.trial_origin import (
    TrialOrigin,
    engine_label,
    limits_text,
    measure_text,
    motion_text,
    read_motion,
    without_limits,
    without_motion,
)
from burg_drake.scene import Scene
from burg_drake.station import Engine, Station

TableFormat = Literal["csv", "parquet"]

HASH_DIGITS = 12
"""Digits of a hash that people get to see."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """A scene or station that was used.

    Attributes:
        name: name of the scene or station.
        path: its file, or the name of a built-in one.
        content: hash of its content, with objects and robot models.
    """

    name: str
    path: str
    content: str


@dataclass(frozen=True, kw_only=True)
class Library:
    """The object library of a run. It is not copied.

    Attributes:
        name: name of the library.
        path: its folder, absolute, or as `package://`.
        objects: build hash of each object of the scene.
    """

    name: str
    path: str
    objects: dict[str, str]


@dataclass(frozen=True, kw_only=True)
class Grasps:
    """The grasps of a run; they are in `grasps.npz`.

    Attributes:
        origin: whether the grasps were sampled or given.
        per_object: number of sampled grasps wanted per object.
        approach_angle_deg: largest angle between approach and straight down of sampled grasps
            [degrees].
        blind: whether grasps were sampled without regard to the hand's size.
        only: instances or objects that were evaluated; all if empty.
        until_balanced: number of successes and failures per object at which sampling stops; 0 to
            sample once.
        balanced_among: grasps that count for `until_balanced`: all, those with the hand `clear`,
            those the arm can reach (`reachable`), or those tried in simulation (`executed`).
        max_per_object: largest number of grasps per object with `until_balanced`; 0 without it.
        asked: with `until_balanced`, the numbers of ordinary and of slippery grasps sampled per
            object so far.
        correction: corrections that given grasps were read with.
        count: number of grasps.
        objects: number of grasps of each object.
        content: hash of all grasps.
        cpu: CPU time of the sampling [s].
    """

    origin: Literal["sampled", "given"]
    per_object: int | None = None
    approach_angle_deg: float | None = None
    blind: bool = True
    only: tuple[str, ...] = ()
    until_balanced: int = 0
    balanced_among: Among = "executed"
    max_per_object: int = 0
    asked: dict[str, tuple[int, int]] = field(default_factory=dict)
    correction: tuple[str, ...] = ()
    count: int
    objects: dict[str, int]
    content: str
    cpu: float = 0.0


@dataclass(frozen=True, kw_only=True)
class WorkSession:
    """One call that worked on the run.

    Attributes:
        started: date and time, ISO 8601 with time zone.
        workers: number of worker processes.
        before: number of grasps that were finished before.
        judged: number of grasps finished by this call; left out if it was killed.
        seconds: duration [s]; left out if it was killed.
    """

    started: str
    workers: int
    before: int | None = None
    judged: int | None = None
    seconds: float | None = None


@dataclass(frozen=True, kw_only=True)
class RunDocument:
    """A run of `burg-drake evaluate` or `reach` over one scene (`run.yaml`).

    Attributes:
        hash: hash of all that decides about the results; column `run` of the table.
        command: command line, or Python script, that began the run.
        scene: the scene.
        station: the station.
        library: the object library.
        grasps: the grasps.
        engine: physics engine and its settings.
        trial: settings of the trials, in SI units.
        mode: `hand`: the hand alone executes the grasps. `reach`: the same, of grasps that the arm
            can execute. `arm`: the whole arm executes them.
        arm: settings of the search for arm motions, in SI units; empty in mode `hand`.
        seed: seed of the grasp sampling.
        shard: share of the grasps evaluated here, as `K/N`; empty for all.
        table: format of the results table.
        versions: versions of the software and the machine.
        stretches: the calls that worked on the run, in order.
        hints: usual mistakes that the given grasps show, each with a command that corrects it.
    """

    version: int = 1
    hash: str = ""
    command: str = ""
    scene: Input
    station: Input
    library: Library
    grasps: Grasps
    engine: Engine
    trial: dict[str, float] = field(default_factory=dict)
    mode: Mode
    arm: dict[str, float] = field(default_factory=dict)
    seed: int
    shard: str = ""
    table: TableFormat = "csv"
    versions: dict[str, str] = field(default_factory=dict)
    stretches: tuple[WorkSession, ...] = ()
    hints: tuple[str, ...] = ()


def begin_session(workers: int, before: int) -> WorkSession:
    """A session that begins now, when so many grasps have a verdict."""
    started = datetime.now(UTC).isoformat(timespec="seconds")
    return WorkSession(started=started, workers=workers, before=before)


def origin_of(document: RunDocument) -> TrialOrigin:
    """What every row of the run's table tells of it."""
    return TrialOrigin(
        scene=document.scene.path,
        scene_content=document.scene.content[:HASH_DIGITS],
        station=document.station.path,
        station_content=document.station.content[:HASH_DIGITS],
        engine=document.engine,
        mode=document.mode,
        trial=document.trial,
        versions=document.versions,
        seed=document.seed,
        run=document.hash,
    )


def input_reference(path: Path, kind: str) -> str:
    """How a user refers to a document: the bare name of a built-in one, else the path."""
    builtin = path.resolve().parent == (data_root() / kind).resolve()
    return path.stem if builtin else str(path)


def input_of(document: Scene | Station, kind: str) -> Input:
    """The record of a scene or station; `kind` is the folder of the built-in ones."""
    path = input_reference(document.path, kind)
    return Input(name=document.name, path=path, content=document.content)


def settings_numbers(settings: object) -> dict[str, float]:
    """The numbers of a settings dataclass by name; those of a tuple are counted from 1, those of
    settings within settings have their own names, and what is None or infinite is left out."""
    found: dict[str, float] = {}
    for name, value in vars(settings).items():
        if isinstance(value, tuple):
            found |= {f"{name}_{k}": float(item) for k, item in enumerate(value, 1)}
        elif is_dataclass(value):
            found |= settings_numbers(value)
        elif value is not None and math.isfinite(value):
            found[name] = float(value)
    return found


SETTINGS_TOPIC = "settings of engine, trial and arm"
"""A topic of `run_identity`."""


class RunRequestFields(Protocol):
    """What a call asks about each scene; documents of runs say it, see `RunDocument`."""

    @property
    def station(self) -> Input: ...
    @property
    def grasps(self) -> Grasps: ...
    @property
    def engine(self) -> Engine: ...
    @property
    def trial(self) -> dict[str, float]: ...
    @property
    def mode(self) -> Mode: ...
    @property
    def arm(self) -> dict[str, float]: ...
    @property
    def seed(self) -> int: ...
    @property
    def versions(self) -> dict[str, str]: ...


def run_identity(document: RunDocument) -> dict[str, str]:
    """What two calls must have in common to work on the same run, in words, by topic."""
    return {
        "scene": f"content {document.scene.content[:HASH_DIGITS]}",
        **request_identity(document),
    }


def request_identity(document: RunRequestFields) -> dict[str, str]:
    """The same of all scenes that it is asked about, in words, by topic."""
    grasps, engine = document.grasps, document.engine
    others = [without_limits(without_motion(values)) for values in (document.trial, document.arm)]
    settings = content_hash(vars(engine), *others)[:HASH_DIGITS]
    sampled = grasps.origin == "sampled"
    angle = {"approach angle": f"{grasps.approach_angle_deg} degrees"} if sampled else {}
    simulated = "simulated" if document.trial.get("approach") else "not simulated"
    return {
        "station": f"content {document.station.content[:HASH_DIGITS]}",
        "engine": engine_label(engine),
        SETTINGS_TOPIC: settings,
        "motion": motion_text(read_motion(document.trial)),
        "limit in the hand": limits_text(document.trial),
        "motion of others": measure_text(document.trial),
        **({} if document.mode == "arm" else {"approach of the hand": simulated}),
        "mode": document.mode,
        "grasps": (
            _sampling_words(grasps)
            if sampled
            else f"given, content {grasps.content[:HASH_DIGITS]}{_approach_words(grasps)}"
        ),
        **angle,
        "seed": str(document.seed),
        "burg_drake": document.versions.get("burg_drake", ""),
        "drake": document.versions.get("drake", ""),
        **{name: document.versions.get(name, "not recorded") for name in engine.packages},
    }


def _sampling_words(grasps: Grasps) -> str:
    how = "sampled blind" if grasps.blind else "clear of the scene"
    balance = (
        f", more until each object has {grasps.until_balanced} lifted and"
        f" {grasps.until_balanced} failing ones (counted: {grasps.balanced_among}; at most"
        f" {grasps.max_per_object} grasps)"
        if grasps.until_balanced
        else ""
    )
    return f"{grasps.per_object} an object, {how}{_approach_words(grasps)}{balance}"


def _approach_words(grasps: Grasps) -> str:
    return f", on {', '.join(grasps.only)}" if grasps.only else ""


def run_hash(document: RunDocument) -> str:
    """Short hash of what decides about a run's results: `run_identity` and the candidates."""
    return content_hash(run_identity(document), document.grasps.content)[:HASH_DIGITS]


def run_differences(there: RunDocument, here: RunDocument) -> list[str]:
    """How two runs differ in what must be the same in one run, in words."""
    return identity_differences(
        run_identity(there),
        run_identity(here),
        {
            "scene": [_scene_difference(there, here)],
            **_difference_words(there, here, ("there", "here")),
        },
    )


def request_differences(
    there: RunRequestFields, here: RunRequestFields, sides: Sequence[str] = ("there", "here")
) -> list[str]:
    """The same of what is asked, whatever the scene.

    Args:
        there, here: documents of runs.
        sides: what the two are called.
    """
    first, second = request_identity(there), request_identity(here)
    return identity_differences(first, second, _difference_words(there, here, sides), sides)


def identity_differences(
    there: Mapping[str, str],
    here: Mapping[str, str],
    words: Mapping[str, Sequence[str]],
    sides: Sequence[str] = ("there", "here"),
) -> list[str]:
    """Topics that two identities have in common and differ in, in words.

    Args:
        there, here: texts by topic.
        words: differences by topic, of topics whose texts are hashes.
        sides: what the two are called.
    """
    topics = [k for k in there if k in here and there[k] != here[k]]
    if "engine" in topics or "mode" in topics:  # settings differ too, which says nothing more
        topics = [k for k in topics if k != SETTINGS_TOPIC]
    found: list[str] = []
    for topic in topics:
        found += words.get(topic) or [_topic_difference(topic, there[topic], here[topic], sides)]
    return found


def input_difference(
    topic: str,
    there: Input,
    here: Input,
    sides: Sequence[str] = ("there", "here"),
    behind: str = "models",
) -> str:
    """How two documents with different contents differ, in words.

    Args:
        topic: what they are.
        there, here: the documents.
        sides: what the two are called.
        behind: which files beside the document make its content.
    """
    if there.path != here.path:
        return _topic_difference(topic, there.path, here.path, sides)
    return f"{topic} {here.path} has changed, or {behind} that it uses have"


def setting_differences(
    there: Mapping[str, object],
    here: Mapping[str, object],
    sides: Sequence[str] = ("there", "here"),
) -> list[str]:
    """Settings that differ by name, with both values."""
    names = [k for k in {**there, **here} if there.get(k) != here.get(k)]
    values = [(k, there.get(k, "not recorded"), here.get(k, "not recorded")) for k in names]
    return [
        _topic_difference(name, str(first), str(second), sides) for name, first, second in values
    ]


def _difference_words(
    there: RunRequestFields, here: RunRequestFields, sides: Sequence[str]
) -> dict[str, list[str]]:
    """Differences by topic, of topics whose texts in `request_identity` have hashes."""
    return {
        "station": [input_difference("station", there.station, here.station, sides)],
        SETTINGS_TOPIC: setting_differences(_all_settings(there), _all_settings(here), sides),
        "grasps": grasp_differences(there.grasps, here.grasps, sides),
    }


def _scene_difference(there: RunDocument, here: RunDocument) -> str:
    old, new = there.library.objects, here.library.objects
    built = [name for name in new if name in old and old[name] != new[name]]
    if built and there.scene.path == here.scene.path:
        return f"scene {here.scene.path} has objects that were built again: {list_names(built)}"
    return input_difference("scene", there.scene, here.scene, behind="objects")


def grasp_differences(
    there: Grasps, here: Grasps, sides: Sequence[str] = ("there", "here")
) -> list[str]:
    """How the grasps of two runs differ, in words."""
    found = []
    if there.correction != here.correction:
        first, second = (",".join(g.correction) or "none" for g in (there, here))
        found = [_topic_difference("correction", first, second, sides)]
    first, second = (_grasps_words(grasps) for grasps in (there, here))
    if first != second:
        found.append(_topic_difference("grasps", first, second, sides))
    given = "given " if there.origin == "given" else ""
    return found or [f"the {given}grasps are others"]


def _grasps_words(grasps: Grasps) -> str:
    if grasps.origin == "sampled":
        return _sampling_words(grasps)
    count = f"{grasps.count} given" if grasps.count else "given"
    return f"{count} for {list_names(grasps.only)} alone" if grasps.only else count


def _all_settings(document: RunRequestFields) -> dict[str, object]:
    """Settings of engine, trial and arm by name, without those that are topics of their own."""
    found = dict(vars(document.engine))
    for values in (document.trial, document.arm):
        found |= without_limits(without_motion(values))
    return found


def _topic_difference(topic: str, there: str, here: str, sides: Sequence[str]) -> str:
    verb = "are" if topic == "grasps" else "is"
    return f"{topic} {verb} {there} {sides[0]}, {here} {sides[1]}"


def require_same_run(folder: Path, there: RunDocument, here: RunDocument) -> None:
    """Refuses to go on with a run that is not the one asked for.

    Raises:
        InvalidInputError: names every difference.
    """
    require_no_differences(folder, run_differences(there, here), there.shard, here.shard)


def require_no_differences(folder: Path, differences: Sequence[str], there: str, here: str) -> None:
    """Refuses to go on with another run, or with another shard of the same one.

    Args:
        folder: holds the run.
        differences: how the runs differ, in words.
        there, here: shards of the run in the folder and of the one asked for.

    Raises:
        InvalidInputError: names every difference, or both shards.
    """
    if differences:
        raise InvalidInputError(
            f"{folder} already holds another run ({'; '.join(differences)}); choose"
            " another folder, or delete it"
        ).about("out")
    if there != here:
        held = f"shard {there} of this run" if there else "all of this run"
        asked = f"shard {here}" if here else "no shard"
        raise InvalidInputError(
            f"{folder} holds {held}, but {asked} is given; choose another folder. Shards"
            " are merged by burg-drake merge"
        ).about("out")
