"""Columns of tables, and kinds of verdict fields, which define how they are written and read."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Final, Literal

from burg_drake.core.errors import quote_value
from burg_drake.core.outcomes import FirstMode, Mode, Stage, mode_includes

TEXT_UNIT: Final = ""
"""Unit of a column of texts."""
DIMENSIONLESS: Final = "1"
"""Unit of ratios, counts and labels."""


@dataclass(frozen=True)
class Column:
    """Meaning of a column, and how people read its numbers.

    Attributes:
        unit: `TEXT_UNIT`, `DIMENSIONLESS`, or a unit such as m, rad, N, s; `g` is the standard
            gravity of 9.81 m/s2, and `weights` are multiples of the object's weight.
        description: what its values are, in which frame.
        own_unit: unit for display and the factor to it, if not the usual one of `unit`.
        title: name for people in a line or the head of a table; the column's name if empty.
        axis: longer name for the axis of a chart; the title if empty.
        digits: decimals of its numbers in the unit for display.
    """

    unit: str
    description: str
    own_unit: tuple[str, float] | None = None
    title: str = ""
    axis: str = ""
    digits: int = 1

    @property
    def display_unit(self) -> tuple[str, float]:
        """The unit for display, empty if there is none, and the factor to it."""
        usual = {"m": ("mm", 1e3), "rad": ("°", 180 / math.pi), "m2": ("mm²", 1e6)}
        same = (self.unit if self.unit in ("N", "s") else "", 1.0)
        return self.own_unit or usual.get(self.unit, same)


VerdictPart = Literal["decided", "measured", "posture", "cost"]
"""Parts of a row that fields of a verdict lie in, from left to right; other columns stand between
them."""


@dataclass(frozen=True)
class TableShape:
    """Properties of a run that decide which columns its table has.

    Attributes:
        mode: mode of the run.
        instances: names of the scene's free objects.
        joints: number of the arm's joints; 0 without an arm.
        approach: whether the approach of the hand alone is simulated.
    """

    mode: Mode
    instances: Sequence[str] = ()
    joints: int = 0
    approach: bool = False

    def includes(self, first: FirstMode) -> bool:
        """Whether the table has columns whose first mode is `first`."""
        return mode_includes(self.mode, first, approach=self.approach)


@dataclass(frozen=True)
class VerdictField:
    """A field of a verdict, in one column with the field's name: its meaning and how it is written.

    Attributes:
        unit, meaning: unit and meaning of its columns, see `Column`.
        name: name of the field.
        mode: the first mode whose tables have it.
        part: part of a row with its columns.
    """

    unit: str
    meaning: str
    name: str = field(default="", kw_only=True)
    mode: FirstMode = field(default="hand", kw_only=True)
    part: VerdictPart = field(default="measured", kw_only=True)

    @property
    def metadata(self) -> dict[str, Any]:
        """Metadata for the field of a dataclass."""
        return {"kind": self}

    @property
    def is_text(self) -> bool:
        """Whether its cells are texts instead of numbers."""
        return False

    def columns(self, shape: TableShape) -> dict[str, Any]:
        """Names of its columns, each with the key of its cells in the field's values."""
        return {self.name: None}

    def cell(self, value: Any, key: Any) -> Any:
        """The cell of a value in one of its columns; None if empty."""
        return value.get(key)

    def from_row(self, row: Mapping[str, Any]) -> Any:
        """The value from a row; an empty value if the cells are empty."""
        raise NotImplementedError(f"{self.name} cannot be read from rows")

    def to_json(self, value: Any) -> Any:
        """The value for a journal; numbers that are not finite become null."""
        return {key: _finite_or_none(number) for key, number in value.items()}

    def from_json(self, data: Any) -> Any:
        """The value from a journal.

        Raises:
            ValueError, TypeError, AttributeError: it was not written by `to_json`.
        """
        return {key: _number_or_nan(number) for key, number in data.items()}

    def merge(self, values: Sequence[Any]) -> Any:
        """Merges the values of several stages, given in order."""
        return {key: float(number) for value in values for key, number in value.items()}

    def replayed_values(self, value: Any) -> dict[str, float | str]:
        """Values that a replay must reproduce bit for bit, by display name."""
        return {}

    def described_columns(self) -> dict[str, Column]:
        """Its columns by name, with variable parts of the names in capitals."""
        return {self.name: Column(self.unit, self.meaning)}


@dataclass(frozen=True, kw_only=True)
class TextField(VerdictField):
    """A text in a column with the field's name. The last stage's text counts.

    Attributes:
        value_type: `str` for any text, or an enumeration for its members.
        replayed: whether a replay must reproduce the text.
    """

    value_type: type[str] = str
    replayed: bool = True
    part: VerdictPart = "decided"

    @property
    def is_text(self) -> bool:
        return True

    def cell(self, value: Any, key: Any) -> Any:
        return str(value)

    def from_row(self, row: Mapping[str, Any]) -> Any:
        return row.get(self.name, "")

    def to_json(self, value: Any) -> Any:
        return str(value)

    def from_json(self, data: Any) -> Any:
        if not isinstance(data, str):
            raise TypeError(f"{quote_value(data)} is not a text")
        return self.value_type(data)

    def merge(self, values: Sequence[Any]) -> Any:
        return values[-1]

    def replayed_values(self, value: Any) -> dict[str, float | str]:
        return {self.name: str(value)} if self.replayed else {}


@dataclass(frozen=True, kw_only=True)
class NumberField(VerdictField):
    """A number in a column with the field's name; None if missing.

    It follows from other fields, so a replay need not compare it. The number of the last stage that
    has one counts.
    """

    part: VerdictPart = "decided"

    def cell(self, value: Any, key: Any) -> Any:
        return value

    def from_row(self, row: Mapping[str, Any]) -> Any:
        number = float(row.get(self.name, math.nan))
        return number if math.isfinite(number) else None

    def to_json(self, value: Any) -> Any:
        return value

    def from_json(self, data: Any) -> Any:
        return None if data is None else _require_number(data)

    def merge(self, values: Sequence[Any]) -> Any:
        return next((value for value in reversed(values) if value is not None), None)


@dataclass(frozen=True, kw_only=True)
class MarginsField(VerdictField):
    """Numbers by the names of margins, each in its own column.

    A later stage does not remove an earlier measurement.

    Attributes:
        margins: dataclass whose fields are the margins.
    """

    margins: type[Any]

    def columns(self, shape: TableShape) -> dict[str, Any]:
        return {f.name: f.name for f in fields(self.margins) if shape.includes(f.metadata["mode"])}

    def from_row(self, row: Mapping[str, Any]) -> Any:
        return {f.name: row[f.name] for f in fields(self.margins) if f.name in row}

    def merge(self, values: Sequence[Any]) -> Any:
        found: dict[str, float] = {}
        for name, number in ((k, v) for margins in values for k, v in margins.items()):
            if name not in found or not math.isnan(number):
                found[name] = float(number)
        return found

    def replayed_values(self, value: Any) -> dict[str, float | str]:
        return {f.name: value[f.name] for f in fields(self.margins) if f.name in value}

    def described_columns(self) -> dict[str, Column]:
        return {f.name: f.metadata["column"] for f in fields(self.margins)}


@dataclass(frozen=True, kw_only=True)
class InstancesField(VerdictField):
    """Numbers by instance of the scene; a column's name is a prefix and the instance's name."""

    prefix: str

    def columns(self, shape: TableShape) -> dict[str, Any]:
        return {self.prefix + name: name for name in shape.instances}

    def from_row(self, row: Mapping[str, Any]) -> Any:
        cells = {k: float(v) for k, v in row.items() if k.startswith(self.prefix)}
        return {k.removeprefix(self.prefix): v for k, v in cells.items() if math.isfinite(v)}

    def replayed_values(self, value: Any) -> dict[str, float | str]:
        return {self.prefix.replace("_", " ") + name: number for name, number in value.items()}

    def described_columns(self) -> dict[str, Column]:
        return {self.prefix + "NAME": Column(self.unit, self.meaning)}


@dataclass(frozen=True, kw_only=True)
class JointsField(VerdictField):
    """A number for each joint of the arm; a column's name is a prefix and the joint's number, from
    1.

    The first stage that has numbers counts.
    """

    prefix: str
    part: VerdictPart = "posture"

    def columns(self, shape: TableShape) -> dict[str, Any]:
        return {f"{self.prefix}{k + 1}": k for k in range(shape.joints)}

    def cell(self, value: Any, key: Any) -> Any:
        return value[key] if len(value) > key else None

    def to_json(self, value: Any) -> Any:
        return list(value)

    def from_json(self, data: Any) -> Any:
        return tuple(map(_require_number, data))

    def merge(self, values: Sequence[Any]) -> Any:
        return next(filter(None, values), ())

    def described_columns(self) -> dict[str, Column]:
        return {self.prefix + "NUMBER": Column(self.unit, self.meaning)}


@dataclass(frozen=True, kw_only=True)
class StagesField(VerdictField):
    """Times by stage, each in its own column.

    Attributes:
        times: column of each stage, its meaning, and the first mode whose tables have it.
    """

    times: Mapping[Stage, tuple[str, str, Mode]]
    part: VerdictPart = "cost"

    def columns(self, shape: TableShape) -> dict[str, Any]:
        return {n: stage for stage, (n, _, mode) in self.times.items() if shape.includes(mode)}

    def to_json(self, value: Any) -> Any:
        return {stage.value: round(seconds, 6) for stage, seconds in value.items()}

    def from_json(self, data: Any) -> Any:
        return {Stage(stage): _require_number(seconds) for stage, seconds in data.items()}

    def described_columns(self) -> dict[str, Column]:
        return {name: Column(self.unit, says) for name, says, _ in self.times.values()}


def margin_field(
    unit: str,
    meaning: str,
    *,
    mode: FirstMode = "hand",
    stage: Stage = Stage.EXECUTED,
    smaller_is_better: bool = False,
    **display: Any,
) -> Any:
    """A margin: NaN where it was not measured.

    Args:
        unit, meaning, display: see `Column`.
        mode: the first mode in which it is measured.
        stage: the last stage that measures it; `EXECUTED` for a trial's margins.
        smaller_is_better: whether smaller values are better.
    """
    metadata = {
        "column": Column(unit, meaning, **display),
        "mode": mode,
        "stage": stage,
        "smaller_is_better": smaller_is_better,
    }
    return field(default=math.nan, metadata=metadata)


def verdict_fields(record: type[Any]) -> tuple[VerdictField, ...]:
    """The verdict fields of a record, in the order of their declaration."""
    return tuple(
        replace(one.metadata["kind"], name=one.name)
        for one in fields(record)
        if "kind" in one.metadata
    )


def _finite_or_none(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _number_or_nan(value: object) -> float:
    return math.nan if value is None else _require_number(value)


def _require_number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise TypeError(f"{quote_value(value)} is not a number")
    return float(value)
