from .arm_span import ArmSpan as ArmSpan
from .reach_layer import (
    ReachLayer as ReachLayer,
    reach_from_above as reach_from_above,
    reach_without_objects as reach_without_objects,
)
from .reachability import (
    ReachabilityMap as ReachabilityMap,
    ReachabilitySettings as ReachabilitySettings,
    cleared as cleared,
    map_reachability as map_reachability,
)
from .station_check import (
    ArmFigures as ArmFigures,
    StationReport as StationReport,
    empty_scene as empty_scene,
    inspect_station as inspect_station,
    percent as percent,
)
from .station_proposal import (
    find_built_in as find_built_in,
    propose_station as propose_station,
)
from .usable_arm import require_usable_arm as require_usable_arm
