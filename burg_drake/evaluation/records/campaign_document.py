"""The document of a run over many scenes, `campaign.yaml`: which scenes, and what is asked."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

from burg_drake.core import content_hash, listing
from burg_drake.core.grasps import Mode
from burg_drake.core.paths import require_name
from burg_drake.evaluation.records.identity import (
    request_differences,
    request_identity,
    require_no_differences,
)
from burg_drake.evaluation.records.run_document import (
    HASH_DIGITS,
    Grasps,
    Input,
    TableFormat,
    WorkSession,
)
from burg_drake.evaluation.records.shard import Shard, as_shard
from burg_drake.station.document import Engine

FEW_SCENES = 100
"""Of more scenes than these only who asks for it gets a report of each."""


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
        return len(self.scenes) <= FEW_SCENES

    @property
    def instances(self) -> list[str]:
        """Names of the free objects of all scenes."""
        return list(dict.fromkeys(name for entry in self.scenes for name in entry.instances))


def identity(document: CampaignDocument) -> dict[str, str]:
    """What two calls must have in common to work on the same run, in words, by topic."""
    return {"scenes": f"{len(document.scenes)} scenes", **request_identity(document)}


def campaign_hash(document: CampaignDocument) -> str:
    """Short hash of what decides about results."""
    scenes = [(entry.name, entry.content) for entry in document.scenes]
    return content_hash(identity(document), scenes)[:HASH_DIGITS]


def scene_differences(there: CampaignDocument, here: CampaignDocument) -> list[str]:
    """How the scenes of two runs differ, in words."""
    old = {entry.name: entry.content for entry in there.scenes}
    new = {entry.name: entry.content for entry in here.scenes}
    found = []
    if lost := [name for name in old if name not in new]:
        found.append(f"only there {listing(lost)}")
    if more := [name for name in new if name not in old]:
        found.append(f"only here {listing(more)}")
    if other := [name for name in old if name in new and old[name] != new[name]]:
        found.append(f"changed {listing(other)}")
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
