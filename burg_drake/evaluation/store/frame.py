"""Results as a pandas data frame: texts that repeat are categories, outcomes and stages all those
that there are, in their order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

from burg_drake.core import MissingDependencyError
from burg_drake.core.grasps import VERDICT_FIELDS, TextField
from burg_drake.evaluation.records import TEXT, Columns
from burg_drake.evaluation.store.part_file import PLAIN_TEXT

if TYPE_CHECKING:
    import pandas

    from burg_drake.evaluation.store.stored_rows import StoredRows

MEMBERS: Mapping[str, Sequence[str]] = {
    one.name: [member.value for member in one.of]
    for one in VERDICT_FIELDS
    if isinstance(one, TextField) and issubclass(one.of, StrEnum)
}
"""Texts of columns that have no others."""


def frame_of_columns(columns: Columns, names: Sequence[str] | None = None) -> pandas.DataFrame:
    """A table of results as a data frame.

    Args:
        columns: the table.
        names: of its columns; all if None.

    Raises:
        MissingDependencyError: pandas is not installed.
        KeyError: the table has no such column.
    """
    series: dict[str, Any] = {}
    for name in names or columns:
        values = columns[name]
        if values.dtype.kind == "U" and name not in PLAIN_TEXT:
            texts, codes = np.unique(values, return_inverse=True)
            series[name] = _category(name, codes, texts.tolist())
        else:
            series[name] = values.astype(object) if values.dtype.kind == "U" else values
    return _pandas().DataFrame(series)


def frame_of_rows(rows: StoredRows, scenes: Sequence[str]) -> pandas.DataFrame:
    """The results of many scenes as a data frame, with a column `name` in front: the scene's name
    in the run.

    Args:
        rows: of the run.
        scenes: names of the scenes that `rows.run` counts.

    Raises:
        MissingDependencyError: pandas is not installed.
    """
    pandas = _pandas()
    series: dict[str, Any] = {"name": _category("name", rows.run, list(scenes))}
    for name in rows.table.column_names:
        column = rows.table.column(name)
        if name in TEXT and name not in PLAIN_TEXT:
            codes, texts = rows.codes(name)
            series[name] = _category(name, *_without_null(codes, texts))
        else:
            values = rows.column(name) if name not in TEXT else column.fill_null("").to_pandas()
            series[name] = values
    return pandas.DataFrame(series)


def _without_null(codes: Any, texts: list[str]) -> tuple[Any, list[str]]:
    """Nulls as empty texts."""
    if not (codes < 0).any():
        return codes, texts
    if "" not in texts:
        texts = [*texts, ""]
    return np.where(codes < 0, texts.index(""), codes), texts


def _category(name: str, codes: Any, texts: list[str]) -> Any:
    """Codes as categories: all members of what has members, else those that there are, sorted."""
    pandas = _pandas()
    members = list(MEMBERS.get(name, texts if name == "name" else sorted(texts)))
    place = np.array([members.index(text) for text in texts], dtype=np.int64)
    codes = place[codes] if len(texts) else codes
    return pandas.Categorical.from_codes(codes, categories=members, ordered=name == "stage")


def _pandas() -> Any:
    try:
        import pandas
    except ImportError as error:
        raise MissingDependencyError(
            "a data frame needs pandas; run: pip install 'burg-drake[frame]'"
        ) from error
    return pandas
