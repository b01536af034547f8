from .allocator import (
    PRELOAD as PRELOAD,
    worker_preload as worker_preload,
)
from .limits import TimeLimit as TimeLimit
from .pool import WorkerPool as WorkerPool
from .prefetch import Prefetcher as Prefetcher
from .processes import (
    default_workers as default_workers,
    exit_cause as exit_cause,
    start_worker as start_worker,
    worker_count as worker_count,
)
from .tasks import (
    Session as Session,
    Task as Task,
    WorkerFuture as WorkerFuture,
)
from .unordered import map_unordered as map_unordered
from .worker import report_progress as report_progress
