from .cascade import evaluate as evaluate
from .feasibility import (
    ReachJudgeFactory as ReachJudgeFactory,
    reach as reach,
    reach_columns as reach_columns,
)
from .records.table_file import read_table as read_table
from .replay import (
    arm_figures as arm_figures,
    as_result as as_result,
    comparison as comparison,
    decisive_mode as decisive_mode,
    differences as differences,
    motion_figures as motion_figures,
    rerun as rerun,
)
from .report import write_report as write_report
from .results.summary import summarize as summarize
from .results.summary_tables import summary_view as summary_view
from .run.settings import EvaluationSettings as EvaluationSettings
from .stages.judge import (
    Decision as Decision,
    Judge as Judge,
    Screen as Screen,
)
from .stages.station_judge import (
    StationJudge as StationJudge,
    build_judge as build_judge,
)
from .store.run_folder import (
    Run as Run,
    load_run as load_run,
)
