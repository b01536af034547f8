"""Cache of arrays that are slow to compute and depend on content only.

The cache folder has one `.npz` file per entry. Its name is the hash of its inputs. It also records
a hash of the code that computed them and the versions of numpy, scipy and Drake: an entry of
another version is not used. A damaged entry is computed again, to the same bits, and replaced. If
the folder cannot be used, arrays are computed each time.

The folder is `BURG_DRAKE_CACHE` if that is set (`off`: no cache), otherwise `burg_drake` in
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
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.array_files import NUMBER_KINDS, open_npz
from burg_drake.core.errors import InvalidInputError, UnknownNameError
from burg_drake.core.files import UNFINISHED_FILE, atomic_write, report_read_errors
from burg_drake.core.paths import expand_home
from burg_drake.core.provenance import content_hash, package_version

MAX_CACHE_BYTES = 512 << 20
"""Size of the whole cache. A robot takes 0.2 to 3 MB, a scene 10 to 25 MB."""
VERSIONED_PACKAGES = ("numpy", "scipy", "drake")
"""Dependencies whose version affects cached arrays."""

Arrays = Mapping[str, NDArray[Any]]

_log = logging.getLogger("burg_drake")


def cache_folder() -> Path | None:
    """Folder of the cache; None if there is no cache.

    Raises:
        InvalidInputError: the variable refers to the home folder of an unknown user.
    """
    variable = "BURG_DRAKE_CACHE"
    given = os.environ.get(variable, "").strip()
    if given.lower() == "off":
        return None
    if given:
        try:
            return expand_home(given)
        except UnknownNameError as error:
            raise InvalidInputError(f"{variable}: {error}") from error
    if base := os.environ.get("XDG_CACHE_HOME", ""):
        return Path(base) / "burg_drake"
    try:
        home = Path.home()
    except RuntimeError:  # a user without a home
        return None
    return home / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "burg_drake"


def cached(kind: str, content: str, make: Callable[[], Arrays]) -> Arrays:
    """Arrays from the cache, or else computed and stored there.

    Args:
        kind: kind of the arrays, in words with hyphens.
        content: hash of all inputs except the code.
        make: computes the arrays: numbers, by names that are identifiers. They must not be
            modified.
    """
    folder = cache_folder()
    if folder is None:
        return make()
    path = folder / f"{kind}-{content[:32]}.npz"
    made_by = content_hash(kind, content, *_code_version())
    found = _read_entry(path, made_by)
    if found is None:
        found = make()
        _write_entry(path, found, made_by)
    return found


def _read_entry(path: Path, made_by: str) -> Arrays | None:
    """Reads the arrays of an entry; if it cannot be used, logs the reason and returns None."""
    try:
        last_use = path.stat().st_mtime
    except OSError:
        return None  # no entry
    try:
        with report_read_errors(path, "an entry of the cache"), open_npz(path) as archive:
            origin = archive.array("made_by").read("U", ()).item()
            names = [name for name in archive.names if name != "made_by"]
            found = None
            if origin == made_by:
                found = {name: archive.array(name).read(NUMBER_KINDS) for name in names}
    except InvalidInputError as error:
        _log.warning(
            "burg-drake: %s; this was only a cached copy, so the result is computed again", error
        )
        return None
    if found is None:
        _log_other_version(path.parent)
    elif time.time() - last_use > 86_400.0:  # updated once a day
        with contextlib.suppress(OSError):
            os.utime(path)
    return found


@functools.cache
def _log_other_version(folder: Path) -> None:
    """Logs once that entries are from another version, as all are after an update: the first
    process leaves a mark file for its workers and later processes."""
    marker_prefix = ".told-"  # Empty files that record which version has logged the warning.
    mark_file = folder / f"{marker_prefix}{content_hash(*_code_version())[:16]}"
    try:
        mark_file.touch(exist_ok=False)
    except FileExistsError:
        return
    except OSError as error:
        _log.debug("%s", error)  # read-only folder: each process logs the warning
    for other in folder.glob(f"{marker_prefix}*"):
        if other != mark_file:
            with contextlib.suppress(OSError):
                other.unlink()
    _log.warning(
        "burg-drake: the cache in %s was made with another version of burg_drake or of a"
        " package that it uses. This command computes what it needs again and takes"
        " longer. You need not do anything",
        folder,
    )


def _write_entry(path: Path, arrays: Arrays, made_by: str) -> None:
    """Writes an entry if possible."""
    buffer = io.BytesIO()
    entry: dict[str, Any] = {"made_by": np.array(made_by), **arrays}
    np.savez(buffer, **entry)
    try:
        atomic_write(path, buffer.getvalue())
    except InvalidInputError as error:
        _log.debug("%s", error)  # full or read-only folder: only costs time
        return
    with contextlib.suppress(OSError):
        _remove_old_entries(path.parent)


def _remove_old_entries(folder: Path) -> None:
    """Removes unfinished files, and the least recently used entries beyond `MAX_CACHE_BYTES`."""
    entries, now = [], time.time()
    for path in folder.iterdir():
        with contextlib.suppress(OSError):  # another process has removed it
            status = path.stat()
            if path.suffix == ".npz" and not path.name.startswith("."):
                entries.append((status.st_mtime, status.st_size, path))
            elif UNFINISHED_FILE.fullmatch(path.name) and now - status.st_mtime > 3_600.0:
                path.unlink()  # left by a killed process
    total = 0
    for _, size, path in sorted(entries, reverse=True):
        total += size
        if total > MAX_CACHE_BYTES:
            with contextlib.suppress(OSError):
                path.unlink()


@functools.cache
def _code_version() -> tuple[str, ...]:
    """Hash of the code, and versions of the packages that it uses."""
    rooms = ("core", "geometry", "objects", "scene", "station", "grasping", "motion")
    package = Path(__file__).parents[1]
    files = [file for room in rooms for file in sorted((package / room).rglob("*.py"))]
    code = content_hash([file.relative_to(package).as_posix() for file in files], files)
    return code, *(package_version(name) for name in VERSIONED_PACKAGES)
