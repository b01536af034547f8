"""Builds object libraries, in this process or in worker processes, into a locked folder."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import trimesh

from burg_drake.core import (
    BurgError,
    InvalidInputError,
    SimulationError,
    ensure_writable_folder,
    map_unordered,
    missing_locks_error,
    one_line,
    try_lock,
)
from burg_drake.objects import (
    LIBRARY_FILE,
    LibraryDocument,
    ObjectEntry,
    ObjectLibrary,
    check_size,
    load_library,
)
from burg_drake.pipeline.build_record import StageKeys, is_object_folder, stage_keys
from burg_drake.pipeline.object_build import BuiltObject, build_object, is_current
from burg_drake.pipeline.object_source import OBJECT_NAME_PATTERN, ObjectSource, object_name


@contextmanager
def open_for_build(out: str | Path) -> Iterator[Path]:
    """Makes and locks the folder of a library; a new folder is removed again if it gets no library.

    Yields:
        The absolute path of the folder.

    Raises:
        InvalidInputError: it cannot be written to, or another build is writing it.
    """
    root = Path(os.path.realpath(out))
    new = [p for p in (root, *root.parents) if not os.path.lexists(p)]
    try:
        ensure_writable_folder(root)
        with _lock_library(root):
            for abandoned in root.glob(".building-[0-9]*"):  # left by killed builds
                shutil.rmtree(abandoned, ignore_errors=True)
            yield root
    finally:
        if not os.path.lexists(root / LIBRARY_FILE):
            with suppress(OSError):  # it is not empty
                for folder in new:
                    folder.rmdir()


def check_targets(sources: Sequence[ObjectSource], root: Path, known: Collection[str]) -> None:
    """Checks that a build replaces only objects of this library.

    Args:
        sources: objects to build.
        root: the library's folder.
        known: names of the library's objects.

    Raises:
        InvalidInputError: the folder of an object holds something else, or a source mesh.
    """
    homes = [root / s.name for s in sources if OBJECT_NAME_PATTERN.fullmatch(s.name)]
    for home in homes:
        if os.path.lexists(home) and home.name not in known and not is_object_folder(home):
            raise InvalidInputError(
                f"{home} exists and is not an object of this library; move it away,"
                " rename the mesh, or choose another output folder"
            )
    replaced = {_folder_identity(home): home for home in homes if home.exists()}
    files = [s.mesh for s in sources if not isinstance(s.mesh, trimesh.Trimesh)]
    for mesh in files:
        file = Path(mesh)
        for folder in {*file.absolute().parents, *Path(os.path.realpath(file)).parents}:
            inside = replaced.get(_folder_identity(folder)) if folder.exists() else None
            if inside is not None:
                raise InvalidInputError(
                    f"{mesh} lies in {inside}, which the build would overwrite; move the"
                    " mesh, or choose another output folder"
                )


def _folder_identity(folder: Path) -> tuple[int, int]:
    """Identity of a folder, equal for all paths to it, with links and on case-insensitive disks."""
    status = folder.stat()
    return status.st_dev, status.st_ino


@contextmanager
def _lock_library(root: Path) -> Iterator[None]:
    path = root / ".library.lock"
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InvalidInputError(f"cannot write {path}: {error.strerror}") from error
    try:
        try:
            current = try_lock(file) and os.path.samestat(os.fstat(file), os.stat(path))
        except FileNotFoundError:
            current = False
        except OSError as error:
            raise missing_locks_error(root, error) from error
        if not current:  # locked by another build, or just removed by one
            raise InvalidInputError(
                f"{root} is being written by another build; wait for it, or choose another"
                " output folder"
            )
        try:
            yield
        finally:
            # The file is still locked, so that the next build makes a new one.
            path.unlink(missing_ok=True)
    finally:
        os.close(file)


@dataclass(frozen=True)
class BuildTask:
    """An object to build.

    Attributes:
        source: object to build.
        keys: stage keys of the source.
        root: the library's folder.
        folder: folder to build in; made when the work begins.
        confirm: simulate the stable poses.
    """

    source: ObjectSource
    keys: StageKeys
    root: Path
    folder: Path
    confirm: bool


def check_task_size(task: BuildTask) -> None:
    """Refuses an object that is too small or too large for a table.

    Raises:
        MeshError: the file cannot be read, or its size tells of a wrong unit.
    """
    check_size(task.source.mesh, task.source.scale)


def run_build_task(task: BuildTask) -> BuiltObject:
    """Builds one object.

    Raises:
        SimulationError: Drake ended by a failed condition.
        Exception: any other error that a broken mesh causes.
    """
    task.folder.mkdir()
    try:
        return build_object(task.source, task.keys, task.root, task.folder, task.confirm)
    except SystemExit as error:  # DRAKE_DEMAND ends this way
        raise SimulationError(f"Drake failed: {error}") from error


OnObjectBuilt = Callable[[str, str, int, int], None]
"""Called after each object with its name, its state (`built`, `cached` or `failed`), the number of
objects done and the number of all."""
OnObjectFailed = Callable[[str, str, BaseException], None]
"""Called with the name of an object that cannot be built, its line in `BuildReport.failed`, and the
error."""


@dataclass(frozen=True)
class BuildReport:
    """Result of a build.

    Attributes:
        library: the updated library, with the objects of earlier builds.
        built: names of the objects that were built or updated.
        cached: names of the objects that were up to date.
        failed: one line for each object that could not be built; for an unexpected error, its type
            and full text.
        notes: remarks by object, such as a mass computed from the default density.
        seconds: CPU time by object and stage, without cached stages [s].
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
        name: the library's name; by default its present name, or else the folder's name.
        confirm: simulate the stable poses and keep those that pass the test; otherwise, and for
            fixed objects, all quasi-static poses are kept.
        workers: number of objects to build at a time, each in its own process.
        progress: called after each object.
        on_failure: called at once for each object that cannot be built.

    Returns:
        The library and the report. An object that cannot be built is in `failed`, and its earlier
        version, if any, stays. If no object of a new library can be built, no files remain.

    Raises:
        InvalidInputError: `out` cannot be written to, another build is writing it, two sources have
            the same name, or the folder of an object exists already, but belongs to no object of
            this library or holds a source mesh. Nothing is changed then.
        DocumentError: `out` holds a `library.yaml` that cannot be read.
    """
    named = [s if isinstance(s, ObjectSource) else ObjectSource.from_file(s) for s in sources]
    _check_names(named)
    with open_for_build(out) as root:
        if (root / LIBRARY_FILE).exists():
            library = load_library(root)
        else:
            library = ObjectLibrary(LibraryDocument(name=name or object_name(root.name)), root)
        check_targets(named, root, library.objects)
        if name is not None and name != library.name:
            library = ObjectLibrary(replace(library.document, name=name), root)
            library.save()
        tally = _BuildProgress(library, len(named), progress, on_failure)
        _build_objects(named, tally, confirm, workers)
        return tally.report(named)


def _build_objects(
    named: Sequence[ObjectSource], tally: _BuildProgress, confirm: bool, workers: int
) -> None:
    root = tally.library.root
    todo: list[tuple[ObjectSource, StageKeys]] = []
    for source in named:
        checked = confirm and not source.fixed  # fixed objects need no simulation
        entry = tally.entries.get(source.name)
        try:
            keys = stage_keys(source, checked)
            current = entry is not None and is_current(entry, keys, source, root, checked)
        except Exception as error:  # a broken mesh may cause any error
            tally.fail(source.name, error)
            continue
        if current:
            tally.count(source.name, "cached")
        else:
            todo.append((source, keys))
    prefix = f".building-{os.getpid()}-"
    with tempfile.TemporaryDirectory(dir=root, prefix=prefix) as scratch:
        work = [
            BuildTask(s, keys, root, Path(scratch, s.name), confirm and not s.fixed)
            for s, keys in _longest_first(todo)
        ]
        try:
            # Sizes are checked first, to report a wrong unit before anything takes long.
            for task, outcome in map_unordered(run_build_task, work, workers, check_task_size):
                if isinstance(outcome, BuiltObject):
                    tally.publish(task.source, outcome, Path(scratch))
                else:
                    tally.fail(task.source.name, outcome)
        finally:
            tally.save()


def _longest_first(
    todo: list[tuple[ObjectSource, StageKeys]],
) -> list[tuple[ObjectSource, StageKeys]]:
    """Sorts objects without given pieces first, larger files before smaller ones, so that workers
    finish together."""

    def cost(item: tuple[ObjectSource, StageKeys]) -> tuple[bool, int]:
        mesh = item[0].mesh
        size = len(mesh.faces) if isinstance(mesh, trimesh.Trimesh) else Path(mesh).stat().st_size
        return item[0].pieces is None, size

    return sorted(todo, key=cost, reverse=True)


class _BuildProgress:
    """Progress of a build: the growing library, and the report."""

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

    def publish(self, source: ObjectSource, built: BuiltObject, scratch: Path) -> None:
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
        if time.monotonic() > self.saved + 1.0:  # seconds between writes of `library.yaml`
            self.save()
        self.notes[source.name] = built.notes
        self.seconds[source.name] = built.seconds
        self.count(source.name, "built")

    def save(self) -> None:
        """Writes the library if it has new objects."""
        if self.entries != self.library.objects:
            ordered = {name: self.entries[name] for name in sorted(self.entries)}
            document = replace(self.library.document, objects=ordered)
            self.library = ObjectLibrary(document, self.library.root)
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
