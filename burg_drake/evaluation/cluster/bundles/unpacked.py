"""Bundles on a worker's machine: each is unpacked once, whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import secrets
import shutil
import time
import zipfile
from pathlib import Path

from burg_drake.core import InvalidInputError

FOLDER = "burg-drake-bundles"
UNUSED = 86_400.0
"""What nobody has asked for so long is removed [s]."""


def bundle_folder(place: Path, name: str) -> Path | None:
    """Where a bundle is; None if it is not on this machine. It is kept for a day from now."""
    folder = place / FOLDER / name
    if not folder.is_dir():
        return None
    with contextlib.suppress(OSError):  # another user's, who can read it nonetheless
        os.utime(folder)
    return folder


def unpack(data: bytes, place: Path, name: str) -> Path:
    """Unpacks a bundle, unless it is there.

    Args:
        data: the zip.
        place: folder of this machine for what is of passing use.
        name: SHA-256 of `data`.

    Returns:
        The folder.

    Raises:
        InvalidInputError: the data are others, or cannot be written, or something else is in
            their place.
    """
    if hashlib.sha256(data).hexdigest() != name:
        raise InvalidInputError(f"bundle {name[:12]} was damaged on the way")
    every = place / FOLDER
    folder, unfinished = every / name, every / f".{name}.{secrets.token_hex(8)}"
    try:
        every.mkdir(mode=0o700, parents=True, exist_ok=True)
        _remove_unused(every)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if _is_whole(folder, archive):
                return folder
            shutil.rmtree(folder, ignore_errors=True)  # what somebody has removed files of
            archive.extractall(unfinished)
            try:
                unfinished.rename(folder)
            except OSError:
                if not _is_whole(folder, archive):  # otherwise another process was first
                    raise
    except OSError as error:
        raise InvalidInputError(
            f"cannot unpack the scene into {folder}: {error.strerror}; give Dask's"
            " workers another local directory"
        ) from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return folder


def _is_whole(folder: Path, archive: zipfile.ZipFile) -> bool:
    """Whether a folder has the files of an archive, as they are there."""
    try:
        return all((folder / n).read_bytes() == archive.read(n) for n in archive.namelist())
    except OSError:
        return False


def _remove_unused(every: Path) -> None:
    """Removes old bundles, and what killed processes left."""
    for path in every.iterdir():
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > UNUSED:
                shutil.rmtree(path, ignore_errors=True)
