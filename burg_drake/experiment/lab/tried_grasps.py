"""Scene, station and grasp of each trial, and descriptions of grasps and outcomes for people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from burg_drake.core import Array, InvalidInputError, RealOutcome, outcome_label
from burg_drake.evaluation import Candidate, Run
from burg_drake.experiment.trials.source_runs import load_sources
from burg_drake.experiment.trials.trial_sheet import RealTrial, TrialSheet, load_trials
from burg_drake.scene import Scene
from burg_drake.station import Station

MAIN_OUTCOMES: dict[RealOutcome, tuple[str, str]] = {
    outcome: (outcome_label(outcome), meaning)
    for outcome, meaning in {
        RealOutcome.LIFTED: "held at the end of the lift, nothing else moved",
        RealOutcome.LIFTED_DISTURBED: "held at the end of the lift, but another object was moved",
        RealOutcome.LIFTED_TURNED: "held at the end of the lift, but turned or slid in the hand",
        RealOutcome.SLIPPED: "gripped, and lost during the lift",
        RealOutcome.DROPPED: "lifted, and lost while it was held",
        RealOutcome.CLOSED_EMPTY: "the fingers closed without the object",
        RealOutcome.HAND_COLLISION_APPROACH: "the hand hit something before it closed",
        RealOutcome.PROTECTIVE_STOP: "the robot stopped by itself",
        RealOutcome.PERCEPTION_FAILED: (
            "the scene was not seen well enough to try; does not count for the grasp"
        ),
        RealOutcome.NOT_ATTEMPTED: "nobody tried; does not count for the grasp",
    }.items()
}
"""Label and meaning of the outcomes with the keys 1 to 9 and 0."""
VERTICAL_TOLERANCE = math.radians(8.0)
"""Angle from vertical within which an approach counts as from above [rad]."""


def approach_text(X_SG: Array) -> str:
    """Description of the approach direction of a grasp (4, 4) in S."""
    sides = (  # in steps of 45 degrees from +x
        *("right", "far right", "far side", "far left"),
        *("left", "near left", "near side", "near right"),
    )
    approach_S = X_SG[:3, 2]
    tilt = math.acos(max(-1.0, min(1.0, float(-approach_S[2]))))
    if tilt < VERTICAL_TOLERANCE:
        return "from straight above"
    side = sides[round(math.atan2(-approach_S[1], -approach_S[0]) / (math.pi / 4)) % 8]
    degrees = round(math.degrees(tilt))
    if tilt > math.pi / 2 + VERTICAL_TOLERANCE:
        return f"from below, from the {side}, {degrees}° from straight down"
    if tilt > math.radians(75.0):
        return f"from the {side}, level ({degrees}° from straight down)"
    return f"from above, {degrees}° from the {side}"


def closing_text(X_SG: Array) -> str:
    """Closing direction of the fingers as an angle from x on the board, seen from above."""
    x, y, z = X_SG[:3, 0]
    if math.hypot(x, y) < math.sin(VERTICAL_TOLERANCE):
        return "upright"
    angle = round(math.degrees(math.atan2(y, x))) % 180
    slope = round(math.degrees(math.asin(min(1.0, abs(float(z))))))
    return f"at {angle}° to x" + (f", {slope}° from level" if slope >= 8 else "")


def point_text(X_SG: Array) -> str:
    """Position of a grasp on the board [mm], as text."""
    x, y, z = (round(1e3 * float(v)) for v in X_SG[:3, 3])
    return f"x {x}, y {y}, z {z} mm"


def format_time(text: str) -> str:
    """Displayed form of a time (ISO 8601); empty if there is none."""
    return text.replace("T", " ")[:16]


@dataclass(frozen=True, eq=False)
class TriedScene:
    """Run, scene and station of some trials.

    Attributes:
        run: the run on disk.
        scene, station: scene and station of the run.
    """

    run: Run
    scene: Scene
    station: Station

    @cached_property
    def candidates(self) -> dict[str, Candidate]:
        """The grasps by id."""
        return {candidate.id: candidate for candidate in self.run.candidates}


class TriedRuns:
    """Runs of a trials file.

    Args:
        path: the trials file.
        moved: folders of runs in place of those in the file, by key.

    Attributes:
        path: the trials file.
        sheet: contents of the trials file when it was opened.

    Raises:
        BurgError: the file does not fit the schema or has no trials; a run or a grasp is missing or
            differs from the plan.
    """

    def __init__(self, path: str | Path, moved: Mapping[str, str | Path] | None = None) -> None:
        self.path = Path(path)
        self.sheet: TrialSheet = load_trials(path)
        if not self.sheet.trials:
            raise InvalidInputError(
                f"{path} has no trials; burg-drake trials plan makes a file with trials"
            )
        used = {trial.run for trial in self.sheet.trials}
        runs = load_sources(self.sheet, path, moved=moved, only=used)
        self._tried = {
            key: TriedScene(run, run.scene(), run.station()) for key, run in runs.items()
        }

    def of(self, trial: RealTrial) -> TriedScene:
        """Run, scene and station of a trial."""
        return self._tried[trial.run]

    def candidate(self, trial: RealTrial) -> Candidate:
        """The grasp of a trial."""
        return self.of(trial).candidates[trial.grasp]

    def X_SG(self, trial: RealTrial) -> Array:
        """(4, 4) the grasp of a trial in the scene frame."""
        candidate = self.candidate(trial)
        return self.of(trial).scene.X_SO(candidate.instance) @ candidate.X_OG

    def width(self, trial: RealTrial) -> float:
        """Distance between the pads at the grasp [m]; that of the open hand if unknown."""
        width = self.candidate(trial).width
        return float(self.of(trial).station.hand.opening[1]) if math.isnan(width) else width


def trials_by_block(sheet: TrialSheet) -> dict[int, tuple[RealTrial, ...]]:
    """The trials by block, in the order of their numbers."""
    blocks: dict[int, list[RealTrial]] = {}
    for trial in sorted(sheet.trials, key=lambda trial: trial.number):
        blocks.setdefault(trial.block, []).append(trial)
    return {block: tuple(trials) for block, trials in blocks.items()}
