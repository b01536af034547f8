"""The results table as a file for other tools, CSV or Parquet; numbers keep every bit."""

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

from burg_drake.core.errors import InvalidInputError, MissingDependencyError
from burg_drake.core.files import atomic_write
from burg_drake.evaluation.judge import MARGINS
from burg_drake.evaluation.table import INTEGER, TEXT, Columns
from burg_drake.evaluation.trial import MOVED, PUSHED

T = TypeVar("T", int, float)

HEAD = 1 << 16
"""Characters that are looked at to recognise a file."""

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


def write_table(path: Path, columns: Columns, metadata: Mapping[str, Any] | None = None) -> None:
    """Writes a table whole or not at all; the suffix (.csv or .parquet) gives the format.

    Args:
        path: the file.
        columns: equally long arrays by name.
        metadata: JSON values that Parquet files carry along; CSV has no place for them.

    Raises:
        MissingDependencyError: Parquet without pyarrow.
        InvalidInputError: the file cannot be written.
    """
    if path.suffix == ".parquet":
        atomic_write(path, _parquet_bytes(columns, metadata or {}))
    else:
        atomic_write(path, _csv_text(columns))


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
            with path.open("rb") as binary:
                table = parquet.read_table(binary)
            cells = {name: table.column(name).to_pylist() for name in table.column_names}
        else:
            with path.open(newline="", encoding="utf-8-sig") as file:
                cells = _csv_cells([row for row in csv.reader(file) if row])
        return {name: _typed(name, values) for name, values in cells.items()}
    except OSError as error:
        raise InvalidInputError(f"cannot read {path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{path} is not a results table (it is not a text file)") from error
    except ValueError as error:
        raise InvalidInputError(f"{path} is not a results table ({error})") from error


def is_table(path: Path) -> bool:
    """Whether a file is a table of results, by its name or its first line."""
    if path.suffix == ".parquet":
        return path.is_file()
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            return {"id", "outcome", "X_OG"} <= set(next(csv.reader([file.readline(HEAD)]), []))
    except (OSError, UnicodeDecodeError, csv.Error):
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

    Whole numbers with gaps are objects, None in the gaps, which csv leaves empty.
    """
    return ["" if value != value else value for value in values.tolist()]


def _parquet_bytes(columns: Columns, metadata: Mapping[str, Any]) -> bytes:
    arrow, parquet = _pyarrow()
    kinds = {"U": arrow.string(), "O": arrow.int64()}
    arrays = {
        name: arrow.array(values.tolist(), kinds[values.dtype.kind])
        if values.dtype.kind in kinds
        else arrow.array(values, from_pandas=True)  # NaN becomes null
        for name, values in columns.items()
    }
    table = arrow.table(arrays).replace_schema_metadata({METADATA_KEY: json.dumps(metadata)})
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


def _typed(name: str, values: Sequence[Any]) -> NDArray[Any]:
    texts = ["" if value is None else str(value) for value in values]
    if name in TEXT:
        return np.array(texts, dtype=np.str_)
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
        if name in (*MARGINS, "friction", "mass") or name.startswith((MOVED, PUSHED)):
            raise
        return np.array(texts, dtype=np.str_)


def _read(kind: type[T], name: str, row: int, text: str, expected: str) -> T:
    try:
        return kind(text)
    except ValueError as error:
        raise ValueError(f"row {row}: {name} is {text!r}; it has to be {expected}") from error
