"""Runs and campaigns: their documents and rows, judging on other machines, robustness of grasps."""

from burg_drake.core.grasps import (
    Mode as Mode,
    Verdict as Verdict,
)
from burg_drake.core.terminal import (
    Listener as Listener,
    Progress as Progress,
)
from burg_drake.core.workers import TimeLimit as TimeLimit
from burg_drake.evaluation import judge_again as judge_again
from burg_drake.evaluation.candidates import (
    Candidate as Candidate,
    Candidates as Candidates,
)
from burg_drake.evaluation.cluster import (
    DaskExecutor as DaskExecutor,
    connect_cluster as connect_cluster,
)
from burg_drake.evaluation.merge import (
    merge_runs as merge_runs,
)
from burg_drake.evaluation.records import (
    CampaignDocument as CampaignDocument,
    Grasps as Grasps,
    Input as Input,
    Library as Library,
    RecordedTrial as RecordedTrial,
    RunDocument as RunDocument,
    SceneEntry as SceneEntry,
    SceneState as SceneState,
    Shard as Shard,
    TrialOrigin as TrialOrigin,
    WorkSession as WorkSession,
)
from burg_drake.evaluation.results import (
    Status as Status,
    read_status as read_status,
)
from burg_drake.evaluation.robustness import (
    GraspRobustness as GraspRobustness,
    ProbeAnswer as ProbeAnswer,
    Robustness as Robustness,
    RobustnessSettings as RobustnessSettings,
    assess_robustness as assess_robustness,
)
from burg_drake.evaluation.run import (
    GraspsLike as GraspsLike,
)
from burg_drake.evaluation.stages import (
    Decision as Decision,
    Judge as Judge,
    Screen as Screen,
)
from burg_drake.evaluation.store import (
    StoredRows as StoredRows,
    StoredRun as StoredRun,
    load_runs as load_runs,
)
from burg_drake.evaluation.workers import (
    Executor as Executor,
    Job as Job,
    JobFailed as JobFailed,
    LocalExecutor as LocalExecutor,
    OnFailure as OnFailure,
    WorkerLimits as WorkerLimits,
)
