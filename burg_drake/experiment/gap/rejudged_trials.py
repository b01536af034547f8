"""Real trials that were judged again, and what that says of where disagreement comes from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Literal

from burg_drake.core import wilson_interval
from burg_drake.core.grasps import Outcome, RealOutcome, Verdict
from burg_drake.evaluation.candidates import Candidate
from burg_drake.evaluation.records import TrialOrigin
from burg_drake.evaluation.store import Run
from burg_drake.experiment.pairing import unpredictable_outcomes
from burg_drake.experiment.statistics import Paired, paired_counts
from burg_drake.experiment.trials import RealTrial, Success, TrialSheet, grasp_contents, succeeded
from burg_drake.scene.document import Scene

TrialCause = Literal["agreed", "placement", "worsened", "physics", "unpredictable"]
CAUSES: dict[TrialCause, str] = {
    "agreed": "agreed as planned, and as measured",
    "placement": "disagreed as planned, agree as measured: explained by the placement",
    "worsened": "agreed as planned, disagree as measured: worsened",
    "physics": "disagree either way: left to physics",
    "unpredictable": "failed for reasons that a run of the hand alone cannot predict",
}
"""What a pair of verdicts says of a real one."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Rejudged:
    """A real trial, judged again.

    Attributes:
        number: of the trial.
        run: key of its run in the sheet.
        grasp, instance, object: which grasp on what.
        real: how it ended on the robot.
        planned: what the run found.
        origin: how the run judged.
        candidate: the grasp in the frame of the object as it stood; None if there is no scene.
        scene: as measured; None if it cannot be.
        notes: what was not taken as measured.
        reason: why there is no scene; empty if there is.
        verdict: of judging again.
    """

    number: int
    run: str
    grasp: str
    instance: str
    object: str
    real: RealOutcome
    planned: Outcome
    origin: TrialOrigin
    candidate: Candidate | None = None
    scene: Scene | None = None
    notes: tuple[str, ...] = ()
    reason: str = ""
    verdict: Verdict | None = None

    @property
    def outcome(self) -> Outcome | None:
        """Of judging again; None if it could not be judged."""
        failed = self.verdict is None or self.verdict.outcome is Outcome.SIMULATION_FAILED
        return None if failed or self.verdict is None else self.verdict.outcome

    @property
    def why_not(self) -> str:
        """Why it could not be judged; empty if it was."""
        if self.outcome is not None:
            return ""
        return self.reason or (self.verdict.reason if self.verdict else "")

    @cached_property
    def unpredictable(self) -> bool:
        """Whether no verdict of the run's mode could predict how it ended on the robot."""
        approach = self.origin.settings().approach
        return self.real in unpredictable_outcomes(self.origin.mode, approach=approach)

    def is_right(self, success: Success, *, measured: bool) -> bool:
        """Whether the verdict as planned, or as measured, agrees with the robot."""
        verdict = self.outcome if measured else self.planned
        return verdict is not None and succeeded(verdict, success) is succeeded(self.real, success)

    def cause(self, success: Success) -> TrialCause | None:
        """What the two verdicts say of the real one; None if it could not be judged again, or not
        as planned."""
        if self.outcome is None or self.planned is Outcome.SIMULATION_FAILED:
            return None
        if self.unpredictable:
            return "unpredictable"
        planned, measured = (self.is_right(success, measured=m) for m in (False, True))
        if planned:
            return "agreed" if measured else "worsened"
        return "placement" if measured else "physics"


@dataclass(frozen=True, eq=False, kw_only=True)
class Rejudging:
    """All trials of a sheet.

    Attributes:
        path: folder with the answers.
        success: what counts as success.
        trials: those with an outcome and a placement.
        skipped: why the others were not judged again, by number.
    """

    path: Path
    success: Success
    trials: tuple[Rejudged, ...]
    skipped: dict[int, str]

    @cached_property
    def judged(self) -> tuple[Rejudged, ...]:
        """Trials that have a planned verdict and one as measured."""
        return tuple(t for t in self.trials if t.cause(self.success) is not None)

    @cached_property
    def causes(self) -> Counter[TrialCause]:
        """Number of trials by what they say."""
        found: Counter[TrialCause] = Counter(dict.fromkeys(CAUSES, 0))
        found.update(c for t in self.judged if (c := t.cause(self.success)) is not None)
        return found

    @cached_property
    def table(self) -> Counter[tuple[bool, bool, bool]]:
        """Number of trials by success as planned, as measured, and in reality."""
        return Counter(
            (
                succeeded(t.planned, self.success),
                t.outcome is not None and succeeded(t.outcome, self.success),
                succeeded(t.real, self.success),
            )
            for t in self.judged
        )

    @cached_property
    def predictable(self) -> tuple[Rejudged, ...]:
        """Those of them whose outcome a verdict can predict."""
        return tuple(t for t in self.judged if not t.unpredictable)

    def agreement(self, *, measured: bool, every: bool = False) -> tuple[int, float, float]:
        """Number of trials that agree with reality, as planned or as measured, and Wilson's 95 %
        interval of their share.

        Args:
            measured: the verdicts with the objects where they stood, not those as planned.
            every: of all trials, and not only of the predictable ones.
        """
        trials = self.judged if every else self.predictable
        count = sum(trial.is_right(self.success, measured=measured) for trial in trials)
        return count, *wilson_interval(count, len(trials))

    def precision(self, *, measured: bool, every: bool = False) -> tuple[int, int]:
        """Successes among the predicted successes, and how many those are; arguments as those of
        `agreement`."""
        promised = [
            trial
            for trial in (self.judged if every else self.predictable)
            if (verdict := trial.outcome if measured else trial.planned) is not None
            and succeeded(verdict, self.success)
        ]
        return sum(succeeded(trial.real, self.success) for trial in promised), len(promised)

    @property
    def explained(self) -> tuple[int, int, float, float]:
        """Of the trials that disagree as planned: how many agree as measured, how many there are,
        and Wilson's 95 % interval of the share."""
        count = self.causes["placement"]
        whole = count + self.causes["physics"]
        return count, whole, *wilson_interval(count, whole)

    @cached_property
    def paired(self) -> Paired:
        """McNemar's exact test of which verdicts agree with reality more often: those as measured,
        which come first, or those as planned."""
        of = self.causes
        return paired_counts(of["agreed"], of["placement"], of["worsened"], of["physics"])


def skip_reason(trial: RealTrial, run: Run | None, content: str | None) -> str:
    """Why a trial cannot be judged again in a run; empty if it can.

    Args:
        trial: the trial.
        run: stands for the trial's.
        content: of the grasp that it has by this id; None if it has none.
    """
    if trial.outcome is None:
        return "not carried out yet"
    if not trial.outcome.attempted:
        return trial.outcome.value.replace("_", " ")
    if not any(place.status == "measured" and place.X_SO for place in trial.placement.values()):
        return "placement not measured"
    if run is None:
        return "of another scene"
    if content is None:
        return "grasp not in the run"
    return "" if content == trial.content else "another grasp of this id in the run"


def runs_for(sheet: TrialSheet, runs: Sequence[Run]) -> dict[str, Run]:
    """Which of some runs stands for each run of a sheet: itself, or else one of the same scene,
    that which has most of the grasps.

    Args:
        sheet: the trials.
        runs: what a folder holds.
    """
    found = {}
    for key, source in sheet.runs.items():
        same = [run for run in runs if run.document.scene.content == source.scene.content]
        if same:
            tried = {t.grasp: t.content for t in sheet.trials if t.run == key}
            found[key] = max(same, key=partial(_match_rank, hash=source.hash, tried=tried))
    return found


def _match_rank(run: Run, hash: str, tried: Mapping[str, str]) -> tuple[bool, int]:
    return run.document.hash == hash, len(grasp_contents(run, tried).items() & tried.items())
