"""Documents of runs: `run.yaml` of one scene, `campaign.yaml` of many."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, is_dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Literal, TypeVar

from burg_drake.core import ONE_BY_ONE, Among, Mode, data_root, require_name
from burg_drake.evaluation.settings import Shard, TableFormat, as_shard
from burg_drake.evaluation.trial_origin import TrialOrigin
from burg_drake.scene import Scene
from burg_drake.simulation import TrialProtocol
from burg_drake.station import Engine, Station

HASH_DIGITS = 12
"""Digits of a displayed hash."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """Record of the scene or station of a run.

    Attributes:
        name: name of the scene or station.
        path: file of the document, or the name of a built-in one.
        content: hash of its content, with objects and robot models.
    """

    name: str
    path: str
    content: str


@dataclass(frozen=True, kw_only=True)
class Library:
    """Record of the object library of a run. The library is not copied.

    Attributes:
        name: name of the library.
        path: folder of the library, absolute, or as `package://`.
        objects: build hash of each object of the scene.
    """

    name: str
    path: str
    objects: dict[str, str]


@dataclass(frozen=True, kw_only=True)
class Grasps:
    """Record of the grasps of a run; the grasps are in `grasps.npz`.

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
    """Work session: one call that worked on the run.

    Attributes:
        started: date and time, ISO 8601 with time zone.
        workers: number of worker processes.
        before: number of grasps that were finished before.
        judged: number of grasps finished by this call; left out if it was killed.
        seconds: duration [s]; left out if it was killed.
        device: devices of this machine for an engine with parallel trials; left out for other
            engines and on a cluster.
        executed: number of grasps that an engine with parallel trials executed, by the devices of
            the worker, or `ONE_BY_ONE`; left out for other engines and if the call was killed.
    """

    started: str
    workers: int
    before: int | None = None
    judged: int | None = None
    seconds: float | None = None
    device: str = ""
    executed: dict[str, int] = field(default_factory=dict, hash=False)

    def finish(self, judged: Counter[str], begun: float) -> WorkSession:
        """The finished session.

        Args:
            judged: number of judged grasps by `Verdict.device`.
            begun: its start by `time.monotonic`.
        """
        executed = {device: n for device, n in sorted(judged.items()) if device and n}
        seconds = round(time.monotonic() - begun, 3)
        return replace(self, judged=judged.total(), seconds=seconds, executed=executed)


DEVICE_ENTRY = "device"
"""Entry of `RunDocument.versions` with the devices of an engine with parallel trials."""


@dataclass(frozen=True, kw_only=True)
class RunDocument:
    """A run of `burg-drake evaluate` or `reach` over one scene (`run.yaml`).

    Attributes:
        hash: hash of everything that affects the results; column `run` of the table.
        command: command line, or Python script, that began the run.
        scene: the scene.
        station: the station.
        library: the object library.
        grasps: the grasps.
        engine: physics engine and its settings.
        protocol: `lift`: objects are lifted. `shake`: they are shaken, alone and without gravity.
        trial: settings of the trials, in SI units.
        mode: `hand`: the hand alone executes the grasps. `reach`: the same, of grasps that the arm
            can execute. `arm`: the whole arm executes them.
        arm: settings of the search for arm motions, in SI units; empty in mode `hand`.
        seed: seed of the grasp sampling.
        shard: share of the grasps evaluated here, as `K/N`; empty for all.
        table: format of the results table.
        versions: versions of the software and the machine.
        stretches: work sessions of the run, one a call, in order.
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
    protocol: TrialProtocol | None = None
    trial: dict[str, float] = field(default_factory=dict)
    mode: Mode
    arm: dict[str, float] = field(default_factory=dict)
    seed: int
    shard: str = ""
    table: TableFormat = "csv"
    versions: dict[str, str] = field(default_factory=dict)
    stretches: tuple[WorkSession, ...] = ()
    hints: tuple[str, ...] = ()


MAX_SCENES_WITH_REPORTS = 100
"""With more scenes, each gets a report only on request."""


@dataclass(frozen=True, kw_only=True)
class SceneEntry:
    """A scene of the run.

    Attributes:
        name: name of the scene's folder in this run.
        path: file of the scene, or the name of a built-in one.
        content: hash of its content, with its objects.
        file: SHA-256 of the scene file; empty for a scene from memory.
        library: folder of its object library; a key of `libraries`.
        instances: objects of the free instances, by instance.
    """

    name: str
    path: str
    content: str
    file: str = ""
    library: str = ""
    instances: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_name(self.name, "name")

    def selected_instances(self, only: Collection[str]) -> dict[str, str]:
        """Objects by free instance, for instances named in `only` by instance or object name.

        All free instances if `only` is empty.
        """
        pairs = self.instances.items()
        return {name: o for name, o in pairs if not only or name in only or o in only}


@dataclass(frozen=True, kw_only=True)
class CampaignDocument:
    """A run of `burg-drake evaluate` or `reach` over many scenes (`campaign.yaml`).

    Attributes:
        hash: hash of everything that affects the results.
        command: command line, or Python script, that began the run.
        station: the station.
        grasps: the grasps of each scene.
        engine: physics engine and its settings.
        protocol: `lift`: objects are lifted. `shake`: they are shaken, alone and without gravity.
        trial: settings of the trials, in SI units.
        mode: `hand`: the hand alone executes the grasps. `reach`: the same, of grasps that the arm
            can execute. `arm`: the whole arm executes them.
        arm: settings of the search for arm motions, in SI units; empty in mode `hand`.
        seed: seed of the grasp sampling.
        shard: share of the work done here, as `K/N`; empty for all.
        table: format of the results tables.
        joints: number of the arm's joints; 0 without an arm.
        scenes: all scenes of the run, in every shard.
        libraries: hash of each object library, by folder.
        versions: versions of the software and the machine.
        stretches: work sessions of the run, one a call, in order.
        hints: usual mistakes that the given grasps show, each with a command that corrects it.
    """

    version: int = 1
    hash: str = ""
    command: str = ""
    station: Input
    grasps: Grasps
    engine: Engine
    protocol: TrialProtocol | None = None
    trial: dict[str, float] = field(default_factory=dict)
    mode: Mode
    arm: dict[str, float] = field(default_factory=dict)
    seed: int
    shard: str = ""
    table: TableFormat = "csv"
    joints: int = 0
    scenes: tuple[SceneEntry, ...]
    libraries: dict[str, str] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    stretches: tuple[WorkSession, ...] = ()
    hints: tuple[str, ...] = ()

    @property
    def assigned_scenes(self) -> tuple[SceneEntry, ...]:
        """Scenes assigned to this run (or shard), wholly or in part."""
        shard = as_shard(self.shard or None)
        if shard is None or not shard.divides_scenes(len(self.scenes)):
            return self.scenes
        return tuple(entry for k, entry in enumerate(self.scenes) if shard.has(k))

    @property
    def shard_of_grasps(self) -> Shard | None:
        """Shard of the grasps of each scene that this run judges; None for all grasps."""
        shard = as_shard(self.shard or None)
        divides = shard is not None and shard.divides_scenes(len(self.scenes))
        return None if divides else shard

    @property
    def writes_scene_reports(self) -> bool:
        """Whether each scene gets a report unless the settings say otherwise."""
        return len(self.scenes) <= MAX_SCENES_WITH_REPORTS

    @property
    def instances(self) -> list[str]:
        """Names of the free objects of all scenes."""
        return list(dict.fromkeys(name for entry in self.scenes for name in entry.instances))


AnyRunDocument = RunDocument | CampaignDocument
OneRunDocument = TypeVar("OneRunDocument", RunDocument, CampaignDocument)


def add_session(document: OneRunDocument, session: WorkSession) -> OneRunDocument:
    """The document with one more session at the end."""
    return replace(document, stretches=(*document.stretches, session))


def end_session(document: OneRunDocument, session: WorkSession) -> OneRunDocument:
    """The document with its last session, which has ended, in place of the one that began."""
    return replace(document, stretches=(*document.stretches[:-1], session))


def begin_session(workers: int, before: int, device: str = "") -> WorkSession:
    """A session that begins now; `before` is the number of grasps that have a verdict."""
    started = datetime.now(UTC).isoformat(timespec="seconds")
    return WorkSession(started=started, workers=workers, before=before, device=device)


def devices_of(document: RunDocument | CampaignDocument) -> list[str]:
    """Devices of a run with an engine with parallel trials, each once: that on which it began, and
    those of its sessions and of their workers."""
    names = dict.fromkeys((document.versions.get(DEVICE_ENTRY, ""),))
    for session in document.stretches:
        names |= dict.fromkeys((session.device, *session.executed))
    return [name for name in names if name not in ("", ONE_BY_ONE)]


def one_by_one_text(sessions: Sequence[WorkSession]) -> str:
    """How many grasps an engine with parallel trials executed on the CPU; empty if there are none.

    Args:
        sessions: sessions of a run; those that were killed do not count.
    """
    executed = sum((Counter(session.executed) for session in sessions), Counter[str]())
    if not executed[ONE_BY_ONE]:
        return ""
    return f"{executed[ONE_BY_ONE]} of {executed.total()} executed grasps {ONE_BY_ONE}"


def origin_of(document: RunDocument) -> TrialOrigin:
    """Origin that every row of the run's table records, with all devices of the run."""
    devices = devices_of(document)
    return TrialOrigin(
        scene=document.scene.path,
        scene_content=document.scene.content[:HASH_DIGITS],
        station=document.station.path,
        station_content=document.station.content[:HASH_DIGITS],
        engine=document.engine,
        mode=document.mode,
        trial=document.trial,
        versions=document.versions | ({DEVICE_ENTRY: "; ".join(devices)} if devices else {}),
        seed=document.seed,
        run=document.hash,
    )


def input_reference(path: Path, kind: str) -> str:
    """Reference to a document: the name of a built-in one, else the path."""
    builtin = path.resolve().parent == (data_root() / kind).resolve()
    return path.stem if builtin else str(path)


def input_of(document: Scene | Station, kind: str) -> Input:
    """Record of a scene or station; `kind` is the folder of the built-in ones."""
    path = input_reference(document.path, kind)
    return Input(name=document.name, path=path, content=document.content)


def settings_numbers(settings: object) -> dict[str, float]:
    """Numbers of a settings dataclass by name, without values that are None or infinite.

    Items of a tuple get the suffixes `_1`, `_2` and so on; nested settings add their own names.
    """
    found: dict[str, float] = {}
    for name, value in vars(settings).items():
        if isinstance(value, tuple):
            found |= {f"{name}_{k}": float(item) for k, item in enumerate(value, 1)}
        elif is_dataclass(value):
            found |= settings_numbers(value)
        elif value is not None and math.isfinite(value):
            found[name] = float(value)
    return found
