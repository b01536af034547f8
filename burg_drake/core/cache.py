"""What takes long to compute and follows from content alone, kept from one process to the next.

A folder of the user's has one `.npz` file an entry, named by what its arrays were computed from,
with a hash of the code that has computed them and of the versions of numpy, scipy and Drake: an
entry of another version is not used. Whatever is wrong with an entry, its arrays are computed
again, to the same bits, and take its place; whatever is wrong with the folder, they are computed
each time.

The folder is `BURG_DRAKE_CACHE`, if that is set (`off`: none); else `burg_drake` in
`XDG_CACHE_HOME`, `~/Library/Caches` on macOS, or `~/.cache`. It may be deleted at any time.
"""

from __future__ import annotations

import contextlib
import functools
import io
import logging
import os
import sys
import time
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.content import content_hash
from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.core.files import (
    NUMBERS,
    UNFINISHED,
    NpzFile,
    atomic_write,
    open_npz,
    reporting_read_errors,
)
from burg_drake.core.paths import expanded

VARIABLE = "BURG_DRAKE_CACHE"
OFF = "off"
MOST_BYTES = 512 << 20
"""Of all entries; those that nobody has asked for the longest are removed beyond it. A robot takes
0.2 to 3 MB, a scene 10 to 25 MB."""
TOUCHED = 86_400.0
"""An entry in use is marked as such no more often than that [s]."""
ABANDONED = 3_600.0
"""A file that has not got its name for so long [s] is of a process that was killed."""
TOLD = ".told-"
"""What the name of an empty file begins with that says which version has told of other ones."""
ROOMS = ("core", "geometry", "objects", "scene", "station", "grasping", "motion")
"""Packages whose code decides about what is kept."""
VERSIONED_PACKAGES = ("numpy", "scipy", "drake")
"""Packages whose version does."""
VERSION_KEY = "made_by"
"""Name of the array that says what an entry was computed by, and from what."""

Arrays = Mapping[str, NDArray[Any]]

_log = logging.getLogger("burg_drake")


def cache_folder() -> Path | None:
    """Where entries are kept; None if they are not.

    Raises:
        InvalidInputError: the variable names a home folder that nobody has.
    """
    given = os.environ.get(VARIABLE, "").strip()
    if given.lower() == OFF:
        return None
    if given:
        try:
            return expanded(given)
        except UnknownNameError as error:
            raise InvalidInputError(f"{VARIABLE}: {error}") from error
    if base := os.environ.get("XDG_CACHE_HOME", ""):
        return Path(base) / "burg_drake"
    try:
        home = Path.home()
    except RuntimeError:  # a user without a home
        return None
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "burg_drake"


def cached(kind: str, content: str, make: Callable[[], Arrays]) -> Arrays:
    """Arrays from the cache, or computed and kept there.

    Args:
        kind: what they are, in words with hyphens.
        content: hash of all that they follow from, but for the code.
        make: computes them: arrays of numbers by names that are identifiers. They may be changed by
            nobody afterwards.
    """
    folder = cache_folder()
    if folder is None:
        return make()
    path = folder / f"{kind}-{content[:32]}.npz"
    made_by = content_hash(kind, content, *_code_version())
    found = _read(path, made_by)
    if found is None:
        found = make()
        _write(path, found, made_by)
    return found


def _read(path: Path, made_by: str) -> Arrays | None:
    """What an entry holds; None, and a line that says why, where it cannot be used."""
    try:
        mark = path.stat().st_mtime
    except OSError:
        return None  # there is none
    try:
        with reporting_read_errors(path, "an entry of the cache"), open_npz(path) as archive:
            origin = archive.array(VERSION_KEY).read("U", ()).item()
            found = _arrays(archive) if origin == made_by else None
    except InvalidInputError as error:
        _log.warning(
            "burg-drake: %s; this was only a cached copy, so the result is computed again", error
        )
        return None
    if found is None:
        _log_other_version(path.parent)
    elif time.time() - mark > TOUCHED:
        with contextlib.suppress(OSError):
            os.utime(path)
    return found


@functools.cache
def _log_other_version(folder: Path) -> None:
    """One line, as after an update that is so of all entries: the first process that finds one
    leaves a mark for its workers and for those that come later."""
    mark = folder / f"{TOLD}{content_hash(*_code_version())[:16]}"
    try:
        mark.touch(exist_ok=False)
    except FileExistsError:
        return
    except OSError as error:
        _log.debug("%s", error)  # a folder that is read-only: each process tells it
    for other in folder.glob(f"{TOLD}*"):
        if other != mark:
            with contextlib.suppress(OSError):
                other.unlink()
    _log.warning(
        "burg-drake: the cache in %s was made with another version of burg_drake or of a"
        " package that it uses. This command computes what it needs again and takes"
        " longer. You need not do anything",
        folder,
    )


def _arrays(archive: NpzFile) -> Arrays:
    return {
        name: archive.array(name).read(NUMBERS) for name in archive.names if name != VERSION_KEY
    }


def _write(path: Path, arrays: Arrays, made_by: str) -> None:
    """Writes an entry, if that is possible."""
    buffer = io.BytesIO()
    every: dict[str, Any] = {VERSION_KEY: np.array(made_by), **arrays}
    np.savez(buffer, **every)
    try:
        atomic_write(path, buffer.getvalue())
    except InvalidInputError as error:
        _log.debug("%s", error)  # a folder that is full or read-only: nothing is lost but time
        return
    with contextlib.suppress(OSError):
        _limit(path.parent)


def _limit(folder: Path) -> None:
    """Removes the entries longest unused beyond `MOST_BYTES`, and what killed processes left."""
    entries, now = [], time.time()
    for path in folder.iterdir():
        with contextlib.suppress(OSError):  # another process has removed it
            found = path.stat()
            if path.suffix == ".npz" and not path.name.startswith("."):
                entries.append((found.st_mtime, found.st_size, path))
            elif UNFINISHED.fullmatch(path.name) and now - found.st_mtime > ABANDONED:
                path.unlink()
    total = 0
    for _, size, path in sorted(entries, reverse=True):
        total += size
        if total > MOST_BYTES:
            with contextlib.suppress(OSError):
                path.unlink()


@functools.cache
def _code_version() -> tuple[str, ...]:
    """Hash of the code, and versions of what it computes with."""
    package = Path(__file__).parents[1]
    files = [file for room in ROOMS for file in sorted((package / room).rglob("*.py"))]
    code = content_hash([file.relative_to(package).as_posix() for file in files], files)
    return code, *(_version(name) for name in VERSIONED_PACKAGES)


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:  # a Drake that was built from source has no metadata
        return "unknown"
