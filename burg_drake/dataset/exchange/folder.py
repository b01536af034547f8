"""The folder of an export: written beside its place, renamed at the end, never somebody else's."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from burg_drake.core import InvalidInputError
from burg_drake.core.files import writable_folder


@contextmanager
def new_folder(folder: str | Path) -> Iterator[Path]:
    """A folder to write into, which takes its place when the block ends without an error.

    Args:
        folder: new or empty.

    Yields:
        The folder beside it.

    Raises:
        InvalidInputError: it is a file, or there is something in it, or its place cannot be written
            to, or the disk is full; then nothing is left of what was written.
    """
    path = Path(os.path.realpath(folder))
    if os.path.lexists(path):
        if not path.is_dir():
            raise InvalidInputError(f"{folder} is a file; give a folder for the export")
        if any(path.iterdir()):
            raise InvalidInputError(f"{folder} is not empty; choose another folder for the export")
    writable_folder(path.parent)
    fresh = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        fresh.mkdir()
        yield fresh
        os.replace(fresh, path)
    except OSError as error:
        raise InvalidInputError(
            f"cannot write {path}: {error.strerror or error}; choose a writable place with room"
        ) from error
    finally:
        shutil.rmtree(fresh, ignore_errors=True)
