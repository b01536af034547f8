"""The document of a run, `run.yaml`: what was judged, how, with which versions, and when."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal

from burg_drake.core.grasps import Among, Mode
from burg_drake.core.paths import data_root
from burg_drake.evaluation.records.origin import TrialOrigin
from burg_drake.scene.document import Scene
from burg_drake.station.document import Engine, Station

TableFormat = Literal["csv", "parquet"]

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
        correction: with which a file of given ones was read, see `FileReading`.
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
    correction: tuple[str, ...] = ()
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
        hints: usual mistakes that given grasps show, in sentences; a further line of one is a
            command that evaluates them again.
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
