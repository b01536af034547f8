"""What a trial returns: one typed outcome and continuous margins."""

from __future__ import annotations

from dataclasses import dataclass

from burg_drake.core.grasps import Margins as Margins, Outcome, TrialFindings
from burg_drake.grasping.clearance import Clearance


@dataclass(frozen=True, kw_only=True)
class TrialResult(TrialFindings):
    """One executed trial.

    Attributes:
        outcome: why it ended.
        margins: those that a trial measures, see `Margins.of_trial`.
        grip_start: simulated time at the last look before the closing fingers met the target [s].
    """

    outcome: Outcome
    margins: Margins
    grip_start: float = 0.0


def collision(screen: Clearance) -> TrialResult:
    """The result of a trial that did not start, as the open hand is not clear at the grasp,
    or where its approach begins."""
    assert screen.outcome is not None
    margins = Margins(overlap=screen.overlap, clearance=screen.clearance, end_time=0.0)
    return TrialResult(outcome=screen.outcome, margins=margins, blocker=screen.blocker)


def failure(error: BaseException, screen: Clearance, end_time: float) -> TrialResult:
    """The result of a trial that the simulator could not step.

    Args:
        error: what it said.
        screen: of the open hand at the grasp.
        end_time: when that was [s].
    """
    return TrialResult(
        outcome=Outcome.SIMULATION_FAILED,
        margins=Margins(overlap=0.0, clearance=screen.clearance, end_time=end_time),
        reason=" ".join(str(error).split()),
    )
