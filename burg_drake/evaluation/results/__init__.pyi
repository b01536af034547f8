from .best_grasps import (
    RankedGrasps as RankedGrasps,
    best_of_each as best_of_each,
    index_of as index_of,
    ranked_run as ranked_run,
    ranked_set as ranked_set,
    shown_ids as shown_ids,
)
from .counts import (
    PUSH as PUSH,
    OutcomeCounts as OutcomeCounts,
    Summary as Summary,
    pushes as pushes,
)
from .notes import (
    lifted_and_failed as lifted_and_failed,
    missing_grasps_note as missing_grasps_note,
    run_notes as run_notes,
    shortfalls as shortfalls,
    unclear_notes as unclear_notes,
    unmoved_notes as unmoved_notes,
)
from .shortened_lifts import short_lifts as short_lifts
from .status import (
    Status as Status,
    Watch as Watch,
    read_status as read_status,
)
from .summary import summarize as summarize
from .summary_tables import summary_view as summary_view
