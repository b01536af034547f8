"""The document of a run, `run.yaml`: what was judged, how, with which versions, and when."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, Protocol

from burg_drake.core import InvalidInputError, content_hash
from burg_drake.core.grasps import Among, Mode
from burg_drake.core.paths import data_root
from burg_drake.evaluation.records.limit_numbers import (
    APPROACH,
    limits_text,
    measure_text,
    without_limits,
)
from burg_drake.evaluation.records.motion_numbers import motion_in, motion_text, without_motion
from burg_drake.evaluation.records.origin import TrialOrigin, engine_label
from burg_drake.scene.document import Scene
from burg_drake.station.document import Engine, Station

TableFormat = Literal["csv", "parquet"]

SETTINGS = "settings of engine, trial and arm"
"""A topic of `identity`."""
HASH_DIGITS = 12
"""Digits of a hash that people get to see."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """A document that went into the run; a copy lies in the run's folder.

    Attributes:
        name: its name.
        path: where it was, or the name of a built-in one.
        content: hash of all that matters in it and behind it (objects, robot models).
    """

    name: str
    path: str
    content: str


@dataclass(frozen=True, kw_only=True)
class Library:
    """The object library; it is not copied.

    Attributes:
        name: its name.
        path: its folder, absolute, or as package://.
        objects: build hash of each object in the scene.
    """

    name: str
    path: str
    objects: dict[str, str]


@dataclass(frozen=True, kw_only=True)
class Grasps:
    """The candidates; they are in grasps.npz.

    Attributes:
        origin: sampled here, or given by the user.
        per_object: how many were asked for, if sampled.
        approach_angle_deg: largest angle between their approach and straight down, if sampled.
        blind: whether they were sampled without regard to the hand, as they were in runs that do
            not say.
        only: instances that grasps were sampled or judged on; all if empty.
        until_balanced, balanced_among, max_per_object: as `EvaluationSettings` has them; 0 where
            grasps were sampled once.
        asked: with `until_balanced`, how many grasps were sampled so far for each instance of an
            object: ordinary and slippery ones.
        count: how many there are.
        objects: how many there are by object; 0 where an object has none.
        content: hash of them all.
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
    count: int
    objects: dict[str, int]
    content: str
    cpu: float = 0.0


@dataclass(frozen=True, kw_only=True)
class WorkSession:
    """One call that worked on the run; there are several if it was interrupted.

    Attributes:
        started: date and time, ISO 8601 with time zone.
        workers: number of worker processes.
        before: grasps that had a verdict when it began; unknown in runs of earlier versions.
        judged: grasps judged in it; unknown if it was killed.
        seconds: wall time it took; unknown if it was killed.
    """

    started: str
    workers: int
    before: int | None = None
    judged: int | None = None
    seconds: float | None = None


@dataclass(frozen=True, kw_only=True)
class RunDocument:
    """Schema of run.yaml.

    Attributes:
        hash: `run_hash`, once the candidates are known; column `run` of the results file.
        command: the command line, or the Python script, that began the run.
        scene, station, library, grasps: what was judged.
        engine: how trials were stepped.
        trial: settings of the trial's phases, and how its results were measured.
        mode: what was asked about each grasp.
        arm: settings of the search for the arm's motions; none in mode `hand`.
        seed: of the sampling.
        shard: which share of the grasps is judged here, as `K/N`; all of them if empty.
        table: format of the results file.
        versions: of the software and the machine.
        stretches: sessions in which it was worked on.
        hints: usual mistakes that given grasps show, one sentence each.
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


def begun_now(workers: int, before: int) -> WorkSession:
    """A session that begins now, when so many grasps have a verdict."""
    started = datetime.now(UTC).isoformat(timespec="seconds")
    return WorkSession(started=started, workers=workers, before=before)


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


def identity(document: RunDocument) -> dict[str, str]:
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
    simulated = "simulated" if document.trial.get(APPROACH) else "not simulated"
    return {
        "station": f"content {document.station.content[:HASH_DIGITS]}",
        "engine": engine_label(engine),
        SETTINGS: settings,
        "motion": motion_text(motion_in(document.trial)),
        "limit in the hand": limits_text(document.trial),
        "motion of others": measure_text(document.trial),
        **({} if document.mode == "arm" else {"approach of the hand": simulated}),
        "mode": document.mode,
        "grasps": (
            _sampled(grasps) if sampled else f"given, content {grasps.content[:HASH_DIGITS]}"
        ),
        **angle,
        "seed": str(document.seed),
        "burg_drake": document.versions.get("burg_drake", ""),
        "drake": document.versions.get("drake", ""),
        **{name: document.versions.get(name, "not recorded") for name in engine.packages},
    }


def _sampled(grasps: Grasps) -> str:
    how = "sampled blind" if grasps.blind else "clear of the scene"
    where = f", on {', '.join(grasps.only)}" if grasps.only else ""
    balance = (
        f", more until each object has {grasps.until_balanced} lifted and"
        f" {grasps.until_balanced} failing ones (counted: {grasps.balanced_among}; at most"
        f" {grasps.max_per_object} grasps)"
        if grasps.until_balanced
        else ""
    )
    return f"{grasps.per_object} an object, {how}{where}{balance}"


def run_hash(document: RunDocument) -> str:
    """Short hash of what decides about a run's results: `identity` and the candidates."""
    return content_hash(identity(document), document.grasps.content)[:HASH_DIGITS]


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


def require_same_run(folder: Path, there: RunDocument, here: RunDocument) -> None:
    """Refuses to go on with a run that is not the one asked for.

    Raises:
        InvalidInputError: names every difference.
    """
    found = differences(identity(there), identity(here))
    if found:
        raise InvalidInputError(
            f"{folder} holds another run ({'; '.join(found)}); choose another folder, or delete it"
        ).about("out")
    require_same_shard(folder, there.shard, here.shard)


def require_same_shard(folder: Path, there: str, here: str) -> None:
    """Refuses to go on with another share of the same run.

    Raises:
        InvalidInputError: names both.
    """
    if there != here:
        held = f"shard {there} of this run" if there else "all of this run"
        asked = f"shard {here}" if here else "no shard"
        raise InvalidInputError(
            f"{folder} holds {held}, and {asked} is given; choose another folder; merge shards"
            " with burg-drake merge"
        ).about("out")


def differences(there: dict[str, str], here: dict[str, str]) -> list[str]:
    """Topics that two identities have in common and differ in, in words."""
    topics = [k for k in there if k in here and there[k] != here[k]]
    if "engine" in topics or "mode" in topics:  # settings differ too, which says nothing more
        topics = [k for k in topics if k != SETTINGS]
    return [f"{k} is {there[k]} there, {here[k]} here" for k in topics]


def input_reference(path: Path, kind: str) -> str:
    """How a user refers to a document: the bare name of a built-in one, else the path."""
    builtin = path.resolve().parent == (data_root() / kind).resolve()
    return path.stem if builtin else str(path)


def input_of(document: Scene | Station, kind: str) -> Input:
    """The record of a scene or station; `kind` is the folder of the built-in ones."""
    path = input_reference(document.path, kind)
    return Input(name=document.name, path=path, content=document.content)


def numbers(settings: object) -> dict[str, float]:
    """The numbers of a settings dataclass by name; those of a tuple are counted from 1, those of
    settings within settings have their own names, and what is None or infinite is left out."""
    found: dict[str, float] = {}
    for name, value in vars(settings).items():
        if isinstance(value, tuple):
            found |= {f"{name}_{k}": float(item) for k, item in enumerate(value, 1)}
        elif is_dataclass(value):
            found |= numbers(value)
        elif value is not None and math.isfinite(value):
            found[name] = float(value)
    return found
