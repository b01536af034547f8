"""The results table as a file for other tools, CSV or Parquet; numbers keep every bit.

Units and meaning of columns go with it: in the metadata of Parquet's fields, and of a CSV file in a
file beside it, by the W3C's standard Metadata Vocabulary for Tabular Data (CSV on the Web).
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from burg_drake.core import InvalidInputError, MissingDependencyError, quoted
from burg_drake.core.files import (
    TABLE,
    ReadBudget,
    atomic_write,
    atomic_write_all,
    open_regular,
    read_rows,
    require_writable,
    short_message,
    text_array,
)
from burg_drake.core.grasps import (
    MARGINS,
    PREFIXES,
    column_metadata,
    csv_metadata,
    describe,
    metadata_path,
)
from burg_drake.evaluation.records.table import INTEGER, TEXT, Columns

T = TypeVar("T", int, float)

BATCH = 1 << 10
"""Rows of a Parquet file that are unpacked at once."""

HEAD = 1 << 16
"""Characters that are looked at to recognise a file."""

DATATYPES = {"U": "string", "f": "double", "i": "integer", "u": "integer", "O": "integer"}
"""Of CSV on the Web, by the kind of an array."""

METADATA_KEY = b"burg_drake.run"
"""Parquet files carry the contents of run.yaml as JSON under this key of their metadata."""


def require_writer(table: str) -> None:
    """Finds out before any work whether a table format can be written.

    Raises:
        InvalidInputError: there is no such format.
        MissingDependencyError: Parquet without pyarrow.
    """
    if table not in ("csv", "parquet"):
        raise InvalidInputError(f"table format {table!r} does not exist; give csv or parquet")
    if table == "parquet":
        _pyarrow()


def require_table(path: Path) -> None:
    """Finds out before any work whether a table can be written to a file.

    Raises:
        InvalidInputError: the suffix tells no format, or the place cannot be written to.
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


def write_table(path: Path, columns: Columns, metadata: Mapping[str, Any] | None = None) -> None:
    """Writes a table whole or not at all; the suffix (.csv or .parquet) gives the format.

    Beside a CSV file what its columns are goes to a file, see `core.grasps.csv_metadata_file`.

    Args:
        path: the file.
        columns: equally long arrays by name.
        metadata: JSON values that Parquet files carry along; of those of a CSV file the shard is
            told in the file beside it.

    Raises:
        MissingDependencyError: Parquet without pyarrow.
        InvalidInputError: the file cannot be written.
    """
    if path.suffix == ".parquet":
        atomic_write(path, _parquet_bytes(columns, metadata or {}))
    else:
        meant = {n: (DATATYPES[v.dtype.kind], describe(n)) for n, v in columns.items()}
        notes = [{"dc:description": note} for note in _notes(metadata or {})]
        description = json.dumps(csv_metadata(path.name, meant, notes), indent=1) + "\n"
        atomic_write_all({metadata_path(path): description, path: _csv_text(columns)})


def _notes(metadata: Mapping[str, Any]) -> list[str]:
    """What a reader of a CSV file has to know of its run."""
    shard = metadata.get("shard")
    return [f"shard {shard}: only these grasps of the run are judged here"] if shard else []


def read_table(path: Path) -> Columns:
    """Reads a file that `write_table` wrote, or rows of one; numbers come back bit for bit.

    Columns that others have added are numbers if all their cells are, else texts.

    Raises:
        InvalidInputError: the file is missing or something else.
        MissingDependencyError: Parquet without pyarrow.
    """
    try:
        if path.suffix == ".parquet":
            _, parquet = _pyarrow()
            with open_regular(path) as binary:
                table = _bounded(path, parquet.ParquetFile(binary))
            cells = {name: table.column(name).to_pylist() for name in table.column_names}
        else:
            cells = _csv_cells([row for _, row in read_rows(path)])
        allowance = ReadBudget(path)
        return {name: _typed(name, values, allowance) for name, values in cells.items()}
    except OSError as error:
        why = error.strerror or short_message(error)  # pyarrow's own are OSErrors, too
        raise InvalidInputError(f"cannot read {path}: {why}") from error
    except InvalidInputError:
        raise
    except ValueError as error:
        raise InvalidInputError(
            f"{path} is not a results table ({short_message(error)})"
        ) from error


def _bounded(path: Path, file: Any) -> Any:
    """The table of a Parquet file, which can be a thousand times as large as the file.

    Raises:
        InvalidInputError: it is beyond the limits of tables.
    """
    arrow, _ = _pyarrow()
    cells = file.metadata.num_rows * file.metadata.num_columns
    if cells > TABLE.values:
        raise InvalidInputError(f"cannot read {path}: more than {TABLE.values:,} cells")
    batches, size = [], 0
    for batch in file.iter_batches(batch_size=BATCH):
        size += batch.nbytes
        if size > TABLE.size:
            raise InvalidInputError(f"cannot read {path}: it has cells of more than 1 GiB in all")
        batches.append(batch)
    return arrow.Table.from_batches(batches, file.schema_arrow)


def is_table(path: Path) -> bool:
    """Whether a file is a table of results, by its name or its first line."""
    if path.suffix == ".parquet":
        return path.is_file()
    try:
        with open_regular(path) as file:
            line = file.readline(HEAD).decode("utf-8-sig")
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


def _csv_text(columns: Columns) -> str:
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(_cells(values) for values in columns.values()), strict=True))
    return stream.getvalue()


def _cells(values: NDArray[Any]) -> list[Any]:
    """Python values of a column, an empty text for NaN; csv writes floats by repr: lossless.

    Infinity is `INF`, as XML and with it CSV on the Web have it. Whole numbers with gaps are
    objects, None in the gaps, which csv leaves empty.
    """
    special = {math.inf: "INF", -math.inf: "-INF"}
    if values.dtype.kind != "f" or np.isfinite(values).all():
        return list(values.tolist())
    return ["" if value != value else special.get(value, value) for value in values.tolist()]


def _parquet_bytes(columns: Columns, metadata: Mapping[str, Any]) -> bytes:
    arrow, parquet = _pyarrow()
    kinds = {"U": arrow.string(), "O": arrow.int64()}
    arrays = {
        name: arrow.array(values.tolist(), kinds[values.dtype.kind])
        if values.dtype.kind in kinds
        else arrow.array(values, from_pandas=True)  # NaN becomes null
        for name, values in columns.items()
    }
    table = arrow.table(arrays)
    fields = [field.with_metadata(column_metadata(field.name)) for field in table.schema]
    table = table.cast(arrow.schema(fields, {METADATA_KEY: json.dumps(metadata)}))
    sink = arrow.BufferOutputStream()
    parquet.write_table(table, sink)
    return bytes(sink.getvalue().to_pybytes())


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingDependencyError(
            "Parquet needs pyarrow; run: pip install 'burg-drake[parquet]', or choose csv"
        ) from error
    return pyarrow, pyarrow.parquet


def _typed(name: str, values: Sequence[Any], allowance: ReadBudget) -> NDArray[Any]:
    texts = ["" if value is None else str(value) for value in values]
    if name in TEXT:
        return text_array(f"{allowance.path}: {name}", texts, allowance)
    if name in INTEGER:
        whole = [_read(int, name, row, text, "a whole number") for row, text in enumerate(texts, 1)]
        return np.array(whole, dtype=np.int64)
    try:
        return np.array(
            [
                math.nan if text == "" else _read(float, name, row, text, "a number, or empty")
                for row, text in enumerate(texts, 1)
            ]
        )
    except ValueError:
        if name in (*MARGINS, "friction", "mass") or name.startswith(tuple(PREFIXES.values())):
            raise
        return text_array(f"{allowance.path}: {name}", texts, allowance)


def _read(kind: type[T], name: str, row: int, text: str, expected: str) -> T:
    try:
        return kind(text)
    except ValueError as error:
        raise ValueError(f"row {row}: {name} is {quoted(text)}; it must be {expected}") from error
