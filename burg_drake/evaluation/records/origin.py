"""What the trials of a table have in common. Every row tells it, so that a row needs nothing else.

Settings and versions are cells of the form `name=value name=value`: they need no quotes in CSV, and
a spreadsheet leaves them alone.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

from burg_drake.core import InvalidInputError, nearest, quoted
from burg_drake.core.documents import Reader, parse_nodes
from burg_drake.core.grasps import MODES, Mode
from burg_drake.evaluation.records.limit_numbers import without_measures
from burg_drake.evaluation.records.motion_numbers import gathered, without_motion
from burg_drake.station.document import ENGINES, Engine, as_engine

if TYPE_CHECKING:
    from burg_drake.simulation.trials import TrialSettings

T = TypeVar("T")

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
CUSTOM = " (custom)"
"""Mark behind the name of an engine that is not the preset of this name."""


@dataclass(frozen=True, kw_only=True)
class TrialOrigin:
    """What made the trials of a table.

    Attributes:
        scene, station: where the documents were, or names of built-in ones.
        scene_content, station_content: first digits of their content hashes.
        mode: what was asked about each grasp.
        engine: how time was stepped.
        trial: settings of the trial's phases; see `simulation.trials.trial_settings.TrialSettings`.
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
            "scene": self.scene,
            "scene_content": self.scene_content,
            "station": self.station,
            "station_content": self.station_content,
            "mode": self.mode,
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
    trial = _pairs(row["trial_settings"], where)
    origin = TrialOrigin(
        scene=row["scene"],
        scene_content=row["scene_content"],
        station=row["station"],
        station_content=row["station_content"],
        mode=_mode(row["mode"], where),
        engine=_engine(row["engine"], row["engine_settings"], where),
        trial={name: _number(name, value, where) for name, value in trial.items()},
        versions=_pairs(row["versions"], where),
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
    from burg_drake.simulation.trials import NO_LIMITS, TrialSettings
    from burg_drake.station.document import GraspMotion

    trial = without_measures(trial)
    others, values = without_motion(trial), gathered(trial)
    motion = {name: value for name, value in values.items() if name not in others}
    settings = _typed(_truths(others, TrialSettings), TrialSettings, where)
    limits = {name: others.get(name, none) for name, none in NO_LIMITS.items()}
    return replace(
        settings,
        motion=_typed(motion, GraspMotion, where),
        tilt_limit=limits["tilt_limit"],
        slip_limit=limits["slip_limit"],
    )


def engine_label(engine: Engine) -> str:
    """Name of an engine for tables and reports. One that is no preset is marked as custom."""
    return engine.name if ENGINES.get(engine.name) == engine else engine.name + CUSTOM


def pairs_text(values: Mapping[str, object]) -> str:
    """`name=value` pairs as one text; floats keep every bit."""
    words = {name: str(value).replace(" ", "_") for name, value in values.items()}
    return " ".join(f"{name}={word}" for name, word in words.items())


def _mode(text: str, where: str) -> Mode:
    for mode in MODES:
        if mode == text:
            return mode
    raise InvalidInputError(
        f"{where}: mode {quoted(text)} is not known to this release; {nearest(text, MODES)}"
    )


def _engine(label: str, settings: str, where: str) -> Engine:
    """The engine of a row, if its name and its settings agree; see `engine_label`."""
    name = label.removesuffix(CUSTOM)
    engine = _typed({"name": name, **_pairs(settings, where)}, Engine, f"{where}, engine_settings")
    if label == name and name not in ENGINES:
        raise InvalidInputError(
            f"{where}: engine {quoted(name)} is not a preset of this release"
            f" ({', '.join(ENGINES)});"
            f" one with settings of its own is called {quoted(name + CUSTOM)}"
        )
    if label == name and engine != ENGINES[name]:
        raise InvalidInputError(
            f"{where}: engine {name!r} and engine_settings contradict each other: the"
            f" preset of this release has {_other_settings(ENGINES[name], engine)}; call"
            f" an engine with settings of its own {quoted(name + CUSTOM)}"
        )
    return engine


def _other_settings(preset: Engine, engine: Engine) -> str:
    """Settings of a preset that an engine does not share."""
    there = vars(engine)
    return pairs_text({k: v for k, v in vars(preset).items() if there[k] != v})


def _number(name: str, text: str, where: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise InvalidInputError(
            f"{where}: trial_settings: {name} is {quoted(text)}; it must be a number"
        ) from error


def _pairs(text: str, where: str) -> dict[str, str]:
    pairs = [word.partition("=") for word in text.split()]
    bad = [name for name, equals, _ in pairs if not equals]
    if bad:
        raise InvalidInputError(f"{where}: {quoted(bad[0])} is not name=value")
    return {name: value for name, _, value in pairs}


def _truths(values: Mapping[str, float], schema: type[Any]) -> dict[str, object]:
    """Recorded numbers with those of fields that are true or false as such."""
    of_truth = {field.name for field in fields(schema) if field.type in (bool, "bool")}
    return {k: str(bool(v)).lower() if k in of_truth else v for k, v in values.items()}


def _yaml(value: object) -> str:
    """A text, or a list of texts, as the reader takes them."""
    return json.dumps([str(v) for v in value] if isinstance(value, list) else str(value))


class _CellReader(Reader):
    LINES = False


def _typed(values: Mapping[str, object], schema: type[T], where: str) -> T:
    """A dataclass from texts or numbers by field, checked as if it came from a document."""
    known = {field.name for field in fields(schema)}  # type: ignore[arg-type]
    unknown = [name for name in values if name not in known]
    if unknown:
        raise InvalidInputError(
            f"{where}: this release of burg_drake has no setting {unknown[0]!r}; install"
            " the release that made the results"
        )
    text = "\n".join(f"{name}: {_yaml(value)}" for name, value in values.items())
    found: T = _CellReader(where).read(parse_nodes(text or "{}", where), schema, "")
    return found
