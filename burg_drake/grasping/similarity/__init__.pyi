from .diversity import (
    farthest_points as farthest_points,
    neighbour_distances as neighbour_distances,
)
from .neighbour_search import (
    Tolerance as Tolerance,
    find_nearest as find_nearest,
    find_within as find_within,
)
from .pose_distance import (
    DISTANCE_VERSION as DISTANCE_VERSION,
    LEVER as LEVER,
    check_lever as check_lever,
    components as components,
    pair_angle as pair_angle,
    pair_translation as pair_translation,
)
from .targets import (
    INSTANCE as INSTANCE,
    by_shared_target as by_shared_target,
    by_target as by_target,
)
