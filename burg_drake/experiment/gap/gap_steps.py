"""The steps of a gap measurement, the changes between them, and agreement with real trials."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from burg_drake.core import InvalidInputError, Mode, Outcome, setting, wilson_interval
from burg_drake.evaluation import Run
from burg_drake.experiment.comparison.compared_runs import (
    ComparedRuns,
    outcomes_unpredictable_for_runs,
)
from burg_drake.experiment.comparison.confusion_matrix import (
    Agreement,
    count_cells,
    estimate_agreement,
)
from burg_drake.experiment.comparison.run_comparison import selection_strata
from burg_drake.experiment.gap.displaced_scenes import PlacementNoise
from burg_drake.experiment.trials.source_runs import grasp_contents
from burg_drake.experiment.trials.trial_sheet import RealTrial, Success, TrialSheet, is_success


@dataclass(frozen=True, kw_only=True)
class GapSettings:
    """Steps of a gap measurement.

    Attributes:
        last: the last mode; if None, `arm` with an arm, else `hand`.
        noise: placement errors of the objects. The hand moves to the planned poses.
        samples: number of displaced scenes; 0 omits the step.
    """

    last: Mode | None = None
    noise: PlacementNoise = field(default_factory=PlacementNoise)
    samples: int = setting(
        5, "number of displaced scenes; 0 leaves the step out", metavar="K", low=0
    )

    def __post_init__(self) -> None:
        if self.samples < 0:
            raise InvalidInputError(f"samples is {self.samples}; give 0 or more")


StepName = Literal["hand", "reach", "arm", "placed"]


@dataclass(frozen=True, kw_only=True)
class GapDocument:
    """A measurement of the gap between simulation and robot, step by step (`gap.yaml`).

    Attributes:
        source: hash of the run whose grasps are evaluated; empty if they were sampled.
        scene: hash of the scene.
        station: hash of the station.
        last: mode of the last step.
        place_mm: standard deviation of the objects' positions [mm].
        turn_deg: standard deviation of the objects' turns about the vertical [degrees].
        seed: seed of the displacements.
        samples: number of displaced scenes.
        redrawn: how often places were drawn again, for each displaced scene.
        kept: objects that stay as planned because no other place was found, by displaced scene.
        versions: versions of the software.
    """

    version: int = 1
    source: str = ""
    scene: str
    station: str
    last: Mode
    place_mm: float
    turn_deg: float
    seed: int
    samples: int
    redrawn: tuple[int, ...] = ()
    kept: dict[str, tuple[str, ...]] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class GapStep:
    """One step.

    Attributes:
        name: name of the step.
        runs: one run, or one for each displaced scene.
    """

    name: StepName
    runs: tuple[Run, ...]


@dataclass(frozen=True, eq=False)
class GapSteps:
    """All steps.

    Attributes:
        path: folder.
        document: settings of the measurement.
        steps: the steps in order.
        tried: runs of the last step on further grasps: grasps of real trials that fail in the last
            mode.
    """

    path: Path
    document: GapDocument
    steps: tuple[GapStep, ...]
    tried: tuple[Run, ...] = ()

    @property
    def first(self) -> Run:
        """Run of the hand alone."""
        return self.steps[0].runs[0]


@dataclass(frozen=True)
class OutcomeChange:
    """A grasp before and after a step.

    Attributes:
        grasp, instance, object: id of the grasp, names of instance and object.
        before, after: outcome before and after the step.
        blocker: blocker after the step.
        run: folder of the run after the step, for a replay.
        won, lost: whether the step turned a failure into a success, or a success into a failure.
    """

    grasp: str
    instance: str
    object: str
    before: Outcome
    after: Outcome
    blocker: str
    run: str
    won: bool
    lost: bool


@dataclass(frozen=True, eq=False)
class Change:
    """Changes of outcomes by a step.

    Attributes:
        step: name of the step.
        moves: all grasps, changed or not; with displaced scenes, once per scene.
        success: criterion of success.
        failed: number of omitted grasps whose simulation failed before or after the step, for
            example because the memory ran out.
    """

    step: StepName
    moves: tuple[OutcomeChange, ...]
    success: Success
    failed: int = 0

    @cached_property
    def flow(self) -> Counter[tuple[Outcome, Outcome]]:
        """Number of grasps by outcome before and after."""
        return Counter((move.before, move.after) for move in self.moves)

    @cached_property
    def lost(self) -> tuple[OutcomeChange, ...]:
        """Successes that turn into failures."""
        return tuple(move for move in self.moves if move.lost)

    @cached_property
    def won(self) -> tuple[OutcomeChange, ...]:
        """Failures that turn into successes."""
        return tuple(move for move in self.moves if move.won)

    @cached_property
    def successes(self) -> int:
        """Successes before the step."""
        return sum(is_success(move.before, self.success) for move in self.moves)

    @property
    def share_lost(self) -> tuple[float, float]:
        """Share of lost successes, with Wilson's 95 % interval."""
        return wilson_interval(len(self.lost), self.successes)

    @property
    def blockers(self) -> Counter[str]:
        """Blockers of lost grasps."""
        return Counter(move.blocker for move in self.lost if move.blocker)


def gap_changes(steps: GapSteps, success: Success) -> tuple[Change, ...]:
    """Changes by each step after the first.

    Args:
        steps: all steps.
        success: criterion of success.
    """
    changes = []
    for before, step in pairwise(steps.steps):
        moves = list(_outcome_changes(before.runs[0], step.runs, success))
        judged = tuple(m for m in moves if Outcome.SIMULATION_FAILED not in (m.before, m.after))
        changes.append(Change(step.name, judged, success, len(moves) - len(judged)))
    return tuple(changes)


def _outcome_changes(
    before: Run, after: Sequence[Run], success: Success
) -> Iterable[OutcomeChange]:
    verdicts, scene = before.verdicts, before.scene()
    for run in after:
        for candidate in run.candidates:
            old, verdict = verdicts[candidate.id].outcome, run.verdicts[candidate.id]
            succeeded, succeeds = is_success(old, success), is_success(verdict.outcome, success)
            yield OutcomeChange(
                candidate.id,
                candidate.instance,
                scene.instance(candidate.instance).object,
                old,
                verdict.outcome,
                verdict.blocker,
                str(run.path),
                won=succeeds and not succeeded,
                lost=succeeded and not succeeds,
            )


def successes_by_object(step: GapStep, success: Success) -> dict[str, tuple[int, int]]:
    """Counts of successes and grasps of each object, without failed simulations; with displaced
    scenes, once per scene.
    """
    found: dict[str, tuple[int, int]] = {}
    for run in step.runs:
        columns = run.results
        for name, outcome in zip(columns["object"], columns["outcome"], strict=True):
            if outcome == Outcome.SIMULATION_FAILED:
                continue
            good, all = found.get(str(name), (0, 0))
            found[str(name)] = good + is_success(Outcome(outcome), success), all + 1
    return found


@dataclass(frozen=True)
class StepAgreement:
    """Agreement of a step's verdicts with real trials.

    Attributes:
        step: name of the step.
        selected: confusion matrix and figures of the trials, each counted once.
        all_grasps: figures of all grasps that the trials were chosen from; None if unknown.
        unpredictable: number of trials with a failure that the step's mode does not predict.
    """

    step: StepName
    selected: Agreement
    all_grasps: Agreement | None
    unpredictable: int = 0

    @property
    def estimated(self) -> Agreement:
        """Figures of all grasps of the run if known, else of the trials."""
        return self.all_grasps or self.selected


def trials_of_run(sheet: TrialSheet, path: str | Path, run: Run) -> list[RealTrial]:
    """The trials of a run's grasps, carried out or not.

    Args:
        sheet: contents of the trials file.
        path: the trials file, for messages.
        run: run in the trials file, or another run of the same scene; grasps are matched by id and
            content.

    Raises:
        InvalidInputError: the run is in the trials file, but a grasp differs from the planned one.
    """
    scene, found = run.document.scene.content, []
    contents = grasp_contents(run, (trial.grasp for trial in sheet.trials))
    for trial in sheet.trials:
        source, content = sheet.runs[trial.run], contents.get(trial.grasp)
        if source.scene.content == scene and content == trial.content:
            found.append(trial)
        elif source.hash == run.document.hash:
            has = "is gone" if content is None else f"has content {content}"
            raise InvalidInputError(
                f"{path}: trial {trial.number}: grasp {trial.grasp} of {run.path} {has}; it had"
                f" {trial.content} when the trials were planned"
            )
    return found


def agreement_by_step(
    steps: GapSteps, sheet: TrialSheet, trials: Sequence[RealTrial], success: Success
) -> tuple[StepAgreement, ...]:
    """Compares each step with the informative trials.

    With displaced scenes, success is predicted if the grasp succeeds in more than half of them.

    Args:
        steps: all steps.
        sheet: contents of the trials file, with the strata.
        trials: see `trials_of_run`.
        success: criterion of success.
    """
    attempted = [trial for trial in trials if trial.outcome and trial.outcome.attempted]
    found = []
    for step in steps.steps:
        runs = [*step.runs, *steps.tried] if step.name == "placed" else list(step.runs)
        predicted, actual, compared = [], [], []
        for trial in attempted:
            assert trial.outcome is not None
            verdicts = [run.verdicts[trial.grasp] for run in runs if trial.grasp in run.verdicts]
            judged = [v.outcome for v in verdicts if v.outcome is not Outcome.SIMULATION_FAILED]
            if judged:
                good = sum(is_success(outcome, success) for outcome in judged)
                predicted.append(good > len(judged) / 2)
                actual.append(is_success(trial.outcome, success))
                compared.append(trial)
        answers = np.array(predicted, dtype=bool), np.array(actual, dtype=bool)
        selected = estimate_agreement(count_cells(*answers))
        strata = selection_strata(sheet, compared)
        all_grasps = None if strata is None else strata.agreement(*answers)
        outcomes = outcomes_unpredictable_for_runs(ComparedRuns(runs[0])) if runs else frozenset()
        unpredictable = sum(trial.outcome in outcomes for trial in compared)
        found.append(StepAgreement(step.name, selected, all_grasps, unpredictable))
    return tuple(found)
