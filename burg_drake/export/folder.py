"""The folder of an export: written beside its place, then renamed, and never somebody else's."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from burg_drake.core import DocumentError, InvalidInputError, listing
from burg_drake.core.documents import load_document, save_document
from burg_drake.core.files import writable_folder

RECORD_FILE = "export.yaml"
"""Says what an export is of, and which files it wrote: those are replaced by the next one."""


@dataclass(frozen=True, kw_only=True)
class ExportRecord:
    """An exported scene (`export.yaml`).

    Attributes:
        format: format of the export.
        scene: name of the scene.
        scene_content: hash of the scene and its objects.
        station: name of the station; empty without one.
        main: file to open.
        software: name and version of the program that wrote it.
        files: all other files, relative to the folder.
    """

    version: int = 1
    format: str
    scene: str
    scene_content: str
    station: str = ""
    main: str
    software: str
    files: tuple[str, ...] = ()


def require_own_folder(folder: str | Path) -> Path:
    """Where an export goes.

    Args:
        folder: new, empty, or the outcome of an earlier export with nothing else in it.

    Returns:
        Its real path, through links.

    Raises:
        InvalidInputError: it is a file, or has anything else in it.
    """
    path = Path(os.path.realpath(folder))
    if not os.path.lexists(path):
        return path
    if not path.is_dir():
        raise InvalidInputError(f"{folder} is a file; name a folder for the export")
    present = _files(path)
    if not present and not any(path.iterdir()):
        return path
    try:
        known = load_document(path / RECORD_FILE, ExportRecord).files
    except DocumentError as error:
        raise InvalidInputError(
            f"{folder} has files in it and is not an earlier export; choose a new folder"
        ) from error
    foreign = sorted(set(present) - {*known, RECORD_FILE})
    if foreign:
        raise InvalidInputError(
            f"{folder} is an earlier export, but has files in it that the export did not"
            f" write ({listing(foreign)}); move them away, or choose a new folder"
        )
    return path


@contextmanager
def replaced_folder(path: Path) -> Iterator[Path]:
    """A new folder beside `path`, which takes its place when the block ends without an error.

    Args:
        path: of `require_own_folder`.

    Yields:
        The folder to write into.

    Raises:
        InvalidInputError: the place cannot be written to; what was there is there still.
    """
    token = secrets.token_hex(8)
    fresh, old = (path.with_name(f".{path.name}.{token}{end}") for end in ("", ".old"))
    writable_folder(path.parent)
    try:
        fresh.mkdir()
        yield fresh
        _exchange(fresh, path, old)
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable place"
        ) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def _exchange(fresh: Path, path: Path, old: Path) -> None:
    """Puts `fresh` in the place of `path`, which is moved to `old` until that has worked."""
    if path.exists():
        path.rename(old)
    try:
        fresh.rename(path)
    except OSError:
        if old.exists():
            old.rename(path)
        raise
    shutil.rmtree(old, ignore_errors=True)


def write_record(folder: Path, record: ExportRecord) -> None:
    """Writes `export.yaml` with the names of all files that are in the folder.

    Args:
        folder: all else is written.
        record: without files.
    """
    save_document(replace(record, files=tuple(_files(folder))), folder / RECORD_FILE)


def _files(folder: Path) -> list[str]:
    """What is in a folder and in those in it, relative to it."""
    found = (p for p in folder.rglob("*") if p.is_symlink() or not p.is_dir())
    return sorted(p.relative_to(folder).as_posix() for p in found)
