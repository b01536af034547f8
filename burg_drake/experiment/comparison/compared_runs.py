"""The runs or trials that are compared, and the settings in which they differ.

Runs whose trials execute or count different phases answer different questions; they are not
compared as two engines.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from burg_drake.core import InvalidInputError, Mode, RealOutcome, count_with_noun
from burg_drake.evaluation import (
    HASH_DIGITS,
    RUN_FILE,
    Campaign,
    Run,
    engine_label,
    load_run,
    open_results,
    read_results,
    read_trial_settings,
    request_differences,
)
from burg_drake.experiment.comparison.result_table import ResultTable, TextFactor
from burg_drake.experiment.trials.trial_sheet import TrialSheet


@dataclass(frozen=True, kw_only=True)
class Side:
    """Description of one side of a comparison.

    Attributes:
        kind: `run`, or `trials` on the robot.
        path: folder of the run, or the trials file.
        label: displayed name, such as `hand, standard`; `reality`.
        scenes: names of the scenes.
        hashes: hashes of the runs.
        station, mode, engine: settings of the judge; several are joined by commas.
        judged_again: number of compared grasps judged again by another engine, by engine.
    """

    kind: Literal["run", "trials"]
    path: str
    label: str
    scenes: tuple[str, ...]
    hashes: tuple[str, ...]
    station: str
    mode: str
    engine: str
    judged_again: Mapping[str, int] = field(default_factory=dict)

    @property
    def engines(self) -> str:
        """Names of the engines of the verdicts, as text."""
        parts = [f"engine {self.engine}"]
        for name, count in self.judged_again.items():
            parts.append(f"{count_with_noun(count, 'grasp')} judged again by {name}")
        return ", ".join(parts)


@dataclass(frozen=True, eq=False)
class ComparedRuns:
    """The runs in a folder, which are compared with others or with trials.

    Attributes:
        opened: a run of one scene, or a campaign of many scenes.
    """

    opened: Run | Campaign

    @classmethod
    def load(cls, path: str | Path | Run | Campaign) -> ComparedRuns:
        """The runs in a folder; see `open_results`."""
        return cls(path if isinstance(path, (Run, Campaign)) else open_results(path))

    @property
    def path(self) -> Path:
        """The folder."""
        return self.opened.path

    @cached_property
    def scenes(self) -> dict[str, str]:
        """Names of the scenes by content hash, as in tables."""
        if isinstance(self.opened, Run):
            scene = self.opened.document.scene
            return {scene.content[:HASH_DIGITS]: scene.name}
        return {e.content[:HASH_DIGITS]: e.name for e in self.opened.document.assigned_scenes}

    @cached_property
    def folders(self) -> dict[str, str]:
        """Folders of the runs by content hash of the scene."""
        if isinstance(self.opened, Run):
            return dict.fromkeys(self.scenes, str(self.path))
        return {content: str(self.opened.folder(name)) for content, name in self.scenes.items()}

    def runs_of(self, contents: Collection[str]) -> list[Run]:
        """Opens the runs of some scenes, given by content hash."""
        if isinstance(self.opened, Run):
            return [self.opened]
        wanted = {content[:HASH_DIGITS] for content in contents}
        folders = [Path(self.folders[content]) for content in self.scenes if content in wanted]
        return [load_run(folder) for folder in folders if (folder / RUN_FILE).exists()]

    def instances_of(self, contents: Collection[str]) -> dict[str, tuple[str, ...]]:
        """Names of the free instances of some scenes, by content hash of the scene."""
        return {run.document.scene.content: run.instances for run in self.runs_of(contents)}

    def table(self, names: Sequence[str]) -> ResultTable:
        """Columns of all judged grasps; `evaluation.results_table` lists their names."""
        if isinstance(self.opened, Campaign):
            return ResultTable.of_rows(self.opened.rows(names), names)
        return ResultTable.of_columns(read_results(self.path, names), names)

    @property
    def grasp_folders_text(self) -> str:
        """Description of the folders from which `evaluate` takes the runs' grasps."""
        if isinstance(self.opened, Run):
            return f"folder {self.path}"
        return f"of each scene folder {self.opened.folder('SCENE')}"

    def described(self) -> Side:
        """Description of these runs as a side of a comparison."""
        document = self.opened.document
        engine = engine_label(document.engine)
        return Side(
            kind="run",
            path=str(self.path),
            label=f"{document.mode}, {engine}",
            scenes=tuple(self.scenes.values()),
            hashes=(document.hash,),
            station=document.station.name,
            mode=document.mode,
            engine=engine,
        )


def add_rejudging_engines(side: Side, judged_again: TextFactor) -> Side:
    """A copy of a side with the engines that have judged its grasps again.

    Args:
        side: description of runs.
        judged_again: (N,) engines of the compared grasps; empty if not judged again.
    """
    counts = np.bincount(judged_again.index, minlength=len(judged_again.names)).tolist()
    named = zip(judged_again.names, counts, strict=True)
    return replace(side, judged_again={name: n for name, n in named if name and n})


def describe_trials(sheet: TrialSheet, path: Path) -> Side:
    """Description of real trials as a side of a comparison."""
    sources = sheet.runs.values()
    return Side(
        kind="trials",
        path=str(path),
        label="reality",
        scenes=tuple(dict.fromkeys(s.scene.name for s in sources)),
        hashes=tuple(s.hash for s in sources),
        station=", ".join(dict.fromkeys(s.station.name for s in sources)),
        mode="robot",
        engine="reality",
    )


def differing_settings(first: ComparedRuns, second: ComparedRuns) -> tuple[str, ...]:
    """Descriptions of the differing settings of the runs in two folders."""
    sides = ("in the first", "in the second")
    return tuple(request_differences(first.opened.document, second.opened.document, sides))


def require_common_scene(first: ComparedRuns, second: ComparedRuns) -> None:
    """Refuses runs of different scenes.

    Raises:
        InvalidInputError: they have no scene in common; the message names them.
    """
    if not set(first.scenes) & set(second.scenes):
        raise InvalidInputError(
            f"{first.path} is of scene {list_scene_names(first.scenes)}, but {second.path} is of"
            f" scene {list_scene_names(second.scenes)}; runs can be compared if they judge the same"
            " grasps in the same scene"
        )


def list_scene_names(scenes: Mapping[str, str]) -> str:
    """Lists names of scenes for messages; of many only the first few."""
    max_names = 3
    names = [f"{name} ({content})" for content, name in scenes.items()]
    more = f" and {len(names) - max_names} more" if len(names) > max_names else ""
    return ", ".join(names[:max_names]) + more


TRIAL_SETTING_UNITS = {
    **dict.fromkeys(("standoff", "retreat", "lift_height", "least_lift"), "m"),
    **dict.fromkeys(("slip_limit", "disturbance", "creep_distance"), "m"),
    **dict.fromkeys(("lift_time", "hold_time", "steady_time", "settled_time"), "s"),
    **dict.fromkeys(("poll", "close_timeout"), "s"),
    **dict.fromkeys(("creep_speed", "settled_speed"), "m/s"),
    "tilt_limit": "degrees",
}
"""Units of settings in messages; other settings have none."""
Value = float | bool | str | tuple[float, ...] | None


def unpredictable_outcomes(mode: Mode, *, approach: bool) -> frozenset[RealOutcome]:
    """Real outcomes that no verdict of a mode can predict. In mode `hand` these are the outcomes of
    an arm and, if the trials leave out the approach, a collision on the approach.

    Args:
        mode: mode of the run.
        approach: whether the trials of the run include the approach.
    """
    if mode != "hand":
        return frozenset()
    of_arm = [outcome for outcome in RealOutcome if outcome.of_arm]
    return frozenset(of_arm if approach else [*of_arm, RealOutcome.HAND_COLLISION_APPROACH])


def outcomes_unpredictable_for_runs(runs: ComparedRuns) -> frozenset[RealOutcome]:
    """Real outcomes that no verdict of these runs can predict."""
    document = runs.opened.document
    settings = read_trial_settings(document.trial, str(runs.path))
    return unpredictable_outcomes(document.mode, approach=settings.approach)


def require_same_phases(first: ComparedRuns, second: ComparedRuns) -> None:
    """Refuses runs whose trials differ in phases, in limits of success or in the station, so that
    differences are not due to the engine.

    Raises:
        InvalidInputError: names all differing settings with both values.
    """
    causes = []
    phases = differing_phases(first, second)
    if phases:
        causes.append(f"with different phases: {'; '.join(phases)}")
    stations = [runs.opened.document.station for runs in (first, second)]
    if stations[0].content != stations[1].content:
        one, other = (f"{s.name} ({s.content[:HASH_DIGITS]})" for s in stations)
        causes.append(f"on different stations: {one} and {other}")
    if causes:
        raise InvalidInputError(
            f"{first.path} and {second.path} were made {'; and '.join(causes)}; evaluate the grasps"
            f" of one ({first.grasp_folders_text}) again as those of the other"
        )


def approach_note(first: ComparedRuns, second: ComparedRuns) -> str:
    """A note if only one of two runs approached, the run of the whole arm; else empty."""
    approached = [_phase_settings(runs)["approach"] for runs in (first, second)]
    if approached[0] == approached[1]:
        return ""
    still, moved = ("second", "first") if approached[0] else ("first", "second")
    return f"the hand alone did not approach in the {still} run; the whole arm did in the {moved}"


def differing_phases(first: ComparedRuns, second: ComparedRuns) -> list[str]:
    """Settings of trials in which the runs of two folders differ, with both values.

    Settings that a run did not record have the defaults of their time. If one run is of the whole
    arm, the approach is left out; see `approach_note`.
    """
    titles = {"lift_height": "lift"}
    one, other = (_phase_settings(runs) for runs in (first, second))
    if "arm" in (first.opened.document.mode, second.opened.document.mode):
        del one["approach"]
    return [
        f"{titles.get(name, name.replace('_', ' '))} {_value_text(name, one[name])}"
        f" and {_value_text(name, other[name])}"
        for name in one
        if not _are_equal(one[name], other[name])
    ]


def _phase_settings(runs: ComparedRuns) -> dict[str, Value]:
    """Resolved settings of a run's trials by name; settings of the motion first."""
    from burg_drake.simulation import NO_GRIP_LIMITS

    settings = read_trial_settings(runs.opened.document.trial, str(runs.path))
    motion = settings.motion
    assert motion is not None  # unrecorded settings have their defaults
    values: dict[str, Value] = {f.name: getattr(motion, f.name) for f in fields(motion)}
    values |= {f.name: getattr(settings, f.name) for f in fields(settings) if f.name != "motion"}
    values["lift_direction"] = tuple(motion.direction_W.tolist())
    if motion.shortest == motion.lift_height:
        values["least_lift"] = None
    if settings.shake is not None:
        shake = settings.shake
        values["shake"] = (
            f"{shake.shake_acceleration:.12g} m/s^2, {shake.turn_acceleration:.12g} rad/s^2,"
            f" {shake.shake_periods} times at {shake.shake_frequency:.12g} Hz"
        )
    values["approach"] = settings.approach or runs.opened.document.mode == "arm"
    unlimited: Mapping[str, float] = NO_GRIP_LIMITS
    return {k: None if k in unlimited and v == unlimited[k] else v for k, v in values.items()}


def _are_equal(one: Value, other: Value) -> bool:
    """Whether values are equal up to rounding of normalized directions."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return all(math.isclose(a, b, abs_tol=1e-12) for a, b in zip(one, other, strict=True))
    return one == other


def _value_text(name: str, value: Value) -> str:
    """Displayed value with enough digits to distinguish different values."""
    if value is None or isinstance(value, str):
        return value or "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return f"[{', '.join(f'{part:.12g}' for part in value)}]"
    unit = TRIAL_SETTING_UNITS.get(name, "")
    number = math.degrees(value) if unit == "degrees" else value
    return f"{number:.12g} {unit}".rstrip()
