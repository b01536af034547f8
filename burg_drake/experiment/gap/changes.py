"""What a step changes: for each grasp what became of it before and after."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from burg_drake.core import wilson_interval
from burg_drake.core.grasps import Outcome
from burg_drake.evaluation.store import Run
from burg_drake.experiment.gap.steps import GapStep, GapSteps, StepName
from burg_drake.experiment.trials import Success, succeeded


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
        return sum(succeeded(move.before, self.success) for move in self.moves)

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
    return tuple(_change(before.runs[0], step, success) for before, step in pairwise(steps.steps))


def _change(before: Run, step: GapStep, success: Success) -> Change:
    moves = list(_moves(before, step.runs, success))
    judged = tuple(m for m in moves if Outcome.SIMULATION_FAILED not in (m.before, m.after))
    return Change(step.name, judged, success, len(moves) - len(judged))


def _moves(before: Run, after: Sequence[Run], success: Success) -> Iterable[OutcomeChange]:
    verdicts, scene = before.verdicts, before.scene()
    for run in after:
        for candidate in run.candidates:
            was, now = verdicts[candidate.id].outcome, run.verdicts[candidate.id]
            there, here = succeeded(was, success), succeeded(now.outcome, success)
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
            found[str(name)] = good + succeeded(Outcome(outcome), success), all + 1
    return found
