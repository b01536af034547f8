from .executor import (
    Executor as Executor,
    LocalExecutor as LocalExecutor,
)
from .job import (
    Job as Job,
    JobFailed as JobFailed,
    OnFailure as OnFailure,
)
from .limits import WorkerLimits as WorkerLimits
from .pool import (
    Answer as Answer,
    JudgePool as JudgePool,
)
from .single_job import judge_all as judge_all
