"""HDF5 files of anyone; each dataset can be looked at before its data is read.

An HDF5 file can send its reader elsewhere (soft and external links, external storage, virtual
datasets) and can say less than it unpacks to (unallocated chunks, chunks that inflate to more than
their size, texts that share their bytes). Nothing outside of the file is read here, and no more
memory is taken than `stored_array` allows.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core.errors import InvalidInputError
from burg_drake.core.files.atomic import open_regular
from burg_drake.core.files.stored_array import ReadBudget, StoredArray, text_array

SIGNATURE = b"\x89HDF\r\n\x1a\n"

DEFLATE = 1
CHECKSUM = 4
"""Bytes."""
FILTERS = {(), (1,), (2,), (3,), (1, 3), (2, 1), (2, 3), (2, 1, 3)}
"""Those of datasets that are read, in the order in which they were applied: shuffle (2), deflate
and checksum (3). Others are rare, and unpack to nobody knows how much."""

DEFLATE_RATIO = 1032
"""Bytes that one byte can inflate to at most (zlib.net/zlib_tech.html)."""
HARMLESS = 64 << 20
"""Bytes that a chunk may inflate to without being looked at before."""


class Hdf5File:
    """An open HDF5 file.

    Attributes:
        path: of the file.
    """

    def __init__(self, path: Path, file: Any) -> None:
        self.path = path
        self._file = file
        self._allowance = ReadBudget(path)

    def __contains__(self, key: str) -> bool:
        return self._find(key) is not None

    def names(self, key: str) -> list[str]:
        """What a group holds, in the order of the file.

        Raises:
            InvalidInputError: it is not a group.
        """
        group = self._required(key)
        if not hasattr(group, "items"):
            raise InvalidInputError(f"{self.path}: {key} is a dataset; expected a group")
        return list(group)

    def attribute(self, name: str) -> Any:
        """A single value that the file has as attribute, such as a text.

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
        data = self._required(key)
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
        return self._stored(where, data)

    def _stored(self, where: str, data: Any) -> StoredArray:
        import h5py

        kind, itemsize = data.dtype.kind, data.dtype.itemsize
        text = h5py.check_string_dtype(data.dtype)
        if text is not None:
            kind, itemsize = "U", 5 * (text.length or 0)  # bytes, and four each as a text
        self._allowance.require(where, data.dtype.itemsize * math.prod(data.chunks or ()))

        def load() -> NDArray[Any]:
            if text is not None and text.length is None:
                return self._free_texts(where, data)
            _require_declared_size(where, data)
            values = np.asarray(data[()])
            return values if text is None else np.char.decode(values, "utf-8")

        return StoredArray(
            where,
            data.shape,
            kind,
            "text" if text is not None else str(data.dtype),
            itemsize,
            load,
            self._allowance,
        )

    def _free_texts(self, where: str, data: Any) -> NDArray[np.str_]:
        """Texts of any length, many of which may share the same bytes of the file."""
        texts = data.asstr("utf-8")
        if data.shape == ():
            return np.array(texts[()], dtype=str)
        if len(data.shape) != 1:
            raise InvalidInputError(f"{where} has shape {data.shape}; expected (N,)")
        if data.chunks is None:  # no more at once than would fit if each were as long as the file
            part = max(1, self._allowance.left // (4 * self.path.stat().st_size))
        else:
            part = max(1, len(data))
            self._allowance.require(where, _text_bytes(where, data))
        found: list[str] = []
        for begin in range(0, len(data), part):
            more = texts[begin : begin + part].tolist()
            self._allowance.take(where, sum(map(len, more)))
            found += more
        return text_array(where, found, self._allowance)

    def _required(self, key: str) -> Any:
        found = self._find(key)
        if found is None:
            raise InvalidInputError(f"{self.path}: {key} is missing")
        return found

    def _find(self, key: str) -> Any:
        """A group or dataset of this file; None if there is none."""
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
    """Whether a file begins as HDF5 files do.

    Raises:
        InvalidInputError: it cannot be read.
    """
    with open_regular(path) as stream:
        return stream.read(len(SIGNATURE)) == SIGNATURE


def _chunks(where: str, data: Any, itemsize: int, above: int = 0) -> Iterator[bytes]:
    """What the chunks of a dataset inflate to, those that take more bytes of the file than `above`;
    refuses chunks that inflate to more than their size."""
    filters = _filters(where, data)
    size = itemsize * math.prod(data.chunks)
    offsets: list[tuple[int, ...]] = []
    data.id.chunk_iter(lambda c: offsets.append(c.chunk_offset) if c.size > above else None)
    for offset in offsets:
        skipped, packed = data.id.read_direct_chunk(offset)
        if DEFLATE in filters and not skipped >> filters.index(DEFLATE) & 1:
            packed = zlib.decompressobj().decompress(packed, size + CHECKSUM + 1)
        if len(packed) > size + CHECKSUM:
            raise InvalidInputError(
                f"{where} is damaged: a part of it unpacks to more data than it should hold"
            )
        yield packed


def _require_declared_size(where: str, data: Any) -> None:
    """Refuses a dataset that unpacks to more than its size."""
    if DEFLATE in _filters(where, data):
        for _ in _chunks(where, data, data.dtype.itemsize, above=HARMLESS // DEFLATE_RATIO):
            pass


def _text_bytes(where: str, data: Any) -> int:
    """How long all texts of a chunked dataset are together. Each is stored as its length, 4 bytes,
    and its place in the file (HDF5 File Format Specification, "Variable-length type"); HDF5 does
    not shuffle them."""
    address, _ = data.file.id.get_create_plist().get_sizes()
    item = 4 + address + 4
    total = 0
    for chunk in _chunks(where, data, item):
        table = np.frombuffer(chunk, np.uint8, len(chunk) // item * item).reshape(-1, item)
        total += int(np.ascontiguousarray(table[:, :4]).view("<u4").sum(dtype=np.int64))
    return total


def _filters(where: str, data: Any) -> tuple[int, ...]:
    created = data.id.get_create_plist()
    filters = tuple(created.get_filter(i)[0] for i in range(created.get_nfilters()))
    if filters not in FILTERS:
        raise InvalidInputError(
            f"{where} is compressed with another filter than gzip; save it again with gzip"
        )
    return filters
