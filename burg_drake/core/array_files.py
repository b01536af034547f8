"""Arrays in NumPy and HDF5 files, whose shape, type and size are checked before their data is read.

An HDF5 file can refer to other files (soft and external links, external storage, virtual datasets)
and can declare less than it unpacks to (unallocated chunks, chunks that inflate beyond their size,
texts that share their bytes). Only the file itself is read here, and memory is limited by
`ReadBudget`.
"""

from __future__ import annotations

import io
import math
import os
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.errors import InvalidInputError, list_names
from burg_drake.core.files import (
    READ_ERRORS,
    atomic_write,
    open_regular,
    report_read_errors,
    suppress_numpy_warnings,
)

ArrayShape = tuple[int, ...]


MAX_ARRAY_BYTES = 3 << 30
"""Memory for the arrays of one file. A million grasps with 100 columns take 1.0 GiB."""

NUMBER_KINDS = "fiub"
"""Kinds of numbers and booleans, as in `numpy.dtype.kind`."""


class ReadBudget:
    """Remaining memory for the arrays of one file.

    Attributes:
        path: path of the file.
        bytes_left: remaining memory.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.bytes_left = MAX_ARRAY_BYTES

    def require(self, where: str, nbytes: int) -> None:
        """Rejects an array that exceeds the remaining memory.

        Raises:
            InvalidInputError: it is too large.
        """
        if nbytes > self.bytes_left:
            raise InvalidInputError(
                f"{where} would take {_size_text(nbytes)} of memory; all arrays of a file"
                f" together may take {_size_text(MAX_ARRAY_BYTES)}"
            )

    def take(self, where: str, nbytes: int) -> None:
        """As `require`, and subtracts the memory from the budget."""
        self.require(where, nbytes)
        self.bytes_left -= nbytes


@dataclass(frozen=True)
class StoredArray:
    """Description of an array in a file, before its data is read.

    Attributes:
        where: file and name, for messages.
        shape: shape of the array.
        kind: `numpy.dtype.kind` of its values when they are read.
        type: its type, for messages.
        itemsize: bytes of memory per value; 0 if unknown before reading.
        load: reads the data.
        budget: memory budget of the file.
    """

    where: str
    shape: ArrayShape
    kind: str
    type: str
    itemsize: int
    load: Callable[[], NDArray[Any]]
    budget: ReadBudget

    def read(self, kinds: str, *shapes: ArrayShape) -> NDArray[Any]:
        """Reads the data, after checking its type and shape.

        Args:
            kinds: allowed kinds, as in `numpy.dtype.kind`.
            shapes: allowed shapes; any if empty.

        Raises:
            InvalidInputError: wrong type or shape, or too much data.
        """
        descriptions = {
            "f": "floating-point numbers",
            "fiu": "numbers",
            NUMBER_KINDS: "numbers or truth values",
            "U": "text",
            NUMBER_KINDS + "U": "numbers, truth values or text",
        }
        if self.kind not in kinds:
            raise InvalidInputError(
                f"{self.where} has values of type {self.type}; expected {descriptions[kinds]}"
            )
        if shapes and self.shape not in shapes:
            expected = " or ".join(map(str, shapes))
            raise InvalidInputError(f"{self.where} has shape {self.shape}; expected {expected}")
        self.budget.take(self.where, self.itemsize * math.prod(self.shape))
        return self.load()

    def require_rows(self, *shape: int) -> int:
        """Number of grasps N of an array that must have shape (N, *shape).

        Raises:
            InvalidInputError: it has another shape, or too many values.
        """
        if len(self.shape) != len(shape) + 1 or self.shape[1:] != shape:
            expected = "".join(f", {size}" for size in shape) or ","
            raise InvalidInputError(f"{self.where} has shape {self.shape}; expected (N{expected})")
        require_grasp_count(self.where, self.shape[0])
        return self.shape[0]


def require_grasp_count(where: str, n: int) -> None:
    """Rejects more grasps than a file may have.

    Raises:
        InvalidInputError: there are too many.
    """
    # The largest known sets have two million grasps for all their objects.
    max_grasps = 5_000_000
    if n > max_grasps:
        raise InvalidInputError(
            f"{where} has {n:,} grasps; a file may have at most {max_grasps:,}; split it"
        )


def text_array(where: str, texts: list[str], budget: ReadBudget) -> NDArray[np.str_]:
    """Converts texts to an array (N,), in which each takes the memory of the longest one.

    Raises:
        InvalidInputError: they take too much memory.
    """
    budget.require(where, 4 * len(texts) * max(map(len, texts), default=0))
    return np.array(texts, dtype=str)


def _size_text(nbytes: int) -> str:
    return f"{nbytes / 2**30:.3g} GiB"


NPY_HEADER_READERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
"""Header readers by file version. Version 3.0 is for records and not supported."""


class NpzFile:
    """An open `.npz` file.

    Attributes:
        path: path of the file."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self.path = path
        self._archive = archive
        self._budget = ReadBudget(path)
        self.names = [
            name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")
        ]

    def array(self, name: str) -> StoredArray:
        """An array by its name.

        Raises:
            InvalidInputError: it is missing, damaged, compressed by another method than numpy's, or
                has Python objects.
        """
        if name not in self.names:
            raise InvalidInputError(
                f"{self.path} has no array {name!r}; it has {list_names(self.names)}"
            )
        info = self._archive.getinfo(f"{name}.npy")
        where = f"{self.path}: {name}"
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise InvalidInputError(
                f"{where} is compressed in a way that numpy does not use; save it again with"
                " numpy.savez_compressed"
            )
        with self._archive.open(info) as stream:
            shape, dtype = _read_header(stream, where, info.file_size)

        def load() -> NDArray[Any]:
            with self._archive.open(info) as stream:
                return np.lib.format.read_array(stream, allow_pickle=False)

        budget = self._budget
        return StoredArray(where, shape, dtype.kind, str(dtype), dtype.itemsize, load, budget)


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
    with report_read_errors(path, "a .npy file of numbers"), open_regular(path) as stream:
        size = os.fstat(stream.fileno()).st_size
        shape, dtype = _read_header(stream, str(path), size)

        def load() -> NDArray[Any]:
            stream.seek(0)
            return np.lib.format.read_array(stream, allow_pickle=False)

        budget = ReadBudget(path)
        yield StoredArray(str(path), shape, dtype.kind, str(dtype), dtype.itemsize, load, budget)


def npy_shape(path: Path) -> ArrayShape | None:
    """Shape of the numbers in a `.npy` file, from its header; None for anything else."""
    try:
        with open_regular(path) as stream, suppress_numpy_warnings():
            shape, _, dtype = NPY_HEADER_READERS[np.lib.format.read_magic(stream)](stream)
    except (OSError, InvalidInputError, *READ_ERRORS):
        return None
    return shape if dtype.kind in "fiu" else None


def write_npy(path: Path, values: NDArray[Any]) -> None:
    """Writes a `.npy` file atomically."""
    buffer = io.BytesIO()
    np.save(buffer, values, allow_pickle=False)
    atomic_write(path, buffer.getvalue())


def _read_header(stream: IO[bytes], where: str, size: int) -> tuple[ArrayShape, np.dtype[Any]]:
    """Reads shape and type of an array from a stream with `size` bytes, and rejects invalid
    ones."""
    shape, _, dtype = NPY_HEADER_READERS[np.lib.format.read_magic(stream)](stream)
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


DEFLATE_FILTER = 1  # HDF5's number of the deflate filter.


class Hdf5File:
    """An open HDF5 file.

    Attributes:
        path: path of the file."""

    def __init__(self, path: Path, file: Any) -> None:
        self.path = path
        self._file = file
        self._budget = ReadBudget(path)

    def __contains__(self, key: str) -> bool:
        return self._find_object(key) is not None

    def names(self, key: str) -> list[str]:
        """Names of a group's members, in the order of the file.

        Raises:
            InvalidInputError: it is not a group.
        """
        group = self._require_object(key)
        if not hasattr(group, "items"):
            raise InvalidInputError(f"{self.path}: {key} is a dataset; expected a group")
        return list(group)

    def attribute(self, name: str) -> Any:
        """The value of a scalar attribute of the file, such as a text.

        Raises:
            InvalidInputError: it has several values.
            KeyError: there is none.
        """
        if self._file.attrs.get_id(name).shape != ():
            raise InvalidInputError(f"{self.path}: attribute {name} must be a single value")
        return self._file.attrs[name]

    def array(self, key: str) -> StoredArray:
        """A dataset.

        Raises:
            InvalidInputError: it is missing or a group, or its data is not in this file.
        """
        data = self._require_object(key)
        where = f"{self.path}: {key}"
        if not hasattr(data, "dtype") or not hasattr(data, "shape"):
            raise InvalidInputError(f"{where} is a group; expected a dataset")
        if data.external or data.is_virtual:
            raise InvalidInputError(
                f"{where} keeps its data in other files, which are not read; store the data"
                " in this file"
            )
        if data.shape is None:
            raise InvalidInputError(f"{where} is empty")
        return self._describe_dataset(where, data)

    def _describe_dataset(self, where: str, data: Any) -> StoredArray:
        import h5py

        kind, itemsize = data.dtype.kind, data.dtype.itemsize
        text = h5py.check_string_dtype(data.dtype)
        if text is not None:
            kind, itemsize = "U", 5 * (text.length or 0)  # bytes in the file, and as UTF-32
        self._budget.require(where, data.dtype.itemsize * math.prod(data.chunks or ()))

        def load() -> NDArray[Any]:
            if text is not None and text.length is None:
                return self._read_variable_texts(where, data)
            _require_declared_size(where, data)
            values = np.asarray(data[()])
            return values if text is None else np.char.decode(values, "utf-8")

        type = "text" if text is not None else str(data.dtype)
        return StoredArray(where, data.shape, kind, type, itemsize, load, self._budget)

    def _read_variable_texts(self, where: str, data: Any) -> NDArray[np.str_]:
        """Texts of any length, many of which may share the same bytes of the file."""
        texts = data.asstr("utf-8")
        if data.shape == ():
            return np.array(texts[()], dtype=str)
        if len(data.shape) != 1:
            raise InvalidInputError(f"{where} has shape {data.shape}; expected (N,)")
        if data.chunks is None:  # chunks that fit even if each text is as long as the file
            part = max(1, self._budget.bytes_left // (4 * self.path.stat().st_size))
        else:
            part = max(1, len(data))
            self._budget.require(where, _total_text_bytes(where, data))
        found: list[str] = []
        for begin in range(0, len(data), part):
            more = texts[begin : begin + part].tolist()
            self._budget.take(where, sum(map(len, more)))
            found += more
        return text_array(where, found, self._budget)

    def _require_object(self, key: str) -> Any:
        found = self._find_object(key)
        if found is None:
            raise InvalidInputError(f"{self.path}: {key} is missing")
        return found

    def _find_object(self, key: str) -> Any:
        """A group or dataset of this file; None if missing."""
        import h5py

        found = self._file
        for name in key.split("/"):
            link = found.get(name, getlink=True) if hasattr(found, "items") else None
            if link is None:
                return None
            if not isinstance(link, h5py.HardLink):
                raise InvalidInputError(
                    f"{self.path}: {key} is a link, and links are not followed; store the"
                    " data itself"
                )
            found = found[name]
        return found


@contextmanager
def open_hdf5(path: Path) -> Iterator[Hdf5File]:
    """Opens an HDF5 file."""
    import h5py

    with open_regular(path), h5py.File(path, "r") as file:
        yield Hdf5File(path, file)


def is_hdf5(path: Path) -> bool:
    """Whether a file has the signature of HDF5 files.

    Raises:
        InvalidInputError: it cannot be read.
    """
    signature = b"\x89HDF\r\n\x1a\n"
    with open_regular(path) as stream:
        return stream.read(len(signature)) == signature


def _inflated_chunks(where: str, data: Any, itemsize: int, above: int = 0) -> Iterator[bytes]:
    """Inflated contents of a dataset's chunks that have more than `above` bytes in the file;
    rejects chunks that inflate to more than their size."""
    checksum_size = 4  # Bytes.
    filters = _filters_of(where, data)
    size = itemsize * math.prod(data.chunks)
    offsets: list[tuple[int, ...]] = []
    data.id.chunk_iter(lambda c: offsets.append(c.chunk_offset) if c.size > above else None)
    for offset in offsets:
        skipped, packed = data.id.read_direct_chunk(offset)
        if DEFLATE_FILTER in filters and not skipped >> filters.index(DEFLATE_FILTER) & 1:
            packed = zlib.decompressobj().decompress(packed, size + checksum_size + 1)
        if len(packed) > size + checksum_size:
            raise InvalidInputError(
                f"{where} is damaged: a part of it unpacks to more data than it should hold"
            )
        yield packed


def _require_declared_size(where: str, data: Any) -> None:
    """Rejects a dataset that inflates to more than its declared size."""
    if DEFLATE_FILTER in _filters_of(where, data):
        # A byte inflates to at most 1032 (zlib.net/zlib_tech.html): up to 64 MiB are not checked.
        for _ in _inflated_chunks(where, data, data.dtype.itemsize, above=(64 << 20) // 1032):
            pass


def _total_text_bytes(where: str, data: Any) -> int:
    """Total length of all texts of a chunked dataset. Each is stored as its length, 4 bytes, and
    its address in the file (HDF5 File Format Specification, "Variable-length type"); HDF5 does not
    shuffle them."""
    address, _ = data.file.id.get_create_plist().get_sizes()
    item = 4 + address + 4
    total = 0
    for chunk in _inflated_chunks(where, data, item):
        table = np.frombuffer(chunk, np.uint8, len(chunk) // item * item).reshape(-1, item)
        total += int(np.ascontiguousarray(table[:, :4]).view("<u4").sum(dtype=np.int64))
    return total


def _filters_of(where: str, data: Any) -> tuple[int, ...]:
    # Sequences of shuffle (2), deflate (1) and checksum (3). Others may unpack to any size.
    supported = {(), (1,), (2,), (3,), (1, 3), (2, 1), (2, 3), (2, 1, 3)}
    created = data.id.get_create_plist()
    filters = tuple(created.get_filter(i)[0] for i in range(created.get_nfilters()))
    if filters not in supported:
        raise InvalidInputError(
            f"{where} is compressed with another filter than gzip; save it again with gzip"
        )
    return filters
