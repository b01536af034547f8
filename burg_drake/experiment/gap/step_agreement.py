"""What each step does to the agreement with real trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from burg_drake.core import InvalidInputError
from burg_drake.core.grasps import Outcome
from burg_drake.evaluation.store import Run
from burg_drake.experiment.comparison import strata_of
from burg_drake.experiment.gap.steps import GapSteps, StepName
from burg_drake.experiment.pairing import JudgedRuns, unpredictable_for
from burg_drake.experiment.statistics import Agreement, agreement, matrix_of
from burg_drake.experiment.trials import RealTrial, Success, TrialSheet, grasp_contents, succeeded


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
                good = sum(succeeded(outcome, success) for outcome in judged)
                predicted.append(good > len(judged) / 2)
                actual.append(succeeded(trial.outcome, success))
                told.append(trial)
        answers = np.array(predicted, dtype=bool), np.array(actual, dtype=bool)
        strata = strata_of(sheet, told)
        every = None if strata is None else strata.agreement(*answers)
        beyond = unpredictable_for(JudgedRuns(runs[0])) if runs else frozenset()
        apart = sum(trial.outcome in beyond for trial in told)
        found.append(StepAgreement(step.name, agreement(matrix_of(*answers)), every, apart))
    return tuple(found)
