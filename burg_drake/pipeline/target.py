"""The folder that a library is built in: locked while a build writes, and never somebody else's.

A build replaces the folder of each object as a whole. It therefore only starts when each of them is
new, or was made by an earlier build.
"""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import trimesh

from burg_drake.core import InvalidInputError
from burg_drake.core.files import try_lock, without_locks, writable_folder
from burg_drake.objects.library import LIBRARY_FILE
from burg_drake.pipeline.record import is_object_folder
from burg_drake.pipeline.source import NAME_PATTERN, ObjectSource

LOCK_FILE = ".library.lock"
"""Exists while a build runs, and is empty; a lock on it ends with the process, however it ends."""

SCRATCH = ".building-"
"""What the names of folders begin with in which objects are built."""


@contextmanager
def opened_for_build(out: str | Path) -> Iterator[Path]:
    """Makes and locks the folder of a library; a new one that gets no library is removed again.

    Yields:
        The absolute path of the folder.

    Raises:
        InvalidInputError: it cannot be written to, or another build is writing it.
    """
    root = Path(os.path.realpath(out))
    new = [p for p in (root, *root.parents) if not os.path.lexists(p)]
    try:
        writable_folder(root)
        with _locked(root):
            for abandoned in root.glob(f"{SCRATCH}[0-9]*"):  # by builds that were killed
                shutil.rmtree(abandoned, ignore_errors=True)
            yield root
    finally:
        if not os.path.lexists(root / LIBRARY_FILE):
            with suppress(OSError):  # it is not empty
                for folder in new:
                    folder.rmdir()


@contextmanager
def scratch_folder(root: Path) -> Iterator[Path]:
    """A hidden folder beside the objects, for as long as they are built."""
    prefix = f"{SCRATCH}{os.getpid()}-"
    with tempfile.TemporaryDirectory(dir=root, prefix=prefix) as scratch:
        yield Path(scratch)


def check_targets(sources: Sequence[ObjectSource], root: Path, known: Collection[str]) -> None:
    """Checks that nothing is replaced but objects of this library.

    Args:
        sources: what is to be built.
        root: the library's folder.
        known: names of the objects in it.

    Raises:
        InvalidInputError: the folder of an object holds something else, or a source mesh.
    """
    homes = [root / s.name for s in sources if NAME_PATTERN.fullmatch(s.name)]
    for home in homes:
        if os.path.lexists(home) and home.name not in known and not is_object_folder(home):
            raise InvalidInputError(
                f"{home} exists and is not an object of this library; move it away,"
                " rename the mesh, or choose another output folder"
            )
    replaced = {_identity(home): home for home in homes if home.exists()}
    files = [s.mesh for s in sources if not isinstance(s.mesh, trimesh.Trimesh)]
    for mesh in files:
        file = Path(mesh)
        for folder in {*file.absolute().parents, *Path(os.path.realpath(file)).parents}:
            inside = replaced.get(_identity(folder)) if folder.exists() else None
            if inside is not None:
                raise InvalidInputError(
                    f"{mesh} lies in {inside}, which the build would overwrite; move the"
                    " mesh, or choose another output folder"
                )


def _identity(folder: Path) -> tuple[int, int]:
    """The same for all paths to a folder, through links and on disks that ignore case."""
    status = folder.stat()
    return status.st_dev, status.st_ino


@contextmanager
def _locked(root: Path) -> Iterator[None]:
    path = root / LOCK_FILE
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
            raise without_locks(root, error) from error
        if not current:  # held, or its holder removed it just now
            raise InvalidInputError(
                f"{root} is being written by another build; wait for it, or choose another"
                " output folder"
            )
        try:
            yield
        finally:
            path.unlink(missing_ok=True)  # while it is locked: who opens it later makes a new one
    finally:
        os.close(file)
