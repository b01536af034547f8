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
from burg_drake.experiment.comparison.compared_runs import JudgedRuns, unpredictable_for
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
    """Which steps there are.

    Attributes:
        last: the last mode; `arm` where there is an arm, else `hand`, if None.
        noise: of the objects' places. The hand goes where it was planned to go.
        samples: number of displaced scenes; 0 leaves the step out.
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
        name: which.
        runs: one, or one for each displaced scene.
    """

    name: StepName
    runs: tuple[Run, ...]


@dataclass(frozen=True, eq=False)
class GapSteps:
    """All steps.

    Attributes:
        path: folder.
        document: what was asked.
        steps: in order.
        tried: further grasps in the displaced scenes of the last step, those of real trials that
            fail in the last mode.
    """

    path: Path
    document: GapDocument
    steps: tuple[GapStep, ...]
    tried: tuple[Run, ...] = ()

    @property
    def first(self) -> Run:
        """The run of the hand alone."""
        return self.steps[0].runs[0]


@dataclass(frozen=True)
class OutcomeChange:
    """A grasp before and after a step.

    Attributes:
        grasp, instance, object: which grasp on what.
        before, after: its outcomes.
        blocker: of the verdict after.
        run: folder of the verdict after, in which it can be replayed.
        won, lost: whether the step made it a success, or was the end of one.
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
    """What a step changes.

    Attributes:
        step: its name.
        moves: all grasps, changed or not; in displaced scenes each once a scene.
        success: what counts.
        failed: number of grasps left out, whose simulation failed before or after the step, for
            example because the memory ran out: that tells nothing of the gap.
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
        """Successes that are none any more."""
        return tuple(move for move in self.moves if move.lost)

    @cached_property
    def won(self) -> tuple[OutcomeChange, ...]:
        """Failures that succeed now."""
        return tuple(move for move in self.moves if move.won)

    @cached_property
    def successes(self) -> int:
        """Successes before the step."""
        return sum(is_success(move.before, self.success) for move in self.moves)

    @property
    def share_lost(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the share of successes that are lost."""
        return wilson_interval(len(self.lost), self.successes)

    @property
    def blockers(self) -> Counter[str]:
        """Bodies that are in the way of grasps that are lost."""
        return Counter(move.blocker for move in self.lost if move.blocker)


def gap_changes(steps: GapSteps, success: Success) -> tuple[Change, ...]:
    """What each step but the first changes.

    Args:
        steps: all steps.
        success: what counts.
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
            was, now = verdicts[candidate.id].outcome, run.verdicts[candidate.id]
            there, here = is_success(was, success), is_success(now.outcome, success)
            yield OutcomeChange(
                candidate.id,
                candidate.instance,
                scene.instance(candidate.instance).object,
                was,
                now.outcome,
                now.blocker,
                str(run.path),
                won=here and not there,
                lost=there and not here,
            )


def successes_by_object(step: GapStep, success: Success) -> dict[str, tuple[int, int]]:
    """Successes and grasps of each object, without those whose simulation failed; in displaced
    scenes counted once a scene."""
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
    """Real trials beside the verdicts of a step.

    Attributes:
        step: its name.
        found: confusion matrix and figures of the trials, each counted once.
        all_grasps: the same of all grasps that they were chosen from; None if that is not known.
        unpredictable: trials, among them, with a failure that the step's mode does not predict.
    """

    step: StepName
    found: Agreement
    all_grasps: Agreement | None
    unpredictable: int = 0

    @property
    def estimated(self) -> Agreement:
        """The figures that hold for the grasps of the run, as far as that is known."""
        return self.all_grasps or self.found


def tried_grasps(sheet: TrialSheet, path: str | Path, run: Run) -> list[RealTrial]:
    """The trials of a sheet about grasps of a run, carried out or not.

    Args:
        sheet: contents of the trials file.
        path: the trials file, for messages.
        run: theirs, or another one of the same scene; grasps are the same by id and content.

    Raises:
        InvalidInputError: it is theirs, and a grasp is not the one that was planned with.
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
    """Compares each step with the trials that tell anything of its grasp.

    A grasp in displaced scenes is predicted to succeed if it does in more than half of them.

    Args:
        steps: all steps.
        sheet: the trials file, which says what they were chosen from.
        trials: see `tried_grasps`.
        success: what counts.
    """
    real = [trial for trial in trials if trial.outcome and trial.outcome.attempted]
    found = []
    for step in steps.steps:
        runs = [*step.runs, *steps.tried] if step.name == "placed" else list(step.runs)
        predicted, actual, told = [], [], []
        for trial in real:
            assert trial.outcome is not None
            verdicts = [run.verdicts[trial.grasp] for run in runs if trial.grasp in run.verdicts]
            judged = [v.outcome for v in verdicts if v.outcome is not Outcome.SIMULATION_FAILED]
            if judged:
                good = sum(is_success(outcome, success) for outcome in judged)
                predicted.append(good > len(judged) / 2)
                actual.append(is_success(trial.outcome, success))
                told.append(trial)
        answers = np.array(predicted, dtype=bool), np.array(actual, dtype=bool)
        strata = selection_strata(sheet, told)
        every = None if strata is None else strata.agreement(*answers)
        beyond = unpredictable_for(JudgedRuns(runs[0])) if runs else frozenset()
        apart = sum(trial.outcome in beyond for trial in told)
        found.append(
            StepAgreement(step.name, estimate_agreement(count_cells(*answers)), every, apart)
        )
    return tuple(found)
