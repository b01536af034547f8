"""A part of a table as a Parquet file, which knows what it is made of and whether it is whole.

Its name ends with a hash of its footer, which has the segments, and each page has a checksum: what
is damaged reads as damaged, and not as another result.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, MissingDependencyError
from burg_drake.core.files import atomic_write, open_regular
from burg_drake.core.grasps import column_metadata
from burg_drake.evaluation.records import TEXT, Columns
from burg_drake.evaluation.store.part_segments import JournalSegment

CANDIDATE = "candidate"
"""Column of a row's place among the candidates of its run."""
PLAIN_TEXT = ("id", "X_OG")
"""Texts that differ from row to row; of the others few differ, and each is kept once."""
SEGMENTS_KEY = b"burg_drake.segments"
NAME = re.compile(r"part-(\d+)-([0-9a-f]{16})\.parquet")
LARGEST_FOOTER = 1 << 26


@dataclass(frozen=True)
class Part:
    """A part on disk.

    Attributes:
        path: the file.
        number: by which they are sorted.
        segments: what its rows are made of, in order.
    """

    path: Path
    number: int
    segments: tuple[JournalSegment, ...]


def require_arrow(what: str) -> Any:
    """The module pyarrow.

    Raises:
        MissingDependencyError: it is not installed; says what needs it.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingDependencyError(
            f"{what} needs pyarrow; run: pip install 'burg-drake[parquet]'"
        ) from error
    return pyarrow


def arrow_table(columns: Columns) -> Any:
    """Columns as an Arrow table; NaN becomes null, and texts that repeat are kept once."""
    arrow = require_arrow("a columnar table")
    return arrow.table({name: _arrow(name, values) for name, values in columns.items()})


def empty_column(name: str, rows: int) -> Any:
    """A column of nulls, of the type that columns of this name have."""
    arrow = require_arrow("a columnar table")
    return arrow.nulls(rows, _type(name, "U" if name in TEXT else "f"))


def write_part(folder: Path, number: int, table: Any, segments: Sequence[JournalSegment]) -> Part:
    """Writes a part, whole or not at all.

    Raises:
        InvalidInputError: the folder cannot be written.
    """
    arrow = require_arrow("a columnar table")
    meant = [field.with_metadata(column_metadata(field.name)) for field in table.schema]
    stored = json.dumps([list(asdict(segment).values()) for segment in segments])
    table = table.cast(arrow.schema(meant, {SEGMENTS_KEY: stored}))
    sink = arrow.BufferOutputStream()
    arrow.parquet.write_table(table, sink, compression="zstd", write_page_checksum=True)
    data = bytes(sink.getvalue())
    path = folder / f"part-{number:06d}-{_footer_hash(data)}.parquet"
    atomic_write(path, data)
    return Part(path, number, tuple(segments))


def open_part(path: Path) -> Part | None:
    """A part, from its footer; None if it is damaged or something else."""
    name = NAME.fullmatch(path.name)
    if name is None:
        return None
    arrow = require_arrow(f"reading {path.parent}")
    try:
        with open_regular(path) as stream:
            stream.seek(0, 2)
            size = stream.tell()
            stream.seek(max(0, size - 8))
            length = int.from_bytes(stream.read(4), "little")
            if length > min(LARGEST_FOOTER, size):
                return None
            stream.seek(size - 8 - length)
            if _hash(stream.read()) != name[2]:
                return None
            file = arrow.parquet.ParquetFile(stream)
            stored = json.loads(file.schema_arrow.metadata[SEGMENTS_KEY])
            segments = tuple(JournalSegment(*values) for values in stored)
            if sum(segment.rows for segment in segments) != file.metadata.num_rows:
                return None
    except (InvalidInputError, OSError, ValueError, KeyError, TypeError):
        return None
    return Part(path, int(name[1]), segments)


def read_part(part: Part, names: Sequence[str]) -> Any | None:
    """Columns of a part, as an Arrow table; None if it is damaged.

    Args:
        part: the part.
        names: of the columns; those that it does not have are nulls.
    """
    arrow = require_arrow(f"reading {part.path}")
    try:
        with open_regular(part.path) as stream:
            file = arrow.parquet.ParquetFile(stream, page_checksum_verification=True)
            there = [name for name in names if name in file.schema_arrow.names]
            table = file.read(columns=there, use_threads=True)
    except (InvalidInputError, OSError, ValueError, arrow.ArrowException):
        return None
    rows = sum(segment.rows for segment in part.segments)
    if table.num_rows != rows:
        return None
    for name in names:
        if name not in there:
            table = table.append_column(name, empty_column(name, rows))
    return table.select(list(names)).replace_schema_metadata()


def column_names(part: Part) -> list[str]:
    """Names of the columns of a part."""
    arrow = require_arrow(f"reading {part.path}")
    with open_regular(part.path) as stream:
        return list(arrow.parquet.read_schema(stream).names)


def as_numpy(name: str, column: Any) -> NDArray[Any]:
    """A column as `table.Columns` have it: nulls are NaN, or empty texts."""
    arrow = require_arrow("a columnar table")
    if name in TEXT or arrow.types.is_dictionary(column.type) or _is_text(column.type):
        if not arrow.types.is_dictionary(column.type):
            if column.type == arrow.null():
                return np.full(len(column), "", dtype=np.str_)
            filled = column.fill_null("").to_numpy()
            return filled.astype(np.str_) if len(filled) else np.empty(0, dtype=np.str_)
        codes, categories = as_codes(column)
        return np.array([*categories, ""], dtype=np.str_)[codes]
    values = column.to_numpy()
    plain: NDArray[Any] = values.astype(np.float64) if values.dtype.kind == "O" else values
    return plain


def as_codes(column: Any) -> tuple[NDArray[np.int64], list[str]]:
    """A column of texts as numbers and the texts that they stand for; null is -1."""
    arrow = require_arrow("a columnar table")
    if not arrow.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    column = column.unify_dictionaries()
    if not column.num_chunks:
        return np.empty(0, dtype=np.int64), []
    codes = [chunk.indices.fill_null(-1).to_numpy() for chunk in column.chunks]
    return np.concatenate(codes).astype(np.int64), column.chunk(0).dictionary.to_pylist()


def _arrow(name: str, values: NDArray[Any]) -> Any:
    arrow = require_arrow("a columnar table")
    if values.dtype.kind == "U":
        if len(values) and values.strides == (0,):  # one text for all rows
            places = np.zeros(len(values), dtype=np.int32)
            return arrow.DictionaryArray.from_arrays(places, arrow.array([str(values[0])]))
        column = arrow.array(values.tolist(), arrow.string())
        return column if name in PLAIN_TEXT else column.dictionary_encode()
    if values.dtype.kind == "O":
        return arrow.array(values.tolist(), arrow.int64())
    return arrow.array(values, from_pandas=True)


def _type(name: str, kind: str) -> Any:
    arrow = require_arrow("a columnar table")
    if kind != "U":
        return arrow.float64()
    return arrow.string() if name in PLAIN_TEXT else arrow.dictionary(arrow.int32(), arrow.string())


def _is_text(kind: Any) -> bool:
    arrow = require_arrow("a columnar table")
    return bool(arrow.types.is_string(kind) or arrow.types.is_large_string(kind))


def _footer_hash(data: bytes) -> str:
    length = int.from_bytes(data[-8:-4], "little")
    return _hash(data[len(data) - 8 - length :])


def _hash(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=8).hexdigest()
