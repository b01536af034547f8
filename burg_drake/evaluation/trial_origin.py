"""Origin of trials (scene, station, engine, settings), as each row of a table records it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from burg_drake.core import (
    MODES,
    InvalidInputError,
    Mode,
    Reader,
    declared_fields,
    option_name,
    parse_yaml_node,
    quote_value,
    suggest_names,
)
from burg_drake.station import ENGINES, Engine, GraspMotion, as_engine

if TYPE_CHECKING:
    from burg_drake.simulation import TrialProtocol, TrialSettings

MEASURE_NUMBERS = {"farthest_point": 1.0}
"""Recorded numbers that identify how runs of this release measure displacements."""

SHAKE_NUMBERS = ("shake_acceleration", "turn_acceleration", "shake_frequency", "shake_periods")
"""Recorded numbers of `ShakeSettings`; none of trials that lift."""


LIFT_NUMBERS = (
    *("lift_time", "hold_time", "creep_speed", "creep_distance", "steady_time"),
    *("disturbance", "approach", *MEASURE_NUMBERS),
)
"""Recorded numbers besides those of the motion that have no effect on trials that shake."""


def limit_settings(values: Mapping[str, float]) -> dict[str, Any]:
    """Limits, approach and protocol as fields of `EvaluationSettings`, from recorded numbers.

    A limit that is not recorded, as by releases before there were limits, is no limit.

    Args:
        values: recorded settings of the trial's phases.
    """
    return {
        "tilt_limit_deg": _limit_degrees(values.get("tilt_limit", math.pi)),
        "slip_limit_mm": _limit_millimetres(values.get("slip_limit", math.inf)),
        "approach": bool(values.get("approach", False)),
        "protocol": protocol_of(values),
    }


def protocol_of(values: Mapping[str, float]) -> TrialProtocol:
    """Protocol of trials with recorded settings."""
    return "shake" if set(SHAKE_NUMBERS) <= set(values) else "lift"


def require_lifts(values: Mapping[str, float], where: Path, what: str) -> None:
    """Refuses a run whose objects were shaken, alone in the air.

    Args:
        values: recorded settings of the trials.
        where: folder of the run.
        what: what needs lifts, for the message.

    Raises:
        InvalidInputError: the protocol is not `lift`.
    """
    if protocol_of(values) != "lift":
        raise InvalidInputError(
            f"{where}: its objects were shaken, alone and without gravity, but {what} those that"
            " are lifted off a table; give a run with protocol lift"
        )


def measure_text(values: Mapping[str, float]) -> str:
    """Point whose displacement is measured for other objects, in words."""
    return "of farthest points" if values.get("farthest_point") else "of centres of mass"


def limits_text(values: Mapping[str, float]) -> str:
    """Limits on tilt and slip, in words."""
    asked = limit_settings(values)
    tilt, slip = asked["tilt_limit_deg"], asked["slip_limit_mm"]
    parts = [f"tilt {tilt:.12g} degrees"] if tilt < 180.0 else []
    parts += [f"slip {slip:.12g} mm"] if math.isfinite(slip) else []
    return ", ".join(parts) or "none"


def _limit_degrees(angle: float) -> float:
    """Converts an angle [rad] to degrees, rounded to 12 digits if that restores the same angle."""
    short = float(f"{math.degrees(angle):.12g}")
    return short if math.radians(short) == angle else math.degrees(angle)


def _limit_millimetres(length: float) -> float:
    short = float(f"{1e3 * length:.12g}")
    return short if short / 1000.0 == length else 1e3 * length


DIRECTION_FIELD = "lift_direction"  # Field of `GraspMotion` that is recorded as three numbers.
DIRECTION_NUMBERS = tuple(f"{DIRECTION_FIELD}_{k}" for k in (1, 2, 3))
"""Names of the three recorded numbers of `DIRECTION_FIELD`."""


def join_direction(values: Mapping[str, object]) -> dict[str, object]:
    """Recorded values with the three numbers of the lift direction, if any, joined to a list."""
    if not all(name in values for name in DIRECTION_NUMBERS):
        return dict(values)
    others = {name: value for name, value in values.items() if name not in DIRECTION_NUMBERS}
    return others | {DIRECTION_FIELD: [values[name] for name in DIRECTION_NUMBERS]}


def read_motion(values: Mapping[str, float]) -> GraspMotion:
    """Reads the motion from recorded numbers.

    Values that are not recorded, as by releases without a choice of motion, are the defaults.

    Raises:
        FieldError: a number is not valid.
    """
    known = {field.name for field in fields(GraspMotion)}
    found = {k: v for k, v in join_direction(values).items() if k in known}
    if DIRECTION_FIELD in found:
        found[DIRECTION_FIELD] = tuple(values[name] for name in DIRECTION_NUMBERS)
    return GraspMotion(**found)  # type: ignore[arg-type]


def without_motion(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers without the numbers of the motion."""
    known = {field.name for field in fields(GraspMotion)}.union(DIRECTION_NUMBERS)
    return {name: value for name, value in values.items() if name not in known}


def other_numbers(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers without motion, limits, approach, shaking and measures."""
    known = ("tilt_limit", "slip_limit", "approach", *MEASURE_NUMBERS, *SHAKE_NUMBERS)
    return {name: value for name, value in without_motion(values).items() if name not in known}


def effective_numbers(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers that have an effect on trials of their protocol."""
    if protocol_of(values) == "lift":
        return dict(values)
    return {k: value for k, value in without_motion(values).items() if k not in LIFT_NUMBERS}


def recorded_motion_text(values: Mapping[str, float]) -> str:
    """Describes the motion of trials with recorded settings in words."""
    if protocol_of(values) == "lift":
        return motion_text(read_motion(values))
    periods, frequency = values["shake_periods"], values["shake_frequency"]
    return (
        f"shaken {periods:g} times along the approach, up to"
        f" {values['shake_acceleration']:g} m/s2, and {periods:g} times about the closing axis, up"
        f" to {values['turn_acceleration']:g} rad/s2, at {frequency:g} Hz; the object alone,"
        " without gravity"
    )


def motion_text(motion: GraspMotion) -> str:
    """Describes a motion in words."""
    parts = [f"standoff {_mm(motion.standoff)} mm"]
    if motion.retreat:
        parts.append(f"retreat {_mm(motion.retreat)} mm")
    least = f"{_mm(motion.shortest)} to " if motion.shortest < motion.lift_height else ""
    parts.append(f"lift {least}{_mm(motion.lift_height)} mm")
    x, y, z = motion.lift_direction
    if (x, y) != (0.0, 0.0) or z < 0.0:
        parts[-1] += f" along [{', '.join(map(_twelve_digits, motion.lift_direction))}]"
    return ", ".join(parts)


def motion_options(motion: GraspMotion, usual: GraspMotion) -> list[str]:
    """Command-line options for the values in which a motion differs from a station's usual one."""
    words: list[str] = []
    for name in declared_fields(GraspMotion):
        option = option_name(GraspMotion, name)
        value = getattr(motion, name)
        if value == getattr(usual, name):
            continue
        if name == DIRECTION_FIELD:
            words += [option, *(repr(part) for part in value)]
        else:  # None, which allows only the whole lift, has no option: give the lift height
            words += [option, _millimetres(motion.lift_height if value is None else value)]
    return words


def _millimetres(length: float) -> str:
    """Value in mm of an option for a length [m], rounded if that restores the same length."""
    text = _mm(length)
    return text if float(text) / 1000.0 == length else repr(1000.0 * length)


def _mm(length: float) -> str:
    return _twelve_digits(1e3 * length)


def _twelve_digits(value: float) -> str:
    """A number with 12 digits, which hide rounding errors."""
    return f"{value:.12g}"


T = TypeVar("T")
Choice = TypeVar("Choice", bound=str)

ORIGIN_TEXT = (
    "scene",
    "scene_content",
    "station",
    "station_content",
    "mode",
    "engine_settings",
    "trial_settings",
    "versions",
)
"""Text columns of the origin besides `engine` and `run`."""
CUSTOM_SUFFIX = " (custom)"
"""Suffix of the name of an engine that differs from the preset of that name."""


@dataclass(frozen=True, kw_only=True)
class TrialOrigin:
    """Origin of the trials of a table.

    Attributes:
        scene, station: paths of the documents, or names of built-in ones.
        scene_content, station_content: first digits of their content hashes.
        mode: mode of the run.
        engine: physics engine.
        trial: settings of the trial's phases; see `TrialSettings`.
        versions: versions of the software and the machine.
        seed: seed of the run.
        run: hash of the run.
    """

    scene: str
    scene_content: str
    station: str
    station_content: str
    mode: Mode
    engine: Engine
    trial: Mapping[str, float]
    versions: Mapping[str, str]
    seed: int = 0
    run: str = ""

    def judged_by(self, engine: str) -> TrialOrigin:
        """Origin with the preset that has judged a grasp again; unchanged if the name is empty.

        Raises:
            UnknownNameError: there is no such preset.
        """
        return replace(self, engine=as_engine(engine)) if engine else self

    def settings(self, where: str = "trial settings") -> TrialSettings:
        """Settings of the trial; see `read_trial_settings`."""
        return read_trial_settings(self.trial, where)

    def cells(self) -> dict[str, str]:
        """Texts of the columns `ORIGIN_TEXT`."""
        settings = {name: value for name, value in vars(self.engine).items() if name != "name"}
        return {
            **{name: getattr(self, name) for name in ORIGIN_TEXT[:5]},
            "engine_settings": pairs_text(settings),
            "trial_settings": pairs_text(self.trial),
            "versions": pairs_text(self.versions),
        }


def read_origin(row: Mapping[str, Any], where: str) -> TrialOrigin:
    """Reads the origin from a row of a table.

    Args:
        row: cells by column.
        where: name of the row, for messages.

    Raises:
        InvalidInputError: a cell cannot be read, or has a setting that this release lacks.
    """
    trial = _read_pairs(row["trial_settings"], where)
    origin = TrialOrigin(
        scene=row["scene"],
        scene_content=row["scene_content"],
        station=row["station"],
        station_content=row["station_content"],
        mode=read_choice(row["mode"], MODES, f"{where}: mode"),
        engine=_read_engine(row["engine"], row["engine_settings"], where),
        trial={name: _read_origin_number(name, value, where) for name, value in trial.items()},
        versions=_read_pairs(row["versions"], where),
        seed=row.get("seed", 0),
        run=row.get("run", ""),
    )
    origin.settings(f"{where}, trial_settings")
    return origin


def read_trial_settings(trial: Mapping[str, float], where: str) -> TrialSettings:
    """Settings of trials from their recorded numbers.

    Settings that are not recorded have their defaults, also those of the motion, whatever the
    station's. Limits that are not recorded are none.

    Args:
        trial: recorded numbers, as in the documents of runs.
        where: name of the record, for messages.

    Raises:
        InvalidInputError: a setting is unknown or not valid.
    """
    from burg_drake.simulation import NO_GRIP_LIMITS, ShakeSettings, TrialSettings

    trial = {name: value for name, value in trial.items() if name not in MEASURE_NUMBERS}
    others, values = without_motion(trial), join_direction(trial)
    motion = {name: value for name, value in values.items() if name not in others}
    shaken = {name: others[name] for name in SHAKE_NUMBERS if name in others}
    others = {name: value for name, value in others.items() if name not in shaken}
    settings = _read_typed(_restore_booleans(others, TrialSettings), TrialSettings, where)
    if protocol_of(trial) == "shake":
        shaken["shake_periods"] = round(shaken["shake_periods"])
        settings = replace(settings, shake=_read_typed(shaken, ShakeSettings, where))
    limits = {name: others.get(name, none) for name, none in NO_GRIP_LIMITS.items()}
    tilt, slip = limits["tilt_limit"], limits["slip_limit"]
    hand = _read_typed(motion, GraspMotion, where)
    return replace(settings, motion=hand, tilt_limit=tilt, slip_limit=slip)


def engine_label(engine: Engine) -> str:
    """Name of an engine for tables and reports, with a suffix if it is not a preset."""
    return engine.name if ENGINES.get(engine.name) == engine else engine.name + CUSTOM_SUFFIX


def pairs_text(values: Mapping[str, object]) -> str:
    """Formats `name=value` pairs as one text; floats keep every bit."""
    words = {name: str(value).replace(" ", "_") for name, value in values.items()}
    return " ".join(f"{name}={word}" for name, word in words.items())


def read_choice(text: str, choices: Sequence[Choice], where: str) -> Choice:
    """The choice that equals a text; `where` names the text in messages.

    Raises:
        InvalidInputError: the text is none of the choices.
    """
    for choice in choices:
        if choice == text:
            return choice
    raise InvalidInputError(
        f"{where} {quote_value(text)} is not known to this release;"
        f" {suggest_names(text, [str(choice) for choice in choices])}"
    )


def _read_engine(label: str, settings: str, where: str) -> Engine:
    """Reads the engine of a row; its name and settings must agree, see `engine_label`."""
    name = label.removesuffix(CUSTOM_SUFFIX)
    engine = _read_typed(
        {"name": name, **_read_pairs(settings, where)}, Engine, f"{where}, engine_settings"
    )
    if label == name and name not in ENGINES:
        raise InvalidInputError(
            f"{where}: engine {quote_value(name)} is not a preset of this release"
            f" ({', '.join(ENGINES)});"
            f" one with settings of its own is called {quote_value(name + CUSTOM_SUFFIX)}"
        )
    if label == name and engine != ENGINES[name]:
        raise InvalidInputError(
            f"{where}: engine {name!r} and engine_settings contradict each other: the"
            f" preset of this release has {_changed_settings(ENGINES[name], engine)}; call"
            f" an engine with settings of its own {quote_value(name + CUSTOM_SUFFIX)}"
        )
    return engine


def _changed_settings(preset: Engine, engine: Engine) -> str:
    """Values of a preset in which an engine differs from it, as `name=value` pairs."""
    return pairs_text({k: v for k, v in vars(preset).items() if getattr(engine, k) != v})


def _read_origin_number(name: str, text: str, where: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInputError(
            f"{where}: trial_settings: {name} is {quote_value(text)}; it must be a number"
        ) from error


def _read_pairs(text: str, where: str) -> dict[str, str]:
    pairs = [word.partition("=") for word in text.split()]
    bad = [name for name, equals, _ in pairs if not equals]
    if bad:
        raise InvalidInputError(f"{where}: {quote_value(bad[0])} is not name=value")
    return {name: value for name, _, value in pairs}


def _restore_booleans(values: Mapping[str, float], schema: type[Any]) -> dict[str, object]:
    """Recorded numbers; numbers of boolean fields become `true` or `false`."""
    flags = {field.name for field in fields(schema) if field.type in (bool, "bool")}
    return {k: str(bool(v)).lower() if k in flags else v for k, v in values.items()}


def _yaml_text(value: object) -> str:
    """YAML of a value or of a list of values, as texts."""
    return json.dumps([str(v) for v in value] if isinstance(value, list) else str(value))


class _CellReader(Reader):
    LINES = False


def _read_typed(values: Mapping[str, object], schema: type[T], where: str) -> T:
    """Makes a dataclass from texts or numbers by field, with the checks of a document."""
    known = {field.name for field in fields(schema)}  # type: ignore[arg-type]
    unknown = [name for name in values if name not in known]
    if unknown:
        raise InvalidInputError(
            f"{where}: this release of burg_drake has no setting {unknown[0]!r}; install"
            " the release that made the results"
        )
    text = "\n".join(f"{name}: {_yaml_text(value)}" for name, value in values.items())
    found: T = _CellReader(where).read(parse_yaml_node(text or "{}", where), schema, "")
    return found
