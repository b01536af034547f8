"""Trials on the real robot: which to carry out, their book, and comparison with simulation."""

from burg_drake.core.grasps import (
    RealOutcome as RealOutcome,
)
from burg_drake.experiment.comparison import (
    Comparison as Comparison,
    Coverage as Coverage,
    Disagreement as Disagreement,
    FactorGroup as FactorGroup,
    Judgement as Judgement,
    MarginDifference as MarginDifference,
    OutlierGroup as OutlierGroup,
    PartedGrasp as PartedGrasp,
    PlacementAgreement as PlacementAgreement,
    RunAgreement as RunAgreement,
    Stopped as Stopped,
    Unpredictable as Unpredictable,
    compare as compare,
)
from burg_drake.experiment.gap import (
    Change as Change,
    GapDocument as GapDocument,
    GapSettings as GapSettings,
    GapStep as GapStep,
    GapSteps as GapSteps,
    OutcomeChange as OutcomeChange,
    PlacementNoise as PlacementNoise,
    Rejudged as Rejudged,
    Rejudging as Rejudging,
    gap_changes as gap_changes,
    measure_gap as measure_gap,
    rejudge as rejudge,
)
from burg_drake.experiment.pairing import (
    Side as Side,
)
from burg_drake.experiment.planning import (
    SelectionSettings as SelectionSettings,
    mcnemar_power as mcnemar_power,
    plan_trials as plan_trials,
    smallest_difference as smallest_difference,
)
from burg_drake.experiment.statistics import (
    Agreement as Agreement,
    Bin as Bin,
    Estimate as Estimate,
    IsotonicStep as IsotonicStep,
    MarginCalibration as MarginCalibration,
    Paired as Paired,
)
from burg_drake.experiment.trials import (
    Entry as Entry,
    ExportedMotion as ExportedMotion,
    MissingValues as MissingValues,
    ObjectPlace as ObjectPlace,
    RealTrial as RealTrial,
    RobotReport as RobotReport,
    Selection as Selection,
    SourceRun as SourceRun,
    Stratum as Stratum,
    Success as Success,
    TrialBook as TrialBook,
    TrialSheet as TrialSheet,
    export_trials as export_trials,
    load_sources as load_sources,
    load_trials as load_trials,
    trial_rows as trial_rows,
)
