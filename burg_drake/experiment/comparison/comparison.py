"""What comes of a comparison: simulated outcomes against real ones, or another simulation's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from burg_drake.experiment.comparison.judge_assessment import Judgement
from burg_drake.experiment.comparison.run_agreement import RunAgreement
from burg_drake.experiment.pairing import Side
from burg_drake.experiment.statistics import Estimate, Paired
from burg_drake.experiment.trials import Success


@dataclass(frozen=True, kw_only=True)
class Coverage:
    """Which grasps the figures are about.

    Attributes:
        compared: grasps with a verdict and an outcome.
        only_first, only_second: grasps, or trials, that the other side has not.
        other_content: grasps that have only their id in common.
        left_out: grasps of both sides that tell nothing, by reason.
    """

    compared: int
    only_first: int = 0
    only_second: int = 0
    other_content: int = 0
    left_out: Mapping[str, int]


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A comparison with all its figures; intervals are those of 95 %.

    Attributes:
        kind: `trials`, a run against the robot; `runs`, a run against another one; `simulators`,
            two runs against the same trials on the robot.
        success: what counts as success.
        first: the run whose verdicts are predictions.
        second: the other run of `simulators`.
        reference: what happened: the trials, or the second run of `runs`.
        coverage: which grasps were compared.
        judgement: figures of the first run.
        other: figures of the second run of `simulators`.
        difference: how often either of them was right about the same trial.
        difference_of_all: share of all grasps that the trials stand for about which the first is
            right, less that of the second; None if nothing says what they were chosen from.
        agreement: of the two `runs`, where neither is taken for the truth.
        settings: in what two runs differ, in words.
        notes: what people should know before they trust the figures.
        seed: of the intervals' resampling.
    """

    version: int = 1
    kind: Literal["trials", "runs", "simulators"]
    success: Success
    first: Side
    second: Side | None = None
    reference: Side
    coverage: Coverage
    judgement: Judgement
    other: Judgement | None = None
    difference: Paired | None = None
    difference_of_all: Estimate | None = None
    agreement: RunAgreement | None = None
    settings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seed: int = 0
