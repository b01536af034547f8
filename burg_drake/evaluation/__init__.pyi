from .cascade import evaluate as evaluate
from .feasibility import (
    ReachJudgeFactory as ReachJudgeFactory,
    reach as reach,
    reach_columns as reach_columns,
)
from .replay import (
    arm_figures as arm_figures,
    as_result as as_result,
    comparison as comparison,
    decisive_mode as decisive_mode,
    differences as differences,
    motion_figures as motion_figures,
    rerun as rerun,
)
from .second_opinion import (
    judge_again as judge_again,
    require_second_engine as require_second_engine,
)
