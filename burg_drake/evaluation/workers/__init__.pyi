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
    Pool as Pool,
)
from .single_job import judge_all as judge_all
