"""Documents of a run over many scenes: `campaign.yaml`, and the state of each scene in `scenes.jsonl`."""

from __future__ import annotations

import json
import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from burg_drake.core import (
    InvalidInputError,
    Mode,
    content_hash,
    list_names,
    open_regular,
    require_name,
)
from burg_drake.evaluation.run_document import (
    HASH_DIGITS,
    Grasps,
    Input,
    TableFormat,
    WorkSession,
    request_differences,
    request_identity,
    require_no_differences,
)
from burg_drake.evaluation.settings import Shard, as_shard
from burg_drake.station import Engine

MAX_SCENES = 100
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

    def chosen(self, only: Collection[str]) -> dict[str, str]:
        """Objects by name of the free instances whose own name or whose object's is among `only`;
        of all if that is empty."""
        pairs = self.instances.items()
        return {name: o for name, o in pairs if not only or name in only or o in only}


@dataclass(frozen=True, kw_only=True)
class CampaignDocument:
    """A run of `burg-drake evaluate` or `reach` over many scenes (`campaign.yaml`).

    Attributes:
        hash: hash of all that decides about the results.
        command: command line, or Python script, that began the run.
        station: the station.
        grasps: the grasps of each scene.
        engine: physics engine and its settings.
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
        stretches: the calls that worked on the run, in order.
        hints: usual mistakes that the given grasps show, each with a command that corrects it.
    """

    version: int = 1
    hash: str = ""
    command: str = ""
    station: Input
    grasps: Grasps
    engine: Engine
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
    def mine(self) -> tuple[SceneEntry, ...]:
        """Scenes that are judged here, wholly or in part."""
        shard = as_shard(self.shard or None)
        if shard is None or not shard.divides_scenes(len(self.scenes)):
            return self.scenes
        return tuple(entry for place, entry in enumerate(self.scenes) if shard.has(place))

    @property
    def shard_of_grasps(self) -> Shard | None:
        """The share of the grasps of each scene that is judged here; None is all."""
        shard = as_shard(self.shard or None)
        divides = shard is not None and shard.divides_scenes(len(self.scenes))
        return None if divides else shard

    @property
    def has_few_scenes(self) -> bool:
        """Whether each scene has a report of its own, if nothing else is asked for."""
        return len(self.scenes) <= MAX_SCENES

    @property
    def instances(self) -> list[str]:
        """Names of the free objects of all scenes."""
        return list(dict.fromkeys(name for entry in self.scenes for name in entry.instances))


def campaign_identity(document: CampaignDocument) -> dict[str, str]:
    """What two calls must have in common to work on the same run, in words, by topic."""
    return {"scenes": f"{len(document.scenes)} scenes", **request_identity(document)}


def campaign_hash(document: CampaignDocument) -> str:
    """Short hash of what decides about results."""
    scenes = [(entry.name, entry.content) for entry in document.scenes]
    return content_hash(campaign_identity(document), scenes)[:HASH_DIGITS]


def scene_differences(there: CampaignDocument, here: CampaignDocument) -> list[str]:
    """How the scenes of two runs differ, in words."""
    old = {entry.name: entry.content for entry in there.scenes}
    new = {entry.name: entry.content for entry in here.scenes}
    found = []
    if lost := [name for name in old if name not in new]:
        found.append(f"only there {list_names(lost)}")
    if more := [name for name in new if name not in old]:
        found.append(f"only here {list_names(more)}")
    if other := [name for name in old if name in new and old[name] != new[name]]:
        found.append(f"changed {list_names(other)}")
    if not found and list(old) != list(new):
        found.append("in another order")
    return [f"scenes: {'; '.join(found)}"] if found else []


def campaign_differences(there: CampaignDocument, here: CampaignDocument) -> list[str]:
    """What two runs differ in that must be the same in one run, in words."""
    return request_differences(there, here) + scene_differences(there, here)


def require_same_campaign(folder: Path, there: CampaignDocument, here: CampaignDocument) -> None:
    """Refuses to go on with a run that is not the one asked for.

    Raises:
        InvalidInputError: names every difference.
    """
    require_no_differences(folder, campaign_differences(there, here), there.shard, here.shard)


LEDGER_FILE = "scenes.jsonl"
LedgerState = Literal["open", "done", "failed", "empty"]


@dataclass(frozen=True, kw_only=True)
class SceneState:
    """How far a scene is.

    Attributes:
        scene: its name in the run.
        state: `open` from when its grasps are known, `done` when all that is judged here is,
            `failed` if it cannot be judged, `empty` if there are no grasps for it.
        run: hash of its run.
        grasps: how many it has.
        mine: how many of them are judged here.
        sampling: CPU time of the sampling [s].
        size: of its journal when it was done [bytes].
        failed, interrupted: grasps that could not be simulated, and those of them whose worker was
            ended from outside.
        why: it failed.
        missing: what is said of instances with fewer grasps than asked; see `results.notes`.
    """

    scene: str
    state: LedgerState
    run: str = ""
    grasps: int = 0
    mine: int = 0
    sampling: float = 0.0
    size: int = 0
    failed: int = 0
    interrupted: int = 0
    why: str = ""
    missing: str = ""


SCENE_STATE_TYPES = dict.fromkeys(("scene", "state", "run", "why", "missing"), str) | {
    "sampling": float
}
"""Types of fields; the others are whole numbers."""


class Ledger:
    """The states of scenes, kept in a file."""

    def __init__(self, folder: Path) -> None:
        """Reads the file of a run, if it is there.

        Raises:
            InvalidInputError: it cannot be read.
        """
        self._path = folder / LEDGER_FILE
        self.states: dict[str, SceneState] = {}
        self._offset = 0
        self.refresh()

    def refresh(self) -> None:
        """Reads what others have appended since."""
        max_line = 1 << 16  # Bytes.
        if not self._path.exists():
            self.states, self._offset = {}, 0
            return
        with open_regular(self._path) as stream:
            if os.fstat(stream.fileno()).st_size < self._offset:
                self.states, self._offset = {}, 0
            stream.seek(self._offset)
            while (line := stream.readline(max_line)).endswith(b"\n"):
                self._offset += len(line)
                state = _read_state(line)
                if state is not None:
                    self.states[state.scene] = state

    def note(self, state: SceneState) -> None:
        """Appends a state.

        Raises:
            InvalidInputError: the file cannot be written.
        """
        if self.states.get(state.scene) == state:
            return
        torn = self._path.exists() and not _ends_with_newline(self._path)
        line = ("\n" if torn else "") + _state_line(state)
        try:
            with self._path.open("a", encoding="utf-8") as stream:
                stream.write(line)
        except OSError as error:
            raise InvalidInputError(f"cannot write {self._path}: {error.strerror}") from error
        self.states[state.scene] = state


def ledger_text(states: Iterable[SceneState]) -> str:
    """The text of a file with these states."""
    return "".join(_state_line(state) for state in states)


def _state_line(state: SceneState) -> str:
    """Fields at their default are left out."""
    plain = asdict(SceneState(scene="", state="open"))
    fields = {
        name: value
        for name, value in asdict(replace(state, why=state.why[:4000])).items()
        if value != plain[name] or name in ("scene", "state")
    }
    return json.dumps(fields, separators=(",", ":")) + "\n"


def _read_state(line: bytes) -> SceneState | None:
    try:
        stored = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not isinstance(stored, Mapping) or not isinstance(stored.get("scene"), str):
        return None
    fields: dict[str, Any] = dict(stored)
    if fields.get("state") not in ("open", "done", "failed", "empty"):
        return None
    if any(type(value) is not SCENE_STATE_TYPES.get(name, int) for name, value in fields.items()):
        return None
    try:
        return SceneState(**fields)
    except TypeError:
        return None


def _ends_with_newline(path: Path) -> bool:
    with open_regular(path) as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - 1))
        return size == 0 or stream.read(1) == b"\n"
