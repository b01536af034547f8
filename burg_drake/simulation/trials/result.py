"""What a trial returns: one typed outcome and continuous margins."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from burg_drake.core.grasps import Outcome
from burg_drake.grasping.clearance import Clearance


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Continuous slack behind an outcome; NaN where the trial ended before it was defined.

    Attributes:
        overlap: how deep the open hand overlaps what it collides with [m]; 0 if clear.
        clearance: signed distance of the open hand from the body nearest to it [m]; negative: how
            deep it overlaps what it collides with.
        slip: how far the target moved in the hand since the grip, at the grasp point [m].
        tilt: how far the target turned in the hand since the grip [rad].
        pad_force: normal force of the weaker pad [N], along the closing direction.
        patch_area: area on which the pad with the smaller contact patch touches the target [m^2].
        lift: how far the target's centre of mass rose, or went along the straight ways of another
            motion [m]; of a trial that was decided on the way, with what the hand had left of it.
        others_moved: largest displacement of the centre of mass of any other object since the start
            [m].
        end_time: simulated time at which the outcome was decided [s].
        tracking_error: largest deviation of any of the arm's joints from its command, on the way to
            the grasp and in the lift as far as it was simulated [rad]; NaN without an arm.
        tracking_distance: likewise, of the grasp frame's origin from where the commands lead [m].
        pushed: largest displacement of any free object, the target among them, before the hand
            began to close [m]; NaN without an arm.
    """

    overlap: float = math.nan
    clearance: float = math.nan
    slip: float = math.nan
    tilt: float = math.nan
    pad_force: float = math.nan
    patch_area: float = math.nan
    lift: float = math.nan
    others_moved: float = math.nan
    end_time: float = math.nan
    tracking_error: float = math.nan
    tracking_distance: float = math.nan
    pushed: float = math.nan


@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """One executed trial.

    Attributes:
        outcome: why it ended.
        margins: continuous slack.
        blocker: what the hand collided with at the start or met on its way, if anything; what a
            link of the arm met is written as "panda_link5 vs shelf".
        reason: the simulator's message if it failed.
        displacements: how far the centre of mass of every other free object was moved at most
            from where it stood at the start [m], by instance; 0 of what nothing touched or stood
            close to. Empty if the trial did not start or failed.
        pushed: the same when the hand began to close, and of the target, too: what the approach
            moved [m]. Empty without an arm.
        touched: the first touch that was not planned, as "panda_link5 vs can": of the robot with
            anything before the hand began to close; from then on of a link of the arm with
            anything, and of the hand with anything but target and table. Empty if there was none,
            or without an arm.
    """

    outcome: Outcome
    margins: Margins
    blocker: str = ""
    reason: str = ""
    displacements: Mapping[str, float] = field(default_factory=dict)
    pushed: Mapping[str, float] = field(default_factory=dict)
    touched: str = ""


def collision(screen: Clearance) -> TrialResult:
    """The result of a trial that did not start, as the open hand is not clear at the grasp."""
    assert screen.outcome is not None
    margins = Margins(overlap=screen.overlap, clearance=screen.clearance, end_time=0.0)
    return TrialResult(outcome=screen.outcome, margins=margins, blocker=screen.blocker)


def failure(error: BaseException, screen: Clearance, end_time: float) -> TrialResult:
    """The result of a trial that Drake could not step.

    Args:
        error: what Drake said.
        screen: of the open hand at the grasp.
        end_time: when that was [s].
    """
    return TrialResult(
        outcome=Outcome.SIMULATION_FAILED,
        margins=Margins(overlap=0.0, clearance=screen.clearance, end_time=end_time),
        reason=" ".join(str(error).split()),
    )
