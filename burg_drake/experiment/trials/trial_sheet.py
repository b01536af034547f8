"""The trials file: which grasps are tried on the robot, in which order, and how each trial ended.

People read and edit the file by hand. Results are filled in as trials are carried out; unknown
values are left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import ClassVar, Literal

from burg_drake.core import (
    Among,
    FieldError,
    InvalidInputError,
    Mode,
    Outcome,
    Pose,
    RealOutcome,
    load_document,
    quote_value,
    require_names,
    save_document,
    suggest_names,
)
from burg_drake.evaluation import Input


def require_minimum(value: int, least: int, name: str) -> None:
    """Refuses a number in a document below the minimum."""
    if value < least:
        raise FieldError(f"{name} is {value}; it must be at least {least}", name)


def require_known(name: str, known: Iterable[str], what: str, *place: str | int) -> None:
    """Refuses an unknown name of the kind `what`."""
    known = list(known)
    if name not in known:
        raise FieldError(
            f"there is no {what} {quote_value(name)}; {suggest_names(name, known)}", *place
        )


def require_time(text: str, name: str) -> None:
    """Refuses a time that is not ISO 8601; empty means unknown."""
    try:
        if text:
            datetime.fromisoformat(text)
    except ValueError as error:
        raise FieldError(
            f"{name} is {quote_value(text)}; write it as in 2026-05-04T16:30:00+02:00", name
        ) from error


Success = Literal["lifted", "held"]
"""Outcomes that count as success: `lifted` alone, or with `held` also `lifted_disturbed` (another
object moved) and `lifted_turned` (the object turned in the hand)."""
Balance = Literal["outcome", "stage", "margin", "probability", "none"]


@dataclass(frozen=True, kw_only=True)
class SourceRun:
    """A run whose grasps are tried.

    Attributes:
        path: folder of the run, relative to this file, or absolute.
        hash: hash of the run; column `run` of its results.
        scene: scene of the run.
        station: station of the run.
        mode: `hand`: the hand alone executed the grasps. `reach`: the same, of grasps that the arm
            can execute. `arm`: the whole arm executed them.
        engine: name of the physics engine.
    """

    path: str
    hash: str
    scene: Input
    station: Input
    mode: Mode
    engine: str


@dataclass(frozen=True, kw_only=True)
class Selection:
    """How grasps were chosen.

    Attributes:
        per_object: number of grasps wanted of each object of a run.
        balance: quantity whose values were to be equally frequent among the chosen grasps.
        margin: name of the margin, if `balance` is `margin`.
        bins: number of groups that the margin or the probability was divided into.
        success: which outcomes count as success. `lifted`: only lifted. `held`: also grasps that
            held the object but turned it, or moved another one.
        seed: seed of choice and order.
        among: grasps that were chosen from: all, those with the hand `clear`, those the arm can
            reach (`reachable`), or those tried in simulation (`executed`).
        scenes: number of scenes drawn from those of the runs; 0 for all.
        blocks: number of blocks that the trials of a scene were divided into.
    """

    WRITTEN_WHOLE: ClassVar[bool] = True

    per_object: int
    balance: Balance
    margin: str = ""
    bins: int = 0
    success: Success = "lifted"
    seed: int = 0
    among: Among = "executed"
    scenes: int = 0
    blocks: int = 1

    def __post_init__(self) -> None:
        require_minimum(self.per_object, 1, "per_object")
        require_minimum(self.blocks, 1, "blocks")
        require_minimum(self.scenes, 0, "scenes")
        require_minimum(self.bins, 0, "bins")
        if (self.balance == "margin") != bool(self.margin):
            what = "names a margin" if self.margin else "names none"
            raise FieldError(f"margin {what}, and balance is {self.balance!r}", "margin")


@dataclass(frozen=True, kw_only=True)
class Stratum:
    """A group of similar grasps of one object of one run.

    Attributes:
        run: name of the run in `runs`.
        object: name of the object in the library.
        label: what the grasps have in common, such as `success` or `slipped`.
        population: number of grasps in the group.
        selected: number of grasps that were chosen. Each stands for `population / selected` grasps.
        wanted: number of grasps that were wanted; larger than `selected` if there were too few.
    """

    run: str
    object: str
    label: str
    population: int
    selected: int
    wanted: int

    def __post_init__(self) -> None:
        require_minimum(self.selected, 0, "selected")
        if self.population < self.selected:
            raise FieldError(
                f"population {self.population} is smaller than selected, {self.selected}",
                "population",
            )


@dataclass(frozen=True, kw_only=True)
class ObjectPlace:
    """Where an object stood before a trial.

    Attributes:
        status: whether the object was `measured`, measured with doubt (`uncertain`), or `not_seen`.
        offset_mm: x and y of the measured minus the planned position, in the scene frame [mm].
        offset_sd_mm: standard deviations of `offset_mm` [mm].
        turn_deg: measured minus planned turn about the vertical [degrees]; left out if the object's
            symmetry hides it.
        turn_sd_deg: standard deviation of `turn_deg` [degrees].
        X_SO: measured pose of the object in the scene frame.
    """

    status: Literal["measured", "uncertain", "not_seen"]
    offset_mm: tuple[float, float] | None = None
    offset_sd_mm: tuple[float, float] | None = None
    turn_deg: float | None = None
    turn_sd_deg: float | None = None
    X_SO: Pose | None = None


@dataclass(frozen=True, kw_only=True)
class RobotReport:
    """What the robot reported.

    Attributes:
        width_mm: distance between the pads at the end [mm].
        effort_n: gripping force at the end [N].
    """

    width_mm: float | None = None
    effort_n: float | None = None

    def __post_init__(self) -> None:
        for name in ("width_mm", "effort_n"):
            value = getattr(self, name)
            if value is not None and value < 0.0:
                raise FieldError(f"{name} is {value:g}; it cannot be below 0", name)


@dataclass(frozen=True, kw_only=True)
class RealTrial:
    """One trial.

    Attributes:
        number: number of the trial, from 1, in the order in which they are carried out.
        block: number of the block; trials of a block are on the same scene, one after the other.
        run: name of the run in `runs`.
        grasp: id of the grasp in the run.
        content: short hash of the grasp's pose, width and instance.
        instance: name of the target in the scene.
        object: name of the target in the library.
        simulated: outcome in the run.
        stratum: name of the group in `strata`.
        outcome: outcome on the robot; left out until the trial is carried out.
        time: date and time of the trial, ISO 8601 with time zone.
        operator: who carried it out.
        note: what was noticed.
        photo: photo taken before the trial, relative to this file.
        placement: where the objects stood before the trial, by instance.
        robot: what the robot reported.
    """

    number: int
    block: int
    run: str
    grasp: str
    content: str
    instance: str
    object: str
    simulated: Outcome
    stratum: str
    outcome: RealOutcome | None = None
    time: str = ""
    operator: str = ""
    note: str = ""
    photo: str = ""
    placement: dict[str, ObjectPlace] = field(default_factory=dict)
    robot: RobotReport | None = None

    def __post_init__(self) -> None:
        require_minimum(self.number, 1, "number")
        require_time(self.time, "time")

    @property
    def carried_out(self) -> bool:
        """Whether the trial has an outcome, which may be that nobody tried."""
        return self.outcome is not None


@dataclass(frozen=True, kw_only=True)
class TrialSheet:
    """Trials on a robot: which grasps, in which order, and how each ended (`trials.yaml`).

    Attributes:
        created: date and time of the plan, ISO 8601 with time zone.
        runs: runs whose grasps are tried, by a name of your choice.
        selection: how the grasps were chosen.
        strata: groups of similar grasps that were chosen from, by name.
        trials: the trials, in order.
        notes: what to know about the choice, such as groups with too few grasps.
        versions: versions of the software that chose.
    """

    version: int = 1
    created: str = ""
    runs: dict[str, SourceRun]
    selection: Selection
    strata: dict[str, Stratum] = field(default_factory=dict)
    trials: tuple[RealTrial, ...] = ()
    notes: tuple[str, ...] = ()
    versions: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        require_names(self.runs, "runs")
        require_time(self.created, "created")
        for key, stratum in self.strata.items():
            require_known(stratum.run, self.runs, "run", "strata", key, "run")
        indices: dict[int, int] = {}
        for i, trial in enumerate(self.trials):
            first = indices.setdefault(trial.number, i)
            if first != i:
                raise FieldError(
                    f"number {trial.number} is used twice, by entries {first + 1} and "
                    f"{i + 1} of the list",
                    *("trials", i, "number"),
                )
            self._check_trial(i, trial)

    def _check_trial(self, i: int, trial: RealTrial) -> None:
        """Refuses a trial with an unknown run or stratum, or with the stratum of another run or
        object. If the file has no strata, those of trials are not checked.
        """
        require_known(trial.run, self.runs, "run", "trials", i, "run")
        if not self.strata:
            return
        require_known(trial.stratum, self.strata, "stratum", "trials", i, "stratum")
        stratum = self.strata[trial.stratum]
        for name in ("run", "object"):
            expected, actual = getattr(stratum, name), getattr(trial, name)
            if expected != actual:
                raise FieldError(
                    f"stratum {trial.stratum!r} is of {name} {expected!r}, trial {trial.number} of"
                    f" {actual!r}",
                    *("trials", i, "stratum"),
                )

    def trial(self, number: int) -> RealTrial:
        """The trial with a number.

        Raises:
            InvalidInputError: there is none.
        """
        return self.trials[self.index(number)]

    def index(self, number: int) -> int:
        """Index in `trials` of the trial with a number.

        Raises:
            InvalidInputError: there is none.
        """
        for i, trial in enumerate(self.trials):
            if trial.number == number:
                return i
        numbers = [trial.number for trial in self.trials]
        span = f"they have {min(numbers)} to {max(numbers)}" if numbers else "there are no trials"
        raise InvalidInputError(f"there is no trial {number}; {span}")

    @property
    def next(self) -> RealTrial | None:
        """The first trial, by number, without an outcome; None if all have one."""
        left = [trial for trial in self.trials if not trial.carried_out]
        return min(left, key=lambda trial: trial.number, default=None)


def is_success(outcome: Outcome | RealOutcome, success: Success) -> bool:
    """Whether an outcome counts as success."""
    return outcome.held if success == "held" else outcome.value == Outcome.LIFTED.value


def load_trials(path: str | Path) -> TrialSheet:
    """Reads a trials file; see `load_document`."""
    return load_document(path, TrialSheet)


def save_trials(sheet: TrialSheet, path: str | Path) -> None:
    """Writes a trials file; see `save_document`."""
    header = """Trials on the robot, in the order of their numbers. Fill in outcome, note and the
rest by hand, or with burg-drake trials record and burg-drake trials serve."""
    save_document(sheet, path, header)
