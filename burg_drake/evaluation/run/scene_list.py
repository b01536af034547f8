"""The scenes of a run over many: their names, and whether they are what they were."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.core import BurgError, InvalidInputError, UnknownNameError, content_hash, nearest
from burg_drake.core.files import DOCUMENT, read_bytes
from burg_drake.core.grasps import GraspSet
from burg_drake.core.paths import LONGEST, resolve
from burg_drake.evaluation.candidates import INSTANCE
from burg_drake.evaluation.records import CampaignDocument, SceneEntry, input_reference
from burg_drake.evaluation.run.request import Request
from burg_drake.objects.library import ObjectLibrary, load_library
from burg_drake.scene.document import Scene, SceneLike, load_scene

MANY = 5
"""So many scenes that cannot be read are named in full."""


@dataclass(frozen=True, eq=False)
class Scenes:
    """What was given.

    Attributes:
        entries: a scene each, in order.
        given: by name: the scene as loaded, or its file.
        libraries: hash of all objects of each library, by folder.
    """

    entries: tuple[SceneEntry, ...]
    given: Mapping[str, Scene | Path]
    libraries: dict[str, str]


def read_scenes(references: Sequence[SceneLike], known: CampaignDocument | None = None) -> Scenes:
    """Looks at all scenes before any work is spent on one.

    Args:
        references: scenes as loaded, or references for `load_scene`.
        known: what a run has recorded of them: a file that has not changed since is not read again.

    Raises:
        InvalidInputError: there are none, two are the same, or some cannot be read; all are named.
    """
    if not references:
        raise InvalidInputError("no scenes are given; give one or more")
    reader = _Reader(known)
    entries: list[SceneEntry] = []
    given: list[Scene | Path] = []
    problems: list[str] = []
    for reference in references:
        try:
            scene = reference if isinstance(reference, Scene) else resolve(reference, "scenes")
            entries.append(reader.entry(scene))
            given.append(scene)
        except BurgError as error:
            problems.append(str(error))
    if problems:
        more = f"; and {len(problems) - MANY} more" if len(problems) > MANY else ""
        raise InvalidInputError(
            f"{len(problems)} of {len(references)} scenes cannot be read:"
            f" {'; '.join(problems[:MANY])}{more}"
            if len(references) > 1
            else problems[0]
        )
    _require_different(entries)
    named = _with_names(entries)
    names = [entry.name for entry in named]
    return Scenes(tuple(named), dict(zip(names, given, strict=True)), reader.hashes)


def require_used(entries: Iterable[SceneEntry], request: Request) -> None:
    """Refuses names and grasps that are for none of the scenes.

    Raises:
        UnknownNameError: an object or instance is in no scene.
    """
    entries = list(entries)
    known = {n for entry in entries for pair in entry.instances.items() for n in pair}
    grasps = request.grasps
    wanted = {"only": list(request.only)}
    if isinstance(grasps, GraspSet):
        by = grasps.columns.get(INSTANCE, grasps.object)
        wanted["grasps"] = [name for name in dict.fromkeys(by.tolist()) if name]
    elif isinstance(grasps, Mapping):
        wanted["grasps"] = list(grasps)
    for what, names in wanted.items():
        for name in names:
            if name not in known:
                raise UnknownNameError(
                    f"{what}: none of {len(entries)} scenes has {name!r}; {nearest(name, known)}"
                )


class _Reader:
    """Reads scenes, and each library once."""

    def __init__(self, known: CampaignDocument | None) -> None:
        self._known = {} if known is None else {(e.path, e.file): e for e in known.scenes}
        self._were = {} if known is None else known.libraries
        self._libraries: dict[tuple[str, Path | None], ObjectLibrary] = {}
        self.hashes: dict[str, str] = {}

    def entry(self, scene: Scene | Path) -> SceneEntry:
        """The entry of a scene, under its own name."""
        if isinstance(scene, Scene):
            return self._entry(scene, "")
        path = input_reference(scene, "scenes")
        file = hashlib.sha256(read_bytes(scene, DOCUMENT.size)).hexdigest()
        known = self._known.get((path, file))
        if known is not None and self._is_unchanged(known.library):
            return known
        return self._entry(load_scene(scene, library=self.library), file)

    def library(self, reference: str, base: Path | None) -> ObjectLibrary:
        """A library, loaded once."""
        if (reference, base) not in self._libraries:
            self._libraries[reference, base] = load_library(reference, base)
        return self._libraries[reference, base]

    def _entry(self, scene: Scene, file: str) -> SceneEntry:
        root = str(scene.library.root.resolve())
        if root not in self.hashes:
            self.hashes[root] = content_hash(scene.library.content)
        return SceneEntry(
            name=scene.name,
            path=input_reference(scene.path, "scenes"),
            content=scene.content,
            file=file,
            library=root,
            instances={name: i.object for name, i in scene.instances.items()},
        )

    def _is_unchanged(self, root: str) -> bool:
        if root not in self.hashes:
            try:
                self.hashes[root] = content_hash(self.library(root, None).content)
            except BurgError:
                return False
        return self._were.get(root) == self.hashes[root]


def _require_different(entries: Sequence[SceneEntry]) -> None:
    """Refuses a scene that is given twice: its grasps would count twice."""
    seen: dict[str, SceneEntry] = {}
    for entry in entries:
        first = seen.setdefault(entry.content, entry)
        if first is not entry:
            raise InvalidInputError(
                f"{first.path} and {entry.path} are the same scene; give it once"
                if first.path != entry.path
                else f"{entry.path} is given twice; give it once"
            )


def _with_names(entries: Sequence[SceneEntry]) -> list[SceneEntry]:
    """Entries with names that differ, also where the case of letters does not count: the second
    scene of a name gets `_2`."""
    own = Counter(entry.name.casefold() for entry in entries)
    taken = {name for name, count in own.items() if count == 1}
    found = []
    for entry in entries:
        name, number = entry.name, 1
        while own[entry.name.casefold()] > 1 and name.casefold() in taken:
            number += 1
            name = f"{entry.name[: LONGEST - 8]}_{number}"
        taken.add(name.casefold())
        found.append(replace(entry, name=name))
    return found
