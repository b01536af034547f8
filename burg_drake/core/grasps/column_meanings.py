"""What columns of tables and grasp sets mean, and their units: one declaration for all of them.

Files carry it along: Parquet and HDF5 with each column, CSV in a file beside it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from burg_drake.core.grasps.column import PLAIN, TEXT, Column
from burg_drake.core.grasps.verdict_columns import VERDICT_FIELDS
from burg_drake.core.grasps.verdict_field import (
    InstancesField,
    JointsField,
    MarginsField,
    NumberField,
    StagesField,
    TextField,
    VerdictField,
)

_GRASP = {
    "id": Column(TEXT, "the grasp; in results and reach tables INSTANCE-GRASP"),
    "instance": Column(TEXT, "the object's name in the scene"),
    "object": Column(TEXT, "the object's name in its library"),
    "width": Column("m", "distance of the contacts along the closing direction"),
    "score": Column(
        PLAIN, "quality of the grasp, higher is better; what it measures depends on its source"
    ),
    "x": Column("m", "origin of the grasp frame G in the object frame O"),
    "y": Column("m", "origin of the grasp frame G in the object frame O"),
    "z": Column("m", "origin of the grasp frame G in the object frame O"),
    "qw": Column(PLAIN, "rotation of G in O as a unit quaternion: real part"),
    "qx": Column(PLAIN, "rotation of G in O as a unit quaternion: x"),
    "qy": Column(PLAIN, "rotation of G in O as a unit quaternion: y"),
    "qz": Column(PLAIN, "rotation of G in O as a unit quaternion: z"),
    "X_OG": Column(
        "m",
        "pose of G in O with all digits; in tables the upper three rows of the matrix",
    ),
}


def _meanings(kind: type[VerdictField]) -> dict[str, Column]:
    """Columns of the fields of a verdict that are of a kind."""
    of_kind = (one for one in VERDICT_FIELDS if isinstance(one, kind))
    return {name: meaning for one in of_kind for name, meaning in one.meanings().items()}


_VERDICT = {**_meanings(TextField), **_meanings(NumberField)}

_MARGINS = {
    **_meanings(MarginsField),
    "friction": Column(
        PLAIN,
        "friction coefficient of the target; empty in results of `evaluate`, which takes the"
        " library's",
    ),
    "mass": Column(
        "kg", "mass of the target; empty in results of `evaluate`, which takes the library's"
    ),
    "cpu": Column("s", "CPU time of all stages"),
    **_meanings(StagesField),
}

_ORIGIN = {
    "seed": Column(PLAIN, "seed of the sampling; in robustness tables that of the perturbations"),
    "engine": Column(TEXT, "engine preset; marked if its settings were changed"),
    "run": Column(TEXT, "short hash of everything that determines the results; hash in run.yaml"),
    "scene": Column(TEXT, "path of the scene, or the name of a built-in one"),
    "scene_content": Column(TEXT, "content hash of the scene with its objects"),
    "station": Column(TEXT, "path of the station, or the name of a built-in one"),
    "station_content": Column(TEXT, "content hash of the station with its models"),
    "mode": Column(TEXT, "how each grasp was judged: hand, reach or arm"),
    "engine_settings": Column(TEXT, "settings of the engine as NAME=VALUE, SI units"),
    "trial_settings": Column(TEXT, "settings of the trial's phases as NAME=VALUE, SI units"),
    "versions": Column(TEXT, "versions of software and machine as NAME=VALUE"),
}

_ROBUSTNESS = {
    "friction_min": Column(
        PLAIN,
        (
            "smallest friction coefficient with which the grasp lifts; 0 if it lifts with"
            " all that were tried"
        ),
    ),
    "repeats": Column(PLAIN, "number of perturbed repeats"),
    "lifted": Column(PLAIN, "number of perturbed repeats that lifted"),
    "success": Column(PLAIN, "share of the perturbed repeats that lifted"),
    "success_low": Column(PLAIN, "lower end of Wilson's 95 % interval of that share"),
    "success_high": Column(PLAIN, "upper end of Wilson's 95 % interval of that share"),
    "failed": Column(TEXT, "tests that could not be simulated"),
    "settings": Column(TEXT, "settings of the tests as NAME=VALUE, SI units"),
}

_QUALITY = {
    "force_closure": Column(
        PLAIN, "1 if the line between the contacts lies within both friction cones"
    ),
    "friction_needed": Column(PLAIN, "smallest friction coefficient for force closure"),
    "antipodal_angle": Column("rad", "largest angle between closing direction and inward normal"),
    "slide": Column(
        "m", "distance that the object slides in the hand until it is held; inf if it never is"
    ),
    "epsilon": Column(PLAIN, "radius of the largest ball within the wrench space"),
    "volume": Column(PLAIN, "volume of the wrench space"),
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
    "nearest": Column(TEXT, "the body that the open hand is nearest to or overlaps"),
    "screened": Column(TEXT, "clear, or the collision of the open hand"),
    "collides_with": Column(TEXT, "the body that the open hand collides with"),
}

_FOREIGN = {
    "pregrasp_width": Column("m", "distance between the pads at the pregrasp"),
    "object_in_gripper": Column(PLAIN, "label: 1 if the grasp holds its object, 0 if not"),
    "label": Column(PLAIN, "of VGN and GIGA: 1 if the grasp holds its object, 0 if not"),
    "scene_id": Column(TEXT, "of VGN and GIGA: the scene of a grasp"),
    "height": Column("m", "of GraspNet-1Billion: height of the fingers"),
    "depth": Column("m", "of GraspNet-1Billion: how far the fingers reach beyond the centre"),
    "object_id": Column(PLAIN, "of GraspNet-1Billion: number of the object"),
    "name": Column(TEXT, "of Isaac Sim: the grasp's name in its file"),
}

GROUPS: Mapping[str, Mapping[str, Column]] = {
    "Grasps": _GRASP,
    "Verdicts": _VERDICT,
    "Margins and cost": _MARGINS,
    "Origin of a row": _ORIGIN,
    "Robustness": _ROBUSTNESS,
    "Analytic quality": _QUALITY,
    "From other projects": _FOREIGN,
}
"""All columns with names of their own, by subject."""

FAMILIES: Mapping[str, Column] = {
    **_meanings(InstancesField),
    **_meanings(JointsField),
    "tug_AXIS_g": Column(
        "g",
        "acceleration along an axis of G that the grip withstands; inf if it withstood all"
        " that were tried",
    ),
    "tug_AXIS_N": Column("N", "the same as a force on the centre of mass"),
    "shake_AXIS_g": Column(
        "g", ("amplitude of an oscillation along an axis of G that the grip withstands")
    ),
    "n_OUTCOME": Column(PLAIN, "number of perturbed repeats with this outcome"),
}
"""Columns whose names have a part that differs, written in capitals."""

_ALL = {name: column for group in GROUPS.values() for name, column in group.items()}
_PARTS = {"NAME": ".+", "NUMBER": r"\d+", "AXIS": "[+-]?[xyz]", "OUTCOME": "[a-z_]+"}
_FAMILIES = tuple(
    (re.compile(re.sub("[A-Z]{2,}", lambda part: _PARTS[part[0]], name)), column)
    for name, column in FAMILIES.items()
)
INPUT_PREFIX = "given_"
"""Columns of results that came with the grasps begin with this."""


def describe(name: str) -> Column | None:
    """What a column is; None of one that others have made up."""
    if name in _ALL:
        return _ALL[name]
    for pattern, column in _FAMILIES:
        if pattern.fullmatch(name):
            return column
    if name.startswith(INPUT_PREFIX):
        theirs = describe(name.removeprefix(INPUT_PREFIX)) or Column(TEXT, "not known here")
        return replace(theirs, description=f"came with the grasps: {theirs.description}")
    return None


def column_metadata(name: str) -> dict[str, str]:
    """Unit and description of a column, as Parquet keeps them; nothing of one that others made."""
    column = describe(name)
    return {} if column is None else {"unit": column.unit, "description": column.description}


def shown_unit(name: str) -> tuple[str, float]:
    """The unit in which people read a column, empty if it has none, and the factor to it."""
    column = describe(name)
    return ("", 1.0) if column is None else column.shown


def shown_title(name: str) -> str:
    """What people call a column in a line or the head of a table."""
    column = describe(name)
    return (column and column.title) or name.replace("_", " ")


def shown_axis(name: str) -> str:
    """What people call a column at an axis."""
    column = describe(name)
    return (column and column.axis) or shown_title(name)


def shown_number(name: str, value: float, digits: int | None = None) -> str:
    """A value of a column with its unit for people, such as `12.3 mm` or `2.0°`; `-` if there is
    none.

    Args:
        name: of the column.
        value: in the unit of the column.
        digits: decimals, if not those that the column declares.
    """
    if math.isnan(value):
        return "-"
    column = describe(name) or Column(PLAIN, "")
    unit, factor = column.shown
    number = f"{value * factor:.{column.digits if digits is None else digits}f}"
    return f"{number}{unit}" if unit == "°" else f"{number} {unit}".rstrip()


def shown_figures(values: Mapping[str, float], names: Iterable[str]) -> str:
    """Those of some columns that have a value, as a line for a terminal that may not know the sign
    of degrees, such as `slip 1.2 mm, tilt 2.0 deg`."""
    return ", ".join(
        f"{shown_title(name)} {shown_number(name, values[name]).replace('°', ' deg')}"
        for name in names
        if math.isfinite(values.get(name, math.nan))
    )
