from .antipodal_sampling import (
    Accept as Accept,
    AntipodalSettings as AntipodalSettings,
    ContactPairSettings as ContactPairSettings,
    PairRejection as PairRejection,
    SamplingEffort as SamplingEffort,
    sample_antipodal as sample_antipodal,
)
from .approach_cones import ApproachCone as ApproachCone
from .average_precision import (
    FRICTION_NEEDED as FRICTION_NEEDED,
    GraspNetSettings as GraspNetSettings,
    Ranking as Ranking,
    TopPrecision as TopPrecision,
    graspnet_ap as graspnet_ap,
    precision_at_top as precision_at_top,
    precision_recall as precision_recall,
    rank_by as rank_by,
    rank_by_score as rank_by_score,
    suppress_near_grasps as suppress_near_grasps,
)
from .clearance_verdict import (
    CLEARANCE_VERSION as CLEARANCE_VERSION,
    Clearance as Clearance,
    ClearanceBatch as ClearanceBatch,
)
from .collision_geometry import (
    filter_hand_pairs as filter_hand_pairs,
    read_shapes as read_shapes,
    screened_bodies as screened_bodies,
    shape_of as shape_of,
)
from .grasp_distance import (
    DISTANCE_LEVER as DISTANCE_LEVER,
    DISTANCE_VERSION as DISTANCE_VERSION,
    check_lever as check_lever,
    grasp_components as grasp_components,
    pair_angle as pair_angle,
    pair_translation as pair_translation,
)
from .hand_clearance import (
    ClearanceMode as ClearanceMode,
    HandClearance as HandClearance,
    hand_clearance_alone as hand_clearance_alone,
)
from .neighbour_search import (
    Tolerance as Tolerance,
    farthest_points as farthest_points,
    find_nearest as find_nearest,
    find_within as find_within,
    neighbour_distances as neighbour_distances,
)
from .pad_contacts import (
    PANDA_JAWS as PANDA_JAWS,
    SLIDE_STEPS as SLIDE_STEPS,
    TURN_RESISTANCE as TURN_RESISTANCE,
    Contacts as Contacts,
    Jaws as Jaws,
    are_antipodal as are_antipodal,
    friction_needed as friction_needed,
    grasp_contacts as grasp_contacts,
    jaws_of as jaws_of,
    press_pads as press_pads,
    slide_to_rest as slide_to_rest,
)
from .quality_metrics import (
    DEFAULT_METRIC as DEFAULT_METRIC,
    METRICS as METRICS,
    QUALITY_VERSION as QUALITY_VERSION,
    STANDARD_GRAVITY as STANDARD_GRAVITY,
    Payload as Payload,
    Quality as Quality,
    check_metric as check_metric,
    grasp_quality as grasp_quality,
    quality_provenance as quality_provenance,
    score_of as score_of,
)
from .set_comparison import (
    DISTRIBUTION_QUANTILES as DISTRIBUTION_QUANTILES,
    Distribution as Distribution,
    Matches as Matches,
    ObjectComparison as ObjectComparison,
    ObjectSummary as ObjectSummary,
    SetComparison as SetComparison,
    SetSummary as SetSummary,
    Share as Share,
    compare_grasps as compare_grasps,
    coverage as coverage,
    distribution as distribution,
    nearest_grasps as nearest_grasps,
    precision as precision,
    summarize as summarize,
)
from .wrench_margins import (
    ANY_FORCE as ANY_FORCE,
    ANY_WRENCH as ANY_WRENCH,
    epsilon_bracket as epsilon_bracket,
    force_along as force_along,
    wrench_reaches as wrench_reaches,
)
from .wrench_space import (
    WrenchSpace as WrenchSpace,
    hull_volume as hull_volume,
    triangulated_ball as triangulated_ball,
)
