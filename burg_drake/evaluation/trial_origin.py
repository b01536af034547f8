"""Scene, station, engine and settings of trials, as each row of a table records them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
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
    from burg_drake.simulation import TrialSettings

MEASURE_NUMBERS = {"farthest_point": 1.0}
"""Numbers by which a run of this release records how it measures."""


def limit_settings(values: Mapping[str, float]) -> dict[str, Any]:
    """Fields of `EvaluationSettings` that recorded numbers ask for. What is not recorded, as in
    runs of releases before there were limits, is no limit.

    Args:
        values: settings of the trial's phases.
    """
    return {
        "tilt_limit_deg": _limit_degrees(values.get("tilt_limit", math.pi)),
        "slip_limit_mm": _limit_millimetres(values.get("slip_limit", math.inf)),
        "approach": bool(values.get("approach", False)),
    }


def measure_text(values: Mapping[str, float]) -> str:
    """Of what point it is measured how far others were moved, for people."""
    return "of farthest points" if values.get("farthest_point") else "of centres of mass"


def limits_text(values: Mapping[str, float]) -> str:
    """The limits for people."""
    asked = limit_settings(values)
    tilt, slip = asked["tilt_limit_deg"], asked["slip_limit_mm"]
    parts = [f"tilt {tilt:.12g} degrees"] if tilt < 180.0 else []
    parts += [f"slip {slip:.12g} mm"] if math.isfinite(slip) else []
    return ", ".join(parts) or "none"


def _limit_degrees(angle: float) -> float:
    """An angle [rad] in few digits, if they are the same angle."""
    short = float(f"{math.degrees(angle):.12g}")
    return short if math.radians(short) == angle else math.degrees(angle)


def _limit_millimetres(length: float) -> float:
    short = float(f"{1e3 * length:.12g}")
    return short if short / 1000.0 == length else 1e3 * length


DIRECTION_FIELD = "lift_direction"  # Field of `GraspMotion` that is recorded as three numbers.
DIRECTION_NUMBERS = tuple(f"{DIRECTION_FIELD}_{k}" for k in (1, 2, 3))
"""Names of these numbers in a record."""


def join_direction(values: Mapping[str, object]) -> dict[str, object]:
    """Recorded values with the direction as one list, if its three numbers are there."""
    if not all(name in values for name in DIRECTION_NUMBERS):
        return dict(values)
    others = {name: value for name, value in values.items() if name not in DIRECTION_NUMBERS}
    return others | {DIRECTION_FIELD: [values[name] for name in DIRECTION_NUMBERS]}


def read_motion(values: Mapping[str, float]) -> GraspMotion:
    """The motion among recorded numbers. What releases before motions could be chosen did not
    record was as it is by default.

    Raises:
        FieldError: a number cannot be used.
    """
    known = {field.name for field in fields(GraspMotion)}
    found = {k: v for k, v in join_direction(values).items() if k in known}
    if DIRECTION_FIELD in found:
        found[DIRECTION_FIELD] = tuple(values[name] for name in DIRECTION_NUMBERS)
    return GraspMotion(**found)  # type: ignore[arg-type]


def without_motion(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers of other settings."""
    known = {field.name for field in fields(GraspMotion)}.union(DIRECTION_NUMBERS)
    return {name: value for name, value in values.items() if name not in known}


def other_numbers(values: Mapping[str, float]) -> dict[str, float]:
    """Recorded numbers but those of the motion, of limits and of measures."""
    known = ("tilt_limit", "slip_limit", "approach", *MEASURE_NUMBERS)
    return {name: value for name, value in without_motion(values).items() if name not in known}


def motion_text(motion: GraspMotion) -> str:
    """A motion for people."""
    parts = [f"standoff {_mm(motion.standoff)} mm"]
    if motion.retreat:
        parts.append(f"retreat {_mm(motion.retreat)} mm")
    least = f"{_mm(motion.shortest)} to " if motion.shortest < motion.lift_height else ""
    parts.append(f"lift {least}{_mm(motion.lift_height)} mm")
    x, y, z = motion.lift_direction
    if (x, y) != (0.0, 0.0) or z < 0.0:
        parts[-1] += f" along [{', '.join(map(_rounded_key, motion.lift_direction))}]"
    return ", ".join(parts)


def motion_options(motion: GraspMotion, usual: GraspMotion) -> list[str]:
    """Words of a command line that ask for a motion where a station's usual one is another."""
    words: list[str] = []
    for name in declared_fields(GraspMotion):
        option = option_name(GraspMotion, name)
        value = getattr(motion, name)
        if value == getattr(usual, name):
            continue
        if name == DIRECTION_FIELD:
            words += [option, *(repr(part) for part in value)]
        else:  # that nothing less than the whole lift is allowed has no option of its own
            words += [option, _millimetres(motion.lift_height if value is None else value)]
    return words


def _millimetres(length: float) -> str:
    """What the option reads as this length [m], in few digits where there are."""
    text = _mm(length)
    return text if float(text) / 1000.0 == length else repr(1000.0 * length)


def _mm(length: float) -> str:
    return _rounded_key(1e3 * length)


def _rounded_key(value: float) -> str:
    """What tells two values apart, but not the rounding of one."""
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
"""Columns of texts beside `engine` and `run`."""
CUSTOM_SUFFIX = " (custom)"
"""Follows the name of an engine that differs from the preset of this name."""


@dataclass(frozen=True, kw_only=True)
class TrialOrigin:
    """What made the trials of a table.

    Attributes:
        scene, station: where the documents were, or names of built-in ones.
        scene_content, station_content: first digits of their content hashes.
        mode: what was asked about each grasp.
        engine: how time was stepped.
        trial: settings of the trial's phases; see `TrialSettings`.
        versions: of the software and the machine.
        seed: of the run.
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
        """The same with another preset, which has judged a grasp again; itself if it has no name.

        Raises:
            UnknownNameError: no such preset.
        """
        return replace(self, engine=as_engine(engine)) if engine else self

    def settings(self, where: str = "trial settings") -> TrialSettings:
        """The trial's settings; see `read_trial_settings`."""
        return read_trial_settings(self.trial, where)

    def cells(self) -> dict[str, str]:
        """The texts `ORIGIN_TEXT` by column."""
        settings = {name: value for name, value in vars(self.engine).items() if name != "name"}
        return {
            **{name: getattr(self, name) for name in ORIGIN_TEXT[:5]},
            "engine_settings": pairs_text(settings),
            "trial_settings": pairs_text(self.trial),
            "versions": pairs_text(self.versions),
        }


def read_origin(row: Mapping[str, Any], where: str) -> TrialOrigin:
    """The origin that a row of a table tells.

    Args:
        row: cells by column.
        where: names the row in messages.

    Raises:
        InvalidInputError: a cell cannot be read, or tells a setting that this release lacks.
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
    """Settings of trials from their recorded numbers; those that were not recorded have their
    defaults, and so has the motion, whatever the station says. Limits that were not recorded are
    none.

    Args:
        trial: as documents of runs have it.
        where: names them in messages.

    Raises:
        InvalidInputError: one of them is unknown or cannot be used.
    """
    from burg_drake.simulation import NO_GRIP_LIMITS, TrialSettings

    trial = {name: value for name, value in trial.items() if name not in MEASURE_NUMBERS}
    others, values = without_motion(trial), join_direction(trial)
    motion = {name: value for name, value in values.items() if name not in others}
    settings = _read_typed(_restore_booleans(others, TrialSettings), TrialSettings, where)
    limits = {name: others.get(name, none) for name, none in NO_GRIP_LIMITS.items()}
    tilt, slip = limits["tilt_limit"], limits["slip_limit"]
    hand = _read_typed(motion, GraspMotion, where)
    return replace(settings, motion=hand, tilt_limit=tilt, slip_limit=slip)


def engine_label(engine: Engine) -> str:
    """Name of an engine for tables and reports. One that is no preset is marked as custom."""
    return engine.name if ENGINES.get(engine.name) == engine else engine.name + CUSTOM_SUFFIX


def pairs_text(values: Mapping[str, object]) -> str:
    """`name=value` pairs as one text; floats keep every bit."""
    words = {name: str(value).replace(" ", "_") for name, value in values.items()}
    return " ".join(f"{name}={word}" for name, word in words.items())


def read_choice(text: str, choices: Sequence[Choice], where: str) -> Choice:
    """The one of some choices that a text says; `where` names it in messages.

    Raises:
        InvalidInputError: it is none of them.
    """
    for choice in choices:
        if choice == text:
            return choice
    raise InvalidInputError(
        f"{where} {quote_value(text)} is not known to this release;"
        f" {suggest_names(text, [str(choice) for choice in choices])}"
    )


def _read_engine(label: str, settings: str, where: str) -> Engine:
    """The engine of a row, if its name and its settings agree; see `engine_label`."""
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
    """Settings of a preset that an engine does not share."""
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
    """Recorded numbers with those of fields that are true or false as such."""
    of_truth = {field.name for field in fields(schema) if field.type in (bool, "bool")}
    return {k: str(bool(v)).lower() if k in of_truth else v for k, v in values.items()}


def _yaml_text(value: object) -> str:
    """A text, or a list of texts, as the reader takes them."""
    return json.dumps([str(v) for v in value] if isinstance(value, list) else str(value))


class _CellReader(Reader):
    LINES = False


def _read_typed(values: Mapping[str, object], schema: type[T], where: str) -> T:
    """A dataclass from texts or numbers by field, checked as if it came from a document."""
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
