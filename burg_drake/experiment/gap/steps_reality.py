"""What each step does to the agreement with real trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from burg_drake.core.outcome import Outcome
from burg_drake.core.statistics import wilson_interval
from burg_drake.experiment.gap.ladder import Ladder, StepName
from burg_drake.experiment.gap.rejudged import succeeded
from burg_drake.experiment.trials.sheet import RealTrial, Success, TrialSheet


@dataclass(frozen=True)
class StepAgreement:
    """Real trials beside the verdicts of a step.

    Attributes:
        step: its name.
        tp, fp, fn, tn: predicted successes that succeeded on the robot and that failed, predicted
            failures that succeeded and that failed.
    """

    step: StepName
    tp: int
    fp: int
    fn: int
    tn: int

    @property
    def trials(self) -> int:
        """Number of trials."""
        return self.tp + self.fp + self.fn + self.tn

    @property
    def shares(self) -> dict[str, tuple[int, int, float, float]]:
        """Precision, recall and accuracy: part, whole, and Wilson's 95 % interval."""
        parts = {
            "precision": (self.tp, self.tp + self.fp),
            "recall": (self.tp, self.tp + self.fn),
            "accuracy": (self.tp + self.tn, self.trials),
        }
        return {name: (*pair, *wilson_interval(*pair)) for name, pair in parts.items()}


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
        cells = dict.fromkeys(("tp", "fp", "fn", "tn"), 0)
        for trial in real:
            assert trial.outcome is not None
            verdicts = [run.verdicts[trial.grasp] for run in runs if trial.grasp in run.verdicts]
            judged = [v.outcome for v in verdicts if v.outcome is not Outcome.SIMULATION_FAILED]
            if judged:
                good = sum(succeeded(outcome, success) for outcome in judged) > len(judged) / 2
                came = succeeded(trial.outcome, success)
                cells[("tp" if came else "fp") if good else ("fn" if came else "tn")] += 1
        found.append(StepAgreement(step.name, **cells))
    return tuple(found)
