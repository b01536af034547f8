"""What each step does to the agreement with real trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from burg_drake.core.outcome import Outcome
from burg_drake.experiment.comparison.agreement import Agreement, agreement, matrix_of
from burg_drake.experiment.gap.rejudged import succeeded
from burg_drake.experiment.gap.steps import Ladder, StepName
from burg_drake.experiment.trials.sheet import RealTrial, Success, TrialSheet


@dataclass(frozen=True)
class StepAgreement:
    """Real trials beside the verdicts of a step.

    Attributes:
        step: its name.
        found: confusion matrix and figures.
    """

    step: StepName
    found: Agreement


def tried_grasps(sheet: TrialSheet, scene: str) -> list[RealTrial]:
    """The trials of a sheet in a scene of this content, carried out or not."""
    return [trial for trial in sheet.trials if sheet.runs[trial.run].scene.content == scene]


def agreement_by_step(
    ladder: Ladder, trials: Sequence[RealTrial], success: Success
) -> tuple[StepAgreement, ...]:
    """Compares each step with the trials that tell anything of a grasp of the ladder.

    A grasp in displaced scenes is predicted to succeed if it does in more than half of them.

    Args:
        ladder: all steps.
        trials: see `tried_grasps`.
        success: what counts.
    """
    known = set(ladder.first.candidates.id)
    real = [t for t in trials if t.outcome and t.outcome.attempted and t.grasp in known]
    found = []
    for step in ladder.steps:
        runs = [*step.runs, *ladder.tried] if step.name == "placed" else list(step.runs)
        predicted, actual = [], []
        for trial in real:
            assert trial.outcome is not None
            verdicts = [run.verdicts[trial.grasp] for run in runs if trial.grasp in run.verdicts]
            judged = [v.outcome for v in verdicts if v.outcome is not Outcome.SIMULATION_FAILED]
            if judged:
                good = sum(succeeded(outcome, success) for outcome in judged)
                predicted.append(good > len(judged) / 2)
                actual.append(succeeded(trial.outcome, success))
        cells = matrix_of(np.array(predicted, dtype=bool), np.array(actual, dtype=bool))
        found.append(StepAgreement(step.name, agreement(cells)))
    return tuple(found)
