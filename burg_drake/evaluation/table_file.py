"""Reads and writes results tables as CSV or Parquet files; numbers keep every bit."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import (
    INSTANCE_PREFIXES,
    FileLimits,
    InvalidInputError,
    MarginNames,
    ReadBudget,
    atomic_write,
    atomic_write_all,
    column_metadata,
    csv_metadata,
    describe_column,
    metadata_path,
    open_regular,
    quote_value,
    read_rows,
    require_writable,
    short_message,
    text_array,
)
from burg_drake.evaluation.result_rows import ResultRows
from burg_drake.evaluation.results_table import TEXT_COLUMNS, Columns
from burg_drake.evaluation.table_parts import require_arrow

T = TypeVar("T", int, float)
CSV_ROWS = 2048
"""Rows that are formatted at a time."""
PARQUET_REMEDY = ", or choose csv"

RUN_METADATA_KEY = b"burg_drake.run"
"""Metadata key of Parquet files for the contents of run.yaml as JSON."""


def require_writer(table: str) -> None:
    """Refuses a table format that cannot be written.

    Raises:
        InvalidInputError: there is no such format.
        MissingDependencyError: Parquet without pyarrow.
    """
    if table not in ("csv", "parquet"):
        raise InvalidInputError(f"table format {table!r} does not exist; give csv or parquet")
    if table == "parquet":
        require_arrow("Parquet", PARQUET_REMEDY)


def require_table(path: Path) -> None:
    """Refuses a file to which no table can be written.

    Raises:
        InvalidInputError: the suffix is not that of a format, or the file cannot be written.
        MissingDependencyError: Parquet without pyarrow.
    """
    if path.suffix not in (".csv", ".parquet"):
        raise InvalidInputError(
            f"{path}: the suffix does not say the format of the table; give a file that"
            " ends in .csv or .parquet, such as "
            f"{path.with_suffix('.csv') if path.name else 'table.csv'}"
        )
    require_writer(path.suffix.removeprefix("."))
    require_writable(path)


def write_table(
    path: Path, columns: Columns | ResultRows, metadata: Mapping[str, Any] | None = None
) -> None:
    """Writes a table atomically; the suffix (.csv or .parquet) gives the format.

    The columns of a CSV file are described in a file beside it, see `core.describe_column`.

    Args:
        path: the file.
        columns: equally long arrays by name; rows of a run are written piece by piece.
        metadata: JSON values that are stored in Parquet files; of these, the file beside a CSV file
            only has the shard.

    Raises:
        MissingDependencyError: Parquet without pyarrow.
        InvalidInputError: the file cannot be written.
    """
    # Types of CSV on the Web, by the kind of an array.
    datatypes = {"U": "string", "f": "double", "i": "integer", "u": "integer", "O": "integer"}
    pieces = columns.parts() if isinstance(columns, ResultRows) else iter([columns])
    first = next(pieces)
    pieces = chain([first], pieces)
    if path.suffix == ".parquet":
        atomic_write(path, partial(_write_parquet, pieces, metadata or {}))
    else:
        described = {n: (datatypes[v.dtype.kind], describe_column(n)) for n, v in first.items()}
        shard = (metadata or {}).get("shard")
        note = f"shard {shard}: only these grasps of the run are judged here"
        notes = [{"dc:description": note}] if shard else []
        description = json.dumps(csv_metadata(path.name, described, notes), indent=1) + "\n"
        atomic_write_all({metadata_path(path): description, path: partial(_write_csv, pieces)})


def read_table(path: Path) -> Columns:
    """Reads a file that `write_table` wrote, or some rows of it; numbers keep every bit.

    Additional columns become numbers if all their cells are numbers, else texts.

    Raises:
        InvalidInputError: the file is missing, or not a results table.
        MissingDependencyError: Parquet without pyarrow.
    """
    try:
        if path.suffix == ".parquet":
            arrow = require_arrow("Parquet", PARQUET_REMEDY)
            with open_regular(path) as binary:
                table = _read_bounded(path, arrow.parquet.ParquetFile(binary))
            cells = {name: table.column(name).to_pylist() for name in table.column_names}
        else:
            cells = _csv_cells([row for _, row in read_rows(path)])
        allowance = ReadBudget(path)
        return {name: _typed_column(name, values, allowance) for name, values in cells.items()}
    except OSError as error:
        why = error.strerror or short_message(error)  # pyarrow's own are OSErrors, too
        raise InvalidInputError(f"cannot read {path}: {why}") from error
    except InvalidInputError:
        raise
    except ValueError as error:
        raise InvalidInputError(
            f"{path} is not a results table ({short_message(error)})"
        ) from error


def _read_bounded(path: Path, file: Any) -> Any:
    """Reads a Parquet file within size limits: the table may be a thousand times as large.

    Raises:
        InvalidInputError: the table exceeds the limits.
    """
    arrow = require_arrow("Parquet", PARQUET_REMEDY)
    cells = file.metadata.num_rows * file.metadata.num_columns
    if cells > FileLimits.table.values:
        raise InvalidInputError(f"cannot read {path}: more than {FileLimits.table.values:,} cells")
    batches, size = [], 0
    for batch in file.iter_batches(batch_size=1 << 10):
        size += batch.nbytes
        if size > FileLimits.table.size:
            raise InvalidInputError(f"cannot read {path}: it has cells of more than 1 GiB in all")
        batches.append(batch)
    return arrow.Table.from_batches(batches, file.schema_arrow)


def is_table(path: Path) -> bool:
    """Whether a file is a results table, by its suffix or its first line."""
    if path.suffix == ".parquet":
        return path.is_file()
    try:
        with open_regular(path) as file:
            line = file.readline(1 << 16).decode("utf-8-sig")
        return {"id", "outcome", "X_OG"} <= set(next(csv.reader([line]), []))
    except (InvalidInputError, UnicodeDecodeError, csv.Error):
        return False


def _csv_cells(rows: list[list[str]]) -> dict[str, list[str]]:
    if not rows:
        raise ValueError("it is empty")
    header, *rows = rows
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(header) == 1 and separator in header[0]:
            raise ValueError(f"its cells are separated by {name}; save it with commas")
    for number, row in enumerate(rows, 1):
        if len(row) != len(header):
            raise ValueError(f"row {number} has {len(row)} cells, the header has {len(header)}")
    return {name: [row[k] for row in rows] for k, name in enumerate(header)}


def _write_csv(pieces: Iterable[Columns], stream: BinaryIO) -> None:
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="", write_through=True)
    writer = csv.writer(text, lineterminator="\n")
    for k, columns in enumerate(pieces):
        if k == 0:
            writer.writerow(columns)
        for begin in range(0, len(next(iter(columns.values()), ())), CSV_ROWS):
            part = (values[begin : begin + CSV_ROWS] for values in columns.values())
            writer.writerows(zip(*map(_cells, part), strict=True))
    text.detach()


def _cells(values: NDArray[Any]) -> list[Any]:
    """Values of a column for csv, which writes floats by `repr`, without loss.

    NaN becomes an empty text, infinity `INF` as in XML and CSV on the Web. Columns of integers with
    missing values are object arrays with None, which csv writes as empty cells.
    """
    special = {math.inf: "INF", -math.inf: "-INF"}
    if values.dtype.kind != "f" or np.isfinite(values).all():
        return list(values.tolist())
    return ["" if value != value else special.get(value, value) for value in values.tolist()]


def _write_parquet(
    pieces: Iterator[Columns], metadata: Mapping[str, Any], stream: BinaryIO
) -> None:
    """Writes row groups of a few pieces each."""
    arrow = require_arrow("Parquet", PARQUET_REMEDY)
    writer = None
    while group := [_parquet_table(columns, metadata) for columns in islice(pieces, 4)]:
        table = arrow.concat_tables(group).combine_chunks()
        writer = writer or arrow.parquet.ParquetWriter(stream, table.schema)
        writer.write_table(table)
    if writer is not None:
        writer.close()


def _parquet_table(columns: Columns, metadata: Mapping[str, Any]) -> Any:
    arrow = require_arrow("Parquet", PARQUET_REMEDY)
    kinds = {"U": arrow.string(), "O": arrow.int64()}
    arrays = {
        name: arrow.array(values.tolist(), kinds[values.dtype.kind])
        if values.dtype.kind in kinds
        else arrow.array(values, from_pandas=True)  # NaN becomes null
        for name, values in columns.items()
    }
    table = arrow.table(arrays)
    fields = [field.with_metadata(column_metadata(field.name)) for field in table.schema]
    return table.cast(arrow.schema(fields, {RUN_METADATA_KEY: json.dumps(metadata)}))


def _typed_column(name: str, values: Sequence[Any], allowance: ReadBudget) -> NDArray[Any]:
    texts = ["" if value is None else str(value) for value in values]
    if name in TEXT_COLUMNS:
        return text_array(f"{allowance.path}: {name}", texts, allowance)
    if name == "seed":
        rows = enumerate(texts, 1)
        whole = [_read_cell(int, name, row, text, "a whole number") for row, text in rows]
        return np.array(whole, dtype=np.int64)
    try:
        return np.array(
            [
                math.nan if text == "" else _read_cell(float, name, row, text, "a number, or empty")
                for row, text in enumerate(texts, 1)
            ]
        )
    except ValueError:
        if name in (*MarginNames.all, "friction", "mass") or name.startswith(
            tuple(INSTANCE_PREFIXES.values())
        ):
            raise
        return text_array(f"{allowance.path}: {name}", texts, allowance)


def _read_cell(kind: type[T], name: str, row: int, text: str, expected: str) -> T:
    try:
        return kind(text)
    except ValueError as error:
        raise ValueError(
            f"row {row}: {name} is {quote_value(text)}; it must be {expected}"
        ) from error
