from .average_precision import (
    TopPrecision as TopPrecision,
    graspnet_ap as graspnet_ap,
)
from .matching import (
    Matches as Matches,
    Share as Share,
    coverage as coverage,
    precision as precision,
)
from .score_ranking import (
    FRICTION_NEEDED as FRICTION_NEEDED,
    Ranking as Ranking,
    rank_by as rank_by,
)
from .summary import (
    QUANTILES as QUANTILES,
    Distribution as Distribution,
    ObjectComparison as ObjectComparison,
    ObjectSummary as ObjectSummary,
    SetComparison as SetComparison,
    SetSummary as SetSummary,
    compare_grasps as compare_grasps,
    summarize as summarize,
)
