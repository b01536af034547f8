"""The document of trials on a robot: which grasps, in which order, and what became of each.

People read it and edit it by hand. What a trial tells is filled in as it is carried out; what is
not known is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from burg_drake.core.outcome import Outcome, RealOutcome
from burg_drake.core.schema import Pose, load_document, save_document
from burg_drake.evaluation.mode import Mode
from burg_drake.evaluation.run_document import Input

SHEET_HEADER = """Trials on the robot, in the order of their numbers. Fill in outcome, note and the
rest by hand, or with burg-drake trials record and burg-drake trials serve."""
Success = Literal["lifted", "held"]
"""What counts: `lifted` alone, or also where another object was disturbed (`lifted_disturbed`)."""
Balance = Literal["outcome", "stage", "margin", "probability", "none"]


@dataclass(frozen=True, kw_only=True)
class SourceRun:
    """A run whose grasps are tried.

    Attributes:
        path: its folder, from the folder of the sheet, or absolute.
        hash: `run_hash`; column `run` of its table.
        scene, station: what was judged, with content hashes.
        mode: what was asked about each grasp.
        engine: label of the engine.
    """

    path: str
    hash: str
    scene: Input
    station: Input
    mode: Mode
    engine: str


@dataclass(frozen=True, kw_only=True)
class Selection:
    """How the grasps were chosen.

    Attributes:
        per_object: how many of each object were wanted.
        balance: by what the grasps of an object were divided into strata.
        margin: name of the margin, with `margin`.
        bins: number of strata of a margin or a probability.
        success: what counts as success, here and in comparisons.
        seed: of choice and order.
    """

    per_object: int
    balance: Balance
    margin: str = ""
    bins: int = 0
    success: Success = "lifted"
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class Stratum:
    """Grasps of one object of one run that are alike in what was balanced.

    Attributes:
        run: key of the run.
        object: name in the library.
        label: what they have in common, such as `success` or `slipped`.
        population: how many there were to choose from.
        selected: how many were chosen; each stands for `population / selected` grasps.
        wanted: how many were asked for; more than `selected` where there were too few.
    """

    run: str
    object: str
    label: str
    population: int
    selected: int
    wanted: int


@dataclass(frozen=True, kw_only=True)
class ObjectPlace:
    """Where an object stood before a trial; see `cameras.placement_document.Placement`.

    Attributes:
        status: `measured`, `uncertain` or `not_seen`.
        offset_mm: x and y of its reference point in S, measured less target [mm].
        offset_sd_mm: standard deviations of both [mm].
        turn_deg: about the z axis of S [degrees]; None where its symmetry hides it.
        turn_sd_deg: its standard deviation [degrees].
        X_SO: its pose as it stood.
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


@dataclass(frozen=True, kw_only=True)
class RealTrial:
    """One trial.

    Attributes:
        number: from 1 on, in the order in which they are carried out.
        block: trials of a block are on the same scene, one after the other.
        run: key of the run in `TrialSheet.runs`.
        grasp: id of the grasp in the run.
        content: short hash of the grasp's pose, width and instance.
        instance: name of the target in the scene.
        object: its name in the library.
        simulated: what the run found.
        stratum: key in `TrialSheet.strata`.
        outcome: how it ended on the robot; None if it is still to be carried out.
        time: when, ISO 8601 with time zone.
        operator, note: who, and what was noticed.
        photo: file of the picture taken before, from the folder of the sheet.
        placement: where the objects stood before, by instance.
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


@dataclass(frozen=True, kw_only=True)
class TrialSheet:
    """Schema of a trials file.

    Attributes:
        created: date and time, ISO 8601 with time zone.
        runs: the runs whose grasps are tried, by key.
        selection: how the grasps were chosen.
        strata: what was chosen from, by key.
        trials: in order.
        versions: of the software that chose.
    """

    version: int = 1
    created: str = ""
    runs: dict[str, SourceRun]
    selection: Selection
    strata: dict[str, Stratum] = field(default_factory=dict)
    trials: tuple[RealTrial, ...] = ()
    versions: dict[str, str] = field(default_factory=dict)


def load_trials(path: str | Path) -> TrialSheet:
    """Reads a trials file; see `core.schema.load_document`."""
    return load_document(path, TrialSheet)


def save_trials(sheet: TrialSheet, path: str | Path) -> None:
    """Writes a trials file anew; see `core.schema.save_document`."""
    save_document(sheet, path, SHEET_HEADER)
