"""Units and descriptions of all columns of tables and grasp sets, and the metadata of CSV files.

The metadata file beside a CSV file follows the W3C's Metadata Vocabulary for Tabular Data (CSV on
the Web).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from burg_drake.core.columns import (
    Column,
    InstancesField,
    JointsField,
    MarginsField,
    NumberField,
    StagesField,
    TextField,
    VerdictField,
)
from burg_drake.core.verdict import RecordedFields


def _verdict_columns(kind: type[VerdictField]) -> dict[str, Column]:
    """Columns of a verdict's fields of one kind."""
    matching = (one for one in RecordedFields.verdict if isinstance(one, kind))
    return {name: column for one in matching for name, column in one.described_columns().items()}


COLUMN_GROUPS: Mapping[str, Mapping[str, Column]] = {
    "Grasps": {
        "id": Column("", "the grasp; in results and reach tables INSTANCE-GRASP"),
        "instance": Column("", "the object's name in the scene"),
        "object": Column("", "the object's name in its library"),
        "width": Column("m", "distance of the contacts along the closing direction"),
        "score": Column(
            "1",
            "quality of the grasp, higher is better; what it measures depends on its source",
        ),
        **dict.fromkeys("xyz", Column("m", "origin of the grasp frame G in the object frame O")),
        "qw": Column("1", "rotation of G in O as a unit quaternion: real part"),
        **{f"q{k}": Column("1", f"rotation of G in O as a unit quaternion: {k}") for k in "xyz"},
        "X_OG": Column(
            "m",
            "pose of G in O with all digits; in tables the upper three rows of the matrix",
        ),
    },
    "Verdicts": {**_verdict_columns(TextField), **_verdict_columns(NumberField)},
    "Margins and cost": {
        **_verdict_columns(MarginsField),
        "friction": Column(
            "1",
            "friction coefficient of the target; empty if it is the library's, as it is unless the"
            " grasps have a column `trial_friction`",
        ),
        "mass": Column(
            "kg", "mass of the target; empty in results of `evaluate`, which takes the library's"
        ),
        "cpu": Column("s", "CPU time of all stages"),
        **_verdict_columns(StagesField),
    },
    "Origin of a row": {
        "seed": Column("1", "seed of the sampling; in robustness tables that of the perturbations"),
        "engine": Column("", "engine preset; marked if its settings were changed"),
        "run": Column("", "short hash of everything that determines the results; hash in run.yaml"),
        "scene": Column("", "path of the scene, or the name of a built-in one"),
        "scene_content": Column("", "content hash of the scene with its objects"),
        "station": Column("", "path of the station, or the name of a built-in one"),
        "station_content": Column("", "content hash of the station with its models"),
        "mode": Column("", "how each grasp was judged: hand, reach or arm"),
        "engine_settings": Column("", "settings of the engine as NAME=VALUE, SI units"),
        "trial_settings": Column("", "settings of the trial's phases as NAME=VALUE, SI units"),
        "versions": Column("", "versions of software and machine as NAME=VALUE"),
    },
    "Robustness": {
        "friction_min": Column(
            "1",
            "smallest friction coefficient with which the grasp lifts; 0 if it lifts with all that"
            " were tried",
        ),
        "repeats": Column("1", "number of perturbed repeats"),
        "lifted": Column("1", "number of perturbed repeats that lifted"),
        "success": Column("1", "share of the perturbed repeats that lifted"),
        "success_low": Column("1", "lower end of Wilson's 95 % interval of that share"),
        "success_high": Column("1", "upper end of Wilson's 95 % interval of that share"),
        "failed": Column("", "tests that could not be simulated"),
        "settings": Column("", "settings of the tests as NAME=VALUE, SI units"),
    },
    "Analytic quality": {
        "force_closure": Column(
            "1", "1 if the line between the contacts lies within both friction cones"
        ),
        "friction_needed": Column("1", "smallest friction coefficient for force closure"),
        "antipodal_angle": Column(
            "rad", "largest angle between closing direction and inward normal"
        ),
        "slide": Column(
            "m", "distance that the object slides in the hand until it is held; inf if it never is"
        ),
        "epsilon": Column("1", "radius of the largest ball within the wrench space"),
        "volume": Column("1", "volume of the wrench space"),
        "load_margin": Column(
            "weights",
            "force that the grip withstands in the worst direction; below 1 the object's"
            " weight may turn it in the hand, though it need not drop",
        ),
        "gravity_margin": Column(
            "weights",
            "force that the grip withstands along gravity; below 1 the object begins to turn"
            " in the hand, though it need not drop",
        ),
        "contact_offset": Column(
            "m", "distance of the centre of mass from the line between the contacts"
        ),
        "nearest": Column("", "the body that the open hand is nearest to or overlaps"),
        "screened": Column("", "clear, or the collision of the open hand"),
        "collides_with": Column("", "the body that the open hand collides with"),
    },
    "From other projects": {
        "pregrasp_width": Column("m", "distance between the pads at the pregrasp"),
        "object_in_gripper": Column("1", "label: 1 if the grasp holds its object, 0 if not"),
        "label": Column("1", "of VGN and GIGA: 1 if the grasp holds its object, 0 if not"),
        "scene_id": Column("", "of VGN and GIGA: the scene of a grasp"),
        "height": Column("m", "of GraspNet-1Billion: height of the fingers"),
        "depth": Column("m", "of GraspNet-1Billion: how far the fingers reach beyond the centre"),
        "object_id": Column("1", "of GraspNet-1Billion: number of the object"),
        "name": Column("", "of Isaac Sim: the grasp's name in its file"),
    },
}
"""All columns with fixed names, by subject."""

COLUMN_FAMILIES: Mapping[str, Column] = {
    **_verdict_columns(InstancesField),
    **_verdict_columns(JointsField),
    "tug_AXIS_g": Column(
        "g",
        "acceleration along an axis of G that the grip withstands; inf if it withstood all"
        " that were tried",
    ),
    "tug_AXIS_N": Column("N", "the same as a force on the centre of mass"),
    "shake_AXIS_g": Column(
        "g", "amplitude of an oscillation along an axis of G that the grip withstands"
    ),
    "n_OUTCOME": Column("1", "number of perturbed repeats with this outcome"),
}
"""Columns with a variable part in their name, here in capitals."""

_COLUMNS = {name: column for group in COLUMN_GROUPS.values() for name, column in group.items()}
"""All columns with fixed names."""
_NAME_PARTS = {"NAME": ".+", "NUMBER": r"\d+", "AXIS": "[+-]?[xyz]", "OUTCOME": "[a-z_]+"}
_COLUMN_PATTERNS = {
    re.compile(re.sub("[A-Z]{2,}", lambda part: _NAME_PARTS[part[0]], name)): column
    for name, column in COLUMN_FAMILIES.items()
}
"""Columns by the patterns of their names in `COLUMN_FAMILIES`."""
INPUT_PREFIX = "given_"
"""Prefix of columns of the results that are copied from the grasps."""


def describe_column(name: str) -> Column | None:
    """The declaration of a column; None for a column from other software."""
    if name in _COLUMNS:
        return _COLUMNS[name]
    for pattern, column in _COLUMN_PATTERNS.items():
        if pattern.fullmatch(name):
            return column
    if name.startswith(INPUT_PREFIX):
        theirs = describe_column(name.removeprefix(INPUT_PREFIX)) or Column("", "not known here")
        return replace(theirs, description=f"came with the grasps: {theirs.description}")
    return None


def column_metadata(name: str) -> dict[str, str]:
    """Unit and description of a column for Parquet; empty for a column from other software."""
    column = describe_column(name)
    return {} if column is None else {"unit": column.unit, "description": column.description}


def display_unit(name: str) -> tuple[str, float]:
    """The unit in which a column is displayed, empty if it has none, and the factor to it."""
    column = describe_column(name)
    return ("", 1.0) if column is None else column.display_unit


def column_title(name: str) -> str:
    """Title of a column in a line or a table's head."""
    column = describe_column(name)
    return (column and column.title) or name.replace("_", " ")


def column_axis_label(name: str) -> str:
    """Label of a column at an axis."""
    column = describe_column(name)
    return (column and column.axis) or column_title(name)


def format_column_value(name: str, value: float, digits: int | None = None) -> str:
    """A value of a column in its display unit, such as `12.3 mm` or `2.0°`; `-` if missing.

    Args:
        name: name of the column.
        value: value in the unit of the column.
        digits: decimals; those of the column if None.
    """
    if math.isnan(value):
        return "-"
    column = describe_column(name) or Column("1", "")
    unit, factor = column.display_unit
    number = f"{value * factor:.{column.digits if digits is None else digits}f}"
    return f"{number}{unit}" if unit == "°" else f"{number} {unit}".rstrip()


def format_column_values(values: Mapping[str, float], names: Iterable[str]) -> str:
    """The existing values of columns as a line in ASCII, such as `slip 1.2 mm, tilt 2.0 deg`."""
    return ", ".join(
        f"{column_title(name)} {format_column_value(name, values[name]).replace('°', ' deg')}"
        for name in names
        if math.isfinite(values.get(name, math.nan))
    )


def metadata_path(path: Path) -> Path:
    """Path of the metadata file beside a CSV file."""
    return path.with_name(path.name + "-metadata.json")


def csv_metadata(
    name: str,
    columns: Mapping[str, tuple[str, Column | None]],
    notes: Sequence[Mapping[str, Any]] = (),
) -> dict[str, Any]:
    """JSON values of the metadata file of a CSV file.

    Args:
        name: name of the CSV file.
        columns: the standard's datatype and the meaning of each column, by title. The standard
            restricts column names; so the file's names are the titles, and the names are
            percent-encoded.
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
