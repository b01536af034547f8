from .crew import (
    serve as serve,
    work_through as work_through,
)
from .prefetch import (
    OrderedWorker as OrderedWorker,
    Prefetcher as Prefetcher,
)
from .processes import (
    cause_of_death as cause_of_death,
    default_workers as default_workers,
    start_worker as start_worker,
    was_ended_from_outside as was_ended_from_outside,
)
