from .grasp_counts import (
    CountedGrasps as CountedGrasps,
    GraspWatch as GraspWatch,
)
from .process import (
    BackgroundJob as BackgroundJob,
    BackgroundWorker as BackgroundWorker,
)
from .settling import (
    Settle as Settle,
    SettlingProposal as SettlingProposal,
    moved_names as moved_names,
)
