from .average_precision import TopPrecision as TopPrecision
from .matching import Share as Share
from .score_ranking import (
    FRICTION_NEEDED as FRICTION_NEEDED,
    Ranking as Ranking,
    rank_by as rank_by,
)
from .summary import (
    QUANTILES as QUANTILES,
    Distribution as Distribution,
    SetComparison as SetComparison,
    SetSummary as SetSummary,
    compare_grasps as compare_grasps,
    summarize as summarize,
)
