"""What a trial returns: one typed outcome and continuous margins."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from burg_drake.core.outcome import Outcome


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
        lift: how far the target's centre of mass rose [m]; of a trial that was decided on the way
            up, with the way that the hand had left.
        others_moved: largest displacement of the centre of mass of any other object [m].
        end_time: simulated time at which the outcome was decided [s].
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


@dataclass(frozen=True, kw_only=True)
class TrialResult:
    """One executed trial.

    Attributes:
        outcome: why it ended.
        margins: continuous slack.
        blocker: what the hand collided with at the start or met on its way up, if anything.
        reason: the simulator's message if it failed.
        displacements: how far the centre of mass of every other free object was moved at most
            [m], by instance; 0 of what nothing touched or stood close to. Empty if the trial did
            not start or failed.
    """

    outcome: Outcome
    margins: Margins
    blocker: str = ""
    reason: str = ""
    displacements: Mapping[str, float] = field(default_factory=dict)
