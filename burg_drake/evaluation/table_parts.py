"""Parts of a table as Parquet files, each with the journal segments that it was made from."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    InvalidInputError,
    MissingDependencyError,
    RecordedFields,
    TextField,
    atomic_write,
    column_metadata,
    open_regular,
)
from burg_drake.evaluation.result_rows import ResultRows
from burg_drake.evaluation.results_table import TEXT_COLUMNS, Columns, TextValues

if TYPE_CHECKING:
    import pandas

SEGMENT_TAIL = 4096
"""Bytes at the end of a segment that are always compared."""


@dataclass(frozen=True)
class JournalSegment:
    """A range of bytes of a journal from which rows of a part were made.

    Attributes:
        scene: name of the journal's scene in the run; empty in a run of one scene.
        begin, end: range of bytes of the journal.
        rows: number of rows in the part.
        whole, last: hash of these bytes, and of the last `SEGMENT_TAIL` bytes.
        modified: date of the journal when the part was made [ns]; 0 if the journal went on.
    """

    scene: str
    begin: int
    end: int
    rows: int
    whole: str
    last: str
    modified: int


def segment_of(scene: str, journal: Path, begin: int, end: int, rows: int) -> JournalSegment:
    """Segment for a range of bytes from which rows have just been made."""
    with open_regular(journal) as stream:
        status = os.fstat(stream.fileno())
        modified = status.st_mtime_ns if status.st_size == end else 0
        whole = _stream_hash(stream, begin, end)
        last = _stream_hash(stream, max(begin, end - SEGMENT_TAIL), end)
    return JournalSegment(scene, begin, end, rows, whole, last, modified)


def valid_segments(segments: Sequence[JournalSegment], journal: Path) -> list[JournalSegment]:
    """Consecutive segments from the beginning of a journal that still match its contents."""
    try:
        with open_regular(journal) as stream:
            return _follow_segments(segments, stream)
    except (ValueError, OSError):
        return []


def _follow_segments(segments: Sequence[JournalSegment], stream: BinaryIO) -> list[JournalSegment]:
    status = os.fstat(stream.fileno())
    size, modified = status.st_size, status.st_mtime_ns
    untouched = any(s.end == size and s.modified == modified for s in segments)
    found: list[JournalSegment] = []
    begin = 0
    while True:
        following = [s for s in segments if s.begin == begin and begin < s.end <= size]
        following = [s for s in following if _matches_journal(s, stream, untouched=untouched)]
        if not following:
            return found
        found.append(max(following, key=lambda s: s.end))
        begin = found[-1].end


def _matches_journal(segment: JournalSegment, stream: BinaryIO, *, untouched: bool) -> bool:
    """Whether a journal still has the bytes of a segment; checks only its end if `untouched`."""
    if untouched:
        begin = max(segment.begin, segment.end - SEGMENT_TAIL)
        return _stream_hash(stream, begin, segment.end) == segment.last
    return _stream_hash(stream, segment.begin, segment.end) == segment.whole


def last_line_end(journal: Path) -> int:
    """Byte at which the last complete line of a journal ends; 0 if there is none."""
    if not journal.exists():
        return 0
    with open_regular(journal) as stream:
        end = stream.seek(0, os.SEEK_END)
        while end > 0:
            begin = max(0, end - SEGMENT_TAIL)
            stream.seek(begin)
            found = stream.read(end - begin).rfind(b"\n")
            if found >= 0:
                return begin + found + 1
            end = begin
    return 0


def line_end(journal: Path, byte: int) -> int:
    """End of the journal line that contains a byte."""
    with open_regular(journal) as stream:
        stream.seek(byte)
        return byte + len(stream.readline())


def _stream_hash(stream: BinaryIO, begin: int, end: int) -> str:
    digest = hashlib.blake2b(digest_size=12)
    stream.seek(begin)
    left = end - begin
    while left > 0 and (data := stream.read(min(1 << 20, left))):
        digest.update(data)
        left -= len(data)
    return digest.hexdigest()


CANDIDATE_COLUMN = "candidate"
"""Column with the index of each row's candidate in its run."""
UNIQUE_TEXT_COLUMNS = ("id", "X_OG")
"""Text columns stored as plain strings, as they differ in every row; others as dictionaries."""
SEGMENTS_KEY = b"burg_drake.segments"
PART_NAME_PATTERN = re.compile(r"part-(\d+)-([0-9a-f]{16})\.parquet")


@dataclass(frozen=True)
class TablePart:
    """A part on disk.

    Attributes:
        path: the file.
        number: number of the part, for sorting.
        segments: journal segments that its rows were made from, in order.
    """

    path: Path
    number: int
    segments: tuple[JournalSegment, ...]


def require_arrow(what: str, remedy: str = "") -> Any:
    """Imports pyarrow.

    Args:
        what: feature that needs it, for the message.
        remedy: alternative to installing it, for the message.

    Raises:
        MissingDependencyError: pyarrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingDependencyError(
            f"{what} needs pyarrow; run: pip install 'burg-drake[parquet]'{remedy}"
        ) from error
    return pyarrow


def arrow_table(columns: Columns) -> Any:
    """Converts columns to an Arrow table; NaN becomes null, and repeated texts are stored once."""
    arrow = require_arrow("a columnar table")
    return arrow.table({name: _arrow_column(name, values) for name, values in columns.items()})


def empty_column(name: str, rows: int) -> Any:
    """A column of nulls with the type of columns of this name."""
    arrow = require_arrow("a columnar table")
    text = arrow.string()
    if name not in TEXT_COLUMNS:
        return arrow.nulls(rows, arrow.float64())
    repeated = name not in UNIQUE_TEXT_COLUMNS
    return arrow.nulls(rows, arrow.dictionary(arrow.int32(), text) if repeated else text)


def write_part(
    folder: Path, number: int, table: Any, segments: Sequence[JournalSegment]
) -> TablePart:
    """Writes a part atomically.

    Raises:
        InvalidInputError: the folder cannot be written.
    """
    arrow = require_arrow("a columnar table")
    fields = [field.with_metadata(column_metadata(field.name)) for field in table.schema]
    stored = json.dumps([list(asdict(segment).values()) for segment in segments])
    table = table.cast(arrow.schema(fields, {SEGMENTS_KEY: stored}))
    sink = arrow.BufferOutputStream()
    arrow.parquet.write_table(table, sink, compression="zstd", write_page_checksum=True)
    data = bytes(sink.getvalue())
    path = folder / f"part-{number:06d}-{_footer_hash(data)}.parquet"
    atomic_write(path, data)
    return TablePart(path, number, tuple(segments))


def open_part(path: Path) -> TablePart | None:
    """Reads the footer of a part; None if the file is damaged or not a part."""
    name = PART_NAME_PATTERN.fullmatch(path.name)
    if name is None:
        return None
    arrow = require_arrow(f"reading {path.parent}")
    try:
        with open_regular(path) as stream:
            stream.seek(0, 2)
            size = stream.tell()
            stream.seek(max(0, size - 8))
            length = int.from_bytes(stream.read(4), "little")
            if length > min(1 << 26, size):
                return None
            stream.seek(size - 8 - length)
            if _data_hash(stream.read()) != name[2]:
                return None
            file = arrow.parquet.ParquetFile(stream)
            stored = json.loads(file.schema_arrow.metadata[SEGMENTS_KEY])
            segments = tuple(JournalSegment(*values) for values in stored)
            if sum(segment.rows for segment in segments) != file.metadata.num_rows:
                return None
    except (InvalidInputError, OSError, ValueError, KeyError, TypeError):
        return None
    return TablePart(path, int(name[1]), segments)


def read_part(part: TablePart, names: Sequence[str]) -> Any | None:
    """Reads columns of a part as an Arrow table; None if it is damaged.

    Args:
        part: the part.
        names: names of the columns; missing ones are filled with nulls.
    """
    arrow = require_arrow(f"reading {part.path}")
    try:
        with open_regular(part.path) as stream:
            file = arrow.parquet.ParquetFile(stream, page_checksum_verification=True)
            present = [name for name in names if name in file.schema_arrow.names]
            table = file.read(columns=present, use_threads=True)
    except (InvalidInputError, OSError, ValueError, arrow.ArrowException):
        return None
    rows = sum(segment.rows for segment in part.segments)
    if table.num_rows != rows:
        return None
    return select_columns(table, names).replace_schema_metadata()


def select_columns(table: Any, names: Sequence[str]) -> Any:
    """Selects columns of an Arrow table; missing ones are filled with nulls."""
    for name in names:
        if name not in table.column_names:
            table = table.append_column(name, empty_column(name, table.num_rows))
    return table.select(list(names))


def column_names(part: TablePart) -> list[str]:
    """Names of the columns of a part."""
    arrow = require_arrow(f"reading {part.path}")
    with open_regular(part.path) as stream:
        return list(arrow.parquet.read_schema(stream).names)


def to_numpy(name: str, column: Any) -> NDArray[Any]:
    """Converts an Arrow column to an array; nulls become NaN or empty texts."""
    arrow = require_arrow("a columnar table")
    text_types = (arrow.string(), arrow.large_string())
    if name in TEXT_COLUMNS or arrow.types.is_dictionary(column.type) or column.type in text_types:
        if not arrow.types.is_dictionary(column.type):
            if column.type == arrow.null() or not len(column):
                return np.full(len(column), "", dtype=np.str_)
            return np.asarray(column.fill_null("").to_numpy().astype(np.str_))
        codes, categories = to_codes(column)
        texts: NDArray[Any] = np.array([*categories, ""], dtype=np.str_)[codes]
        return texts
    values = column.to_numpy()
    plain: NDArray[Any] = values.astype(np.float64) if values.dtype.kind == "O" else values
    return plain


def to_codes(column: Any) -> TextValues:
    """Converts an Arrow column of texts to codes and texts; the code of null is -1."""
    arrow = require_arrow("a columnar table")
    if not arrow.types.is_dictionary(column.type):
        column = column.dictionary_encode()
    column = column.unify_dictionaries()
    if not column.num_chunks:
        return TextValues(np.empty(0, dtype=np.int64), [])
    codes = [chunk.indices.fill_null(-1).to_numpy() for chunk in column.chunks]
    texts = column.chunk(0).dictionary.to_pylist()
    return TextValues(np.concatenate(codes).astype(np.int64), texts)


def _arrow_column(name: str, values: NDArray[Any]) -> Any:
    arrow = require_arrow("a columnar table")
    if values.dtype.kind == "U":
        if len(values) and values.strides == (0,):  # one text for all rows
            codes = np.zeros(len(values), dtype=np.int32)
            return arrow.DictionaryArray.from_arrays(codes, arrow.array([str(values[0])]))
        column = arrow.array(values.tolist(), arrow.string())
        return column if name in UNIQUE_TEXT_COLUMNS else column.dictionary_encode()
    if values.dtype.kind == "O":
        return arrow.array(values.tolist(), arrow.int64())
    return arrow.array(values, from_pandas=True)


def _footer_hash(data: bytes) -> str:
    length = int.from_bytes(data[-8:-4], "little")
    return _data_hash(data[len(data) - 8 - length :])


def _data_hash(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=8).hexdigest()


@dataclass(frozen=True, eq=False)
class StoredRows:
    """Judged grasps of several runs, run by run, each in the order of its candidates.

    Attributes:
        table: Arrow table.
        counts: (S,) number of rows of each run.
    """

    table: Any
    counts: NDArray[np.int64]

    def __len__(self) -> int:
        return int(self.counts.sum())

    def column(self, name: str) -> NDArray[Any]:
        """A column as an array."""
        return to_numpy(name, self.table.column(name))

    def codes(self, name: str) -> TextValues:
        """A column of texts as codes and texts."""
        return to_codes(self.table.column(name))

    def columns(self, names: Iterable[str]) -> Columns:
        """Several columns."""
        return {name: self.column(name) for name in names}

    @property
    def run(self) -> NDArray[np.int64]:
        """(N,) index of the run of each row."""
        return np.repeat(np.arange(len(self.counts)), self.counts)


COLUMN_MEMBERS: Mapping[str, Sequence[str]] = {
    one.name: [member.value for member in one.value_type]
    for one in RecordedFields.verdict
    if isinstance(one, TextField) and issubclass(one.value_type, StrEnum)
}
"""Allowed texts of columns with a fixed set of values."""


def results_frame(
    rows: StoredRows | ResultRows,
    names: Sequence[str],
    texts: Collection[str],
    scenes: Sequence[str] | None = None,
) -> pandas.DataFrame:
    """Converts results to a data frame; repeated texts become categories.

    Args:
        rows: rows of a run.
        names: names of the columns.
        texts: names of the text columns.
        scenes: names of the scenes of a run over many, which become a first column `name`.

    Raises:
        MissingDependencyError: pandas is not installed.
        KeyError: the rows have no such column.
    """
    pandas = _pandas()
    series: dict[str, Any] = {}
    if scenes is not None:
        series["name"] = _category_column("name", rows.run, list(scenes))
    for name in names:
        if name in texts and name not in UNIQUE_TEXT_COLUMNS:
            series[name] = _category_column(name, *_fill_null(*rows.codes(name)))
        else:
            values = rows.columns([name])[name]
            series[name] = values.astype(object) if name in texts else values
    return pandas.DataFrame(series)


def _fill_null(codes: Any, texts: Sequence[str]) -> tuple[Any, Sequence[str]]:
    """Replaces the code of null by the code of an empty text."""
    if not (codes < 0).any():
        return codes, texts
    if "" not in texts:
        texts = [*texts, ""]
    return np.where(codes < 0, texts.index(""), codes), texts


def _category_column(name: str, codes: Any, texts: Sequence[str]) -> Any:
    """Categorical of codes; categories are the allowed texts if fixed, else the sorted texts."""
    pandas = _pandas()
    members = list(COLUMN_MEMBERS.get(name, texts if name == "name" else sorted(texts)))
    member_of_text = np.array([members.index(text) for text in texts], dtype=np.int64)
    codes = member_of_text[codes] if len(texts) else codes
    return pandas.Categorical.from_codes(codes, categories=members, ordered=name == "stage")


def _pandas() -> Any:
    try:
        import pandas
    except ImportError as error:
        raise MissingDependencyError(
            "a data frame needs pandas; run: pip install 'burg-drake[frame]'"
        ) from error
    return pandas
