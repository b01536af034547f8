"""The file beside a CSV file that says what its columns are, by the W3C's standard Metadata
Vocabulary for Tabular Data (CSV on the Web)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from burg_drake.core.grasps.column import Column

METADATA_SUFFIX = "-metadata.json"
"""Of the file beside a CSV file: where the standard has readers look for it."""


def metadata_path(path: Path) -> Path:
    """The file beside a CSV file."""
    return path.with_name(path.name + METADATA_SUFFIX)


def csv_metadata(
    name: str,
    columns: Mapping[str, tuple[str, Column | None]],
    notes: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """JSON values that describe a CSV file.

    Args:
        name: of the file.
        columns: the standard's datatype and the meaning of each column, by its title. The standard
            restricts the names of columns, so that those of the file are among the titles as they
            are, and their signs encoded in the names.
        notes: JSON values about the whole table.
    """
    described = []
    for title, (datatype, column) in columns.items():
        entry = {
            "name": quote(title, safe="").replace("-", "%2D").replace("~", "%7E"),
            "titles": title,
            "datatype": datatype,
        }
        if column is not None:
            entry["dc:description"] = column.description
            if column.unit:
                entry["schema:unitText"] = column.unit
        described.append(entry)
    return {
        "@context": ["http://www.w3.org/ns/csvw", {"@language": "en"}],
        "url": name,
        "tableSchema": {"columns": described},
        **({"notes": list(notes)} if notes else {}),
    }
