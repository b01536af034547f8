"""Builds object libraries: mesh -> surface -> convex pieces -> mass, stable poses, SDF, entry.

Each object is built in a hidden folder and moved into place when it is whole; `library.yaml` is
written after each object, so that a killed build keeps what it finished. What has not changed is
not built again: see `burg_drake.pipeline.stages`.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import trimesh

from burg_drake.core import BurgError, InvalidInputError, one_line
from burg_drake.objects.library import (
    LIBRARY_FILE,
    LibraryDocument,
    ObjectEntry,
    ObjectLibrary,
    load_library,
)
from burg_drake.pipeline.keys import StageKeys, stage_keys
from burg_drake.pipeline.pool import BuildTask, build_all
from burg_drake.pipeline.source import ObjectSource, object_name
from burg_drake.pipeline.stages import Built, is_current
from burg_drake.pipeline.target import check_targets, opened_for_build, scratch_folder

OnObjectBuilt = Callable[[str, str, int, int], None]
"""Called after each object with its name, its state (`built`, `cached` or `failed`), the number of
objects done and the number of all."""
OnObjectFailed = Callable[[str, str, BaseException], None]
"""Called with the name of an object that cannot be built, its line in `BuildReport.failed`, and the
error."""

SAVING_INTERVAL = 1.0
"""Least time between two writings of `library.yaml` during a build [s]."""


@dataclass(frozen=True)
class BuildReport:
    """What a build did.

    Attributes:
        library: the library as it is now, with the objects of earlier builds.
        built: names of the objects that were built or updated.
        cached: names of the objects that were up to date.
        failed: one line for each object that could not be built; of an unexpected error its kind
            and its whole text.
        notes: remarks by object, such as a mass that came from a default density.
        seconds: CPU time by object and stage, of what was really built [s].
    """

    library: ObjectLibrary
    built: tuple[str, ...] = ()
    cached: tuple[str, ...] = ()
    failed: dict[str, str] = field(default_factory=dict)
    notes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    seconds: dict[str, dict[str, float]] = field(default_factory=dict)


def build_library(
    sources: Iterable[ObjectSource | str | Path],
    out: str | Path,
    *,
    name: str | None = None,
    confirm: bool = True,
    workers: int = 1,
    progress: OnObjectBuilt | None = None,
    on_failure: OnObjectFailed | None = None,
) -> BuildReport:
    """Builds or updates a library.

    Example::

        can = burg.ObjectSource.from_file("can.stl", scale=0.001, mass=0.35)  # millimetres
        report = burg.build_library([can, "cup.obj"], "my_library")
        print(report.built, report.failed)

    Args:
        sources: objects; a path stands for `ObjectSource.from_file(path)`.
        out: the library's folder; objects in it that are not among the sources stay.
        name: the library's name; by default what it has, or else the folder's name.
        confirm: simulate the stable poses, and keep those that stand the test; otherwise, and for
            what is fixed, the quasi-static ones are taken as they are.
        workers: number of objects to work on at a time, each in a process of its own.
        progress: called after each object.
        on_failure: called at once for each object that cannot be built.

    Returns:
        The library and what was done; an object that cannot be built is in `failed`, and its
        earlier version, if there was one, stays. If none of a new library can, no files are left.

    Raises:
        InvalidInputError: `out` cannot be written to, another build is writing it, two sources have
            the same name, or an object's folder exists that is no object of this library or holds
            a source mesh. Nothing is changed then.
        DocumentError: `out` holds a `library.yaml` that cannot be read.
    """
    named = [s if isinstance(s, ObjectSource) else ObjectSource.from_file(s) for s in sources]
    _check_names(named)
    with opened_for_build(out) as root:
        library = _open(root, name)
        check_targets(named, root, library.objects)
        tally = _Tally(_renamed(library, name), len(named), progress, on_failure)
        _build(named, tally, confirm, workers)
        return tally.report(named)


def _build(named: Sequence[ObjectSource], tally: _Tally, confirm: bool, workers: int) -> None:
    root = tally.library.root
    todo: list[tuple[ObjectSource, StageKeys]] = []
    for source in named:
        checked = _confirms(source, confirm)
        entry = tally.entries.get(source.name)
        try:
            keys = stage_keys(source, checked)
            current = entry is not None and is_current(entry, keys, source, root, checked)
        except Exception as error:  # a broken mesh is one failure, whatever it breaks
            tally.fail(source.name, error)
            continue
        if current:
            tally.count(source.name, "cached")
        else:
            todo.append((source, keys))
    with scratch_folder(root) as scratch:
        work = [
            BuildTask(s, keys, root, scratch / s.name, _confirms(s, confirm))
            for s, keys in _longest_first(todo)
        ]
        try:
            for item, outcome in build_all(work, workers):
                if isinstance(outcome, Built):
                    tally.publish(item.source, outcome, scratch)
                else:
                    tally.fail(item.source.name, outcome)
        finally:
            tally.save()


def _confirms(source: ObjectSource, confirm: bool) -> bool:
    """Whether the stable poses of an object are simulated, if any are: not what is fixed."""
    return confirm and not source.fixed


def _longest_first(
    todo: list[tuple[ObjectSource, StageKeys]],
) -> list[tuple[ObjectSource, StageKeys]]:
    """Objects whose pieces are not given first, larger files before smaller ones, so that workers
    finish together."""

    def cost(item: tuple[ObjectSource, StageKeys]) -> tuple[bool, int]:
        mesh = item[0].mesh
        size = len(mesh.faces) if isinstance(mesh, trimesh.Trimesh) else Path(mesh).stat().st_size
        return item[0].pieces is None, size

    return sorted(todo, key=cost, reverse=True)


class _Tally:
    """The library while it grows, and the report."""

    def __init__(
        self,
        library: ObjectLibrary,
        total: int,
        progress: OnObjectBuilt | None,
        on_failure: OnObjectFailed | None,
    ) -> None:
        self.library = library
        self.entries: dict[str, ObjectEntry] = dict(library.objects)
        self.total = total
        self.progress = progress
        self.on_failure = on_failure
        self.saved = time.monotonic()
        self.state: dict[str, str] = {}
        self.failed: dict[str, str] = {}
        self.notes: dict[str, tuple[str, ...]] = {}
        self.seconds: dict[str, dict[str, float]] = {}

    def count(self, name: str, state: str) -> None:
        self.state[name] = state
        if self.progress is not None:
            self.progress(name, state, len(self.state), self.total)

    def fail(self, name: str, error: BaseException) -> None:
        text = " ".join(str(error).split())
        self.failed[name] = text if isinstance(error, BurgError) else one_line(error)
        if self.on_failure is not None:
            self.on_failure(name, self.failed[name], error)
        self.count(name, "failed")

    def publish(self, source: ObjectSource, built: Built, scratch: Path) -> None:
        """Moves an object's folder into place and writes the library with it."""
        if built.folder is not None:
            home = self.library.root / source.name
            before = scratch / f"{source.name}.before"
            if home.exists():
                home.rename(before)
            try:
                built.folder.rename(home)
            except BaseException:
                if before.exists() and not home.exists():
                    before.rename(home)
                raise
        self.entries[source.name] = built.entry
        if time.monotonic() > self.saved + SAVING_INTERVAL:
            self.save()
        self.notes[source.name] = built.notes
        self.seconds[source.name] = built.seconds
        self.count(source.name, "built")

    def save(self) -> None:
        """Writes the library if it has new objects."""
        if self.entries != self.library.objects:
            self.library = _with_entries(self.library, self.entries)
            self.library.save()
        self.saved = time.monotonic()

    def report(self, sources: Sequence[ObjectSource]) -> BuildReport:
        names = [s.name for s in sources]
        if not self.failed and not (self.library.root / LIBRARY_FILE).exists():
            self.library.save()
        return BuildReport(
            self.library,
            tuple(n for n in names if self.state[n] == "built"),
            tuple(n for n in names if self.state[n] == "cached"),
            {n: self.failed[n] for n in names if n in self.failed},
            {n: self.notes[n] for n in names if self.notes.get(n)},
            {n: self.seconds[n] for n in names if n in self.seconds},
        )


def _check_names(sources: Sequence[ObjectSource]) -> None:
    for name, count in Counter(s.name for s in sources).items():
        if count > 1:
            files = ", ".join(str(s.mesh) for s in sources if s.name == name)
            raise InvalidInputError(f"{count} meshes have the same object name {name!r}: {files}")


def _open(root: Path, name: str | None) -> ObjectLibrary:
    if (root / LIBRARY_FILE).exists():
        return load_library(root)
    return ObjectLibrary(LibraryDocument(name=name or object_name(root.name)), root)


def _renamed(library: ObjectLibrary, name: str | None) -> ObjectLibrary:
    if name is None or name == library.name:
        return library
    library = ObjectLibrary(replace(library.document, name=name), library.root)
    library.save()
    return library


def _with_entries(library: ObjectLibrary, entries: dict[str, ObjectEntry]) -> ObjectLibrary:
    ordered = {name: entries[name] for name in sorted(entries)}
    return ObjectLibrary(replace(library.document, objects=ordered), library.root)
