from .changes import (
    Change as Change,
    OutcomeChange as OutcomeChange,
    gap_changes as gap_changes,
)
from .measurement import measure_gap as measure_gap
from .placement_noise import PlacementNoise as PlacementNoise
from .rejudged_files import rejudging_json as rejudging_json
from .rejudged_trials import (
    Rejudged as Rejudged,
    Rejudging as Rejudging,
    runs_for as runs_for,
)
from .rejudging import rejudge as rejudge
from .settings import GapSettings as GapSettings
from .step_agreement import (
    agreement_by_step as agreement_by_step,
    tried_grasps as tried_grasps,
)
from .steps import (
    GapDocument as GapDocument,
    GapStep as GapStep,
    GapSteps as GapSteps,
)
