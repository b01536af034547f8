"""Numpy's files, `.npy` and `.npz`; each array can be looked at before its data is read."""

from __future__ import annotations

import io
import math
import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.errors import InvalidInputError, listing
from burg_drake.core.files.atomic import atomic_write, open_regular
from burg_drake.core.files.read_errors import READ_ERRORS, reporting_read_errors, without_warnings
from burg_drake.core.files.stored_array import ArrayShape, ReadBudget, StoredArray

HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
"""Readers by version of the file; version 3.0 is for records, which this project has no use for."""

COMPRESSIONS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""Those that numpy writes."""

KIND = "a .npy file of numbers"


class NpzFile:
    """An open `.npz` file.

    Attributes:
        path: of the file.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path = path
        self._archive = archive
        self._allowance = ReadBudget(path)
        self.names = [
            name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")
        ]

    def array(self, name: str) -> StoredArray:
        """An array by its name.

        Raises:
            InvalidInputError: there is none, or it is damaged, compressed in another way than numpy
                does, or of Python objects.
        """
        if name not in self.names:
            raise InvalidInputError(
                f"{self.path} has no array {name!r}; it has {listing(self.names)}"
            )
        info = self._archive.getinfo(f"{name}.npy")
        where = f"{self.path}: {name}"
        if info.compress_type not in COMPRESSIONS:
            raise InvalidInputError(
                f"{where} is compressed in a way that numpy does not use; save it again with"
                " numpy.savez_compressed"
            )
        with self._archive.open(info) as stream:
            shape, dtype = _header(stream, where, info.file_size)

        def load() -> NDArray[Any]:
            with self._archive.open(info) as stream:
                return np.lib.format.read_array(stream, allow_pickle=False)

        return _stored(where, shape, dtype, load, self._allowance)


@contextmanager
def open_npz(path: Path) -> Iterator[NpzFile]:
    """Opens a `.npz` file."""
    with open_regular(path) as stream, zipfile.ZipFile(stream) as archive:
        yield NpzFile(path, archive)


@contextmanager
def open_npy(path: Path) -> Iterator[StoredArray]:
    """Opens a `.npy` file.

    Raises:
        InvalidInputError: the file cannot be read, is cut off, or holds Python objects.
    """
    with reporting_read_errors(path, KIND), open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        shape, dtype = _header(stream, str(path), size)

        def load() -> NDArray[Any]:
            stream.seek(0)
            return np.lib.format.read_array(stream, allow_pickle=False)

        yield _stored(str(path), shape, dtype, load, ReadBudget(path))


def npy_shape(path: Path) -> ArrayShape | None:
    """Shape of the numbers in a `.npy` file, from its header; None for anything else."""
    try:
        with open_regular(path) as stream, without_warnings():
            shape, _, dtype = HEADERS[np.lib.format.read_magic(stream)](stream)
    except (OSError, InvalidInputError, *READ_ERRORS):
        return None
    return shape if dtype.kind in "fiu" else None


def write_npy(path: Path, values: NDArray[Any]) -> None:
    """Writes a `.npy` file, whole or not at all."""
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=False)
    atomic_write(path, buffer.getvalue())


def _header(stream: IO[bytes], where: str, size: int) -> tuple[ArrayShape, np.dtype[Any]]:
    """Shape and type of an array in a stream of some bytes; refuses what does not fit."""
    shape, _, dtype = HEADERS[np.lib.format.read_magic(stream)](stream)
    if dtype.hasobject:
        raise InvalidInputError(
            f"{where} holds pickled Python objects, which are not read; save plain numbers or texts"
        )
    if any(length < 0 for length in shape):
        raise InvalidInputError(f"{where} has shape {shape}; lengths cannot be negative")
    announced, available = dtype.itemsize * math.prod(shape), size - stream.tell()
    if announced > available:
        raise InvalidInputError(
            f"{where} is damaged or cut off: its array of shape {shape} and type {dtype}"
            f" needs {announced} bytes, but the file has {available}"
        )
    return shape, dtype


def _stored(
    where: str, shape: ArrayShape, dtype: np.dtype[Any], load: Any, allowance: ReadBudget
) -> StoredArray:
    return StoredArray(where, shape, dtype.kind, str(dtype), dtype.itemsize, load, allowance)
