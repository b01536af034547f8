"""Bundles on a worker's machine, and recipes by which child processes build judges from them."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import pickle
import secrets
import shutil
import time
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from burg_drake.core import InvalidInputError
from burg_drake.evaluation.judge import Judge

BUNDLES_FOLDER = "burg-drake-bundles"  # Folder of all unpacked bundles of a machine.


def bundle_folder(place: Path, name: str) -> Path | None:
    """Folder of an unpacked bundle; None if absent. Keeps the bundle for another day."""
    folder = place / BUNDLES_FOLDER / name
    if not folder.is_dir():
        return None
    with contextlib.suppress(OSError):  # belongs to another user; readable nonetheless
        os.utime(folder)
    return folder


def unpack(data: bytes, place: Path, name: str) -> Path:
    """Unpacks a bundle unless this was done before.

    Args:
        data: the zip.
        place: folder of this machine for temporary files.
        name: SHA-256 of `data`.

    Returns:
        The folder.

    Raises:
        InvalidInputError: the data do not match the name or cannot be written, or the folder has
            other content.
    """
    if hashlib.sha256(data).hexdigest() != name:
        raise InvalidInputError(f"bundle {name[:12]} was damaged on the way")
    every = place / BUNDLES_FOLDER
    folder, unfinished = every / name, every / f".{name}.{secrets.token_hex(8)}"
    try:
        every.mkdir(mode=0o700, parents=True, exist_ok=True)
        _remove_unused(every)
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if _is_complete(folder, archive):
                return folder
            shutil.rmtree(folder, ignore_errors=True)  # an incomplete folder
            archive.extractall(unfinished)
            try:
                unfinished.rename(folder)
            except OSError:
                if not _is_complete(folder, archive):  # whole if another process was first
                    raise
    except OSError as error:
        raise InvalidInputError(
            f"cannot unpack the scene into {folder}: {error.strerror}; give Dask's"
            " workers another local directory"
        ) from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return folder


def _is_complete(folder: Path, archive: zipfile.ZipFile) -> bool:
    """Whether a folder has all files of an archive, unchanged."""
    try:
        return all((folder / n).read_bytes() == archive.read(n) for n in archive.namelist())
    except OSError:
        return False


def _remove_unused(every: Path) -> None:
    """Removes old bundles and remains of killed processes."""
    max_age = 86_400.0  # Seconds since the last use.
    for path in every.iterdir():
        with contextlib.suppress(OSError):
            if time.time() - path.stat().st_mtime > max_age:
                shutil.rmtree(path, ignore_errors=True)


@dataclass(frozen=True)
class JudgeRecipe:
    """Pickled factory of a judge, unpickled where it is called.

    Attributes:
        make_judge: a factory, pickled.
        bundle: name of the bundle that the factory needs; empty if none.
        folder: folder of the bundle on this machine.
    """

    make_judge: bytes
    bundle: str = ""
    folder: Path | None = None

    @cached_property
    def key(self) -> str:
        """Key of the judge."""
        return hashlib.sha256(self.make_judge).hexdigest()

    def __call__(self) -> Judge:
        factory: Callable[[], Judge] = _Unpacker(self.make_judge, self.folder).load()
        return factory()


class _Unpacker(pickle.Unpickler):
    """The counterpart of `bundle._Packer`."""

    def __init__(self, data: bytes, folder: Path | None) -> None:
        super().__init__(io.BytesIO(data))
        self._folder = folder

    def persistent_load(self, value: Any) -> Any:
        return replace(value, folder=self._folder)
