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

from burg_drake.core import InvalidInputError, Mode, RealOutcome
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
    """One of the things compared.

    Attributes:
        kind: `run`, or `trials` on the robot.
        path: folder of the run, or the trials file.
        label: for people, such as `hand, standard`; `reality`.
        scenes: names of the scenes.
        hashes: of the runs.
        station, mode, engine: how it was judged; several are joined by commas.
        judged_again: how many of the compared grasps another engine has judged again, by the name
            of that engine.
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
        """Whose verdicts they are, in words."""
        parts = [f"engine {self.engine}"]
        for name, count in self.judged_again.items():
            parts.append(f"{count:,} grasp{'' if count == 1 else 's'} judged again by {name}")
        return ", ".join(parts)


@dataclass(frozen=True, eq=False)
class JudgedRuns:
    """The runs in a folder.

    Attributes:
        found: a run of one scene or of many.
    """

    found: Run | Campaign

    @classmethod
    def load(cls, path: str | Path | Run | Campaign) -> JudgedRuns:
        """The runs in a folder; see `open_results`."""
        return cls(path if isinstance(path, (Run, Campaign)) else open_results(path))

    @property
    def path(self) -> Path:
        """The folder."""
        return self.found.path

    @cached_property
    def scenes(self) -> dict[str, str]:
        """Names of the scenes by content, as tables have it."""
        if isinstance(self.found, Run):
            scene = self.found.document.scene
            return {scene.content[:HASH_DIGITS]: scene.name}
        return {e.content[:HASH_DIGITS]: e.name for e in self.found.document.mine}

    @cached_property
    def folders(self) -> dict[str, str]:
        """Folders of the runs by content of the scene."""
        if isinstance(self.found, Run):
            return dict.fromkeys(self.scenes, str(self.path))
        return {content: str(self.found.folder(name)) for content, name in self.scenes.items()}

    def runs_of(self, contents: Collection[str]) -> list[Run]:
        """The runs of some scenes by their content, in full; only these are opened."""
        if isinstance(self.found, Run):
            return [self.found]
        wanted = {content[:HASH_DIGITS] for content in contents}
        folders = [Path(self.folders[content]) for content in self.scenes if content in wanted]
        return [load_run(folder) for folder in folders if (folder / RUN_FILE).exists()]

    def instances_of(self, contents: Collection[str]) -> dict[str, tuple[str, ...]]:
        """Names of the free instances of some scenes by their content."""
        return {run.document.scene.content: run.instances for run in self.runs_of(contents)}

    def table(self, names: Sequence[str]) -> ResultTable:
        """Columns of all judged grasps; `evaluation.results_table` says which there are."""
        if isinstance(self.found, Campaign):
            return ResultTable.of_rows(self.found.rows(names), names)
        return ResultTable.of_columns(read_results(self.path, names), names)

    @property
    def grasps_place(self) -> str:
        """The folder that `evaluate` takes their grasps from, in words; of many scenes one each."""
        if isinstance(self.found, Run):
            return f"folder {self.path}"
        return f"of each scene folder {self.found.folder('SCENE')}"

    @property
    def side(self) -> Side:
        """What it is, for people."""
        document = self.found.document
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
    """A side with the engines that have judged its grasps again.

    Args:
        side: a run.
        judged_again: (N,) of the compared grasps; empty texts where none has.
    """
    counts = np.bincount(judged_again.index, minlength=len(judged_again.names)).tolist()
    named = zip(judged_again.names, counts, strict=True)
    return replace(side, judged_again={name: n for name, n in named if name and n})


def side_of_trials(sheet: TrialSheet, path: Path) -> Side:
    """Real trials, for people."""
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


def differing_settings(first: JudgedRuns, second: JudgedRuns) -> tuple[str, ...]:
    """In what the runs of two folders differ, in words."""
    sides = ("in the first", "in the second")
    return tuple(request_differences(first.found.document, second.found.document, sides))


def require_common_scene(first: JudgedRuns, second: JudgedRuns) -> None:
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
    """Names of scenes by content, for messages; of many the first few."""
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
Value = float | bool | tuple[float, ...] | None


def unpredictable_outcomes(mode: Mode, *, approach: bool) -> frozenset[RealOutcome]:
    """Real outcomes that no verdict of a mode can predict: of the hand alone those of an arm, and
    a collision on the approach that its trials leave out.

    Args:
        mode: of the run.
        approach: whether its trials approach.
    """
    if mode != "hand":
        return frozenset()
    of_arm = [outcome for outcome in RealOutcome if outcome.of_arm]
    return frozenset(of_arm if approach else [*of_arm, RealOutcome.HAND_COLLISION_APPROACH])


def unpredictable_for(judged: JudgedRuns) -> frozenset[RealOutcome]:
    """Real outcomes that no verdict of some runs can predict."""
    document = judged.found.document
    settings = read_trial_settings(document.trial, str(judged.path))
    return unpredictable_outcomes(document.mode, approach=settings.approach)


def require_same_phases(first: JudgedRuns, second: JudgedRuns) -> None:
    """Refuses runs whose verdicts answer different questions, so that no engine is to blame where
    they differ: other phases of a trial, other limits of what counts, another station.

    Raises:
        InvalidInputError: names all that differs, with both values.
    """
    causes = []
    phases = differing_phases(first, second)
    if phases:
        causes.append(f"with different phases: {'; '.join(phases)}")
    stations = [judged.found.document.station for judged in (first, second)]
    if stations[0].content != stations[1].content:
        one, other = (f"{s.name} ({s.content[:HASH_DIGITS]})" for s in stations)
        causes.append(f"on different stations: {one} and {other}")
    if causes:
        raise InvalidInputError(
            f"{first.path} and {second.path} were made {'; and '.join(causes)}; evaluate the grasps"
            f" of one ({first.grasps_place}) again as those of the other"
        )


def approach_note(first: JudgedRuns, second: JudgedRuns) -> str:
    """A note if only one of the runs, of the whole arm, has approached; else empty."""
    approached = [_phase_settings(judged)["approach"] for judged in (first, second)]
    if approached[0] == approached[1]:
        return ""
    still, moved = ("second", "first") if approached[0] else ("first", "second")
    return f"the hand alone did not approach in the {still} run; the whole arm did in the {moved}"


def differing_phases(first: JudgedRuns, second: JudgedRuns) -> list[str]:
    """Settings of trials in which the runs of two folders differ, with both values.

    Settings that a run did not record have the defaults of their time. That the hand alone does not
    approach, and the whole arm does, is not listed; see `approach_note`.
    """
    titles = {"lift_height": "lift"}
    one, other = (_phase_settings(judged) for judged in (first, second))
    if "arm" in (first.found.document.mode, second.found.document.mode):
        del one["approach"]
    return [
        f"{titles.get(name, name.replace('_', ' '))} {_value_text(name, one[name])}"
        f" and {_value_text(name, other[name])}"
        for name in one
        if not _are_equal(one[name], other[name])
    ]


def _phase_settings(judged: JudgedRuns) -> dict[str, Value]:
    """All settings of a run's trials by name; those of the motion first, each as what it comes
    to."""
    from burg_drake.simulation import NO_GRIP_LIMITS

    settings = read_trial_settings(judged.found.document.trial, str(judged.path))
    motion = settings.motion
    assert motion is not None  # what was not recorded is the default
    values: dict[str, Value] = {f.name: getattr(motion, f.name) for f in fields(motion)}
    values |= {f.name: getattr(settings, f.name) for f in fields(settings) if f.name != "motion"}
    values["lift_direction"] = tuple(motion.direction_W.tolist())
    if motion.shortest == motion.lift_height:
        values["least_lift"] = None
    unlimited: Mapping[str, float] = NO_GRIP_LIMITS
    values["approach"] = settings.approach or judged.found.document.mode == "arm"
    return {k: None if k in unlimited and v == unlimited[k] else v for k, v in values.items()}


def _are_equal(one: Value, other: Value) -> bool:
    """Whether values are the same, but for the rounding of a direction's length."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return all(math.isclose(a, b, abs_tol=1e-12) for a, b in zip(one, other, strict=True))
    return one == other


def _value_text(name: str, value: Value) -> str:
    """A value for people, to digits that tell any two apart."""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, tuple):
        return f"[{', '.join(f'{part:.12g}' for part in value)}]"
    unit = TRIAL_SETTING_UNITS.get(name, "")
    number = math.degrees(value) if unit == "degrees" else value
    return f"{number:.12g} {unit}".rstrip()
